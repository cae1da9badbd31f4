"""The demo on a corner of its town: the whole way, small."""

import json
from io import StringIO

import pytest
from rich.console import Console

from coordinator.cli.demo import _summary, _table
from coordinator.cli.show import Bars
from coordinator.demo import Answer, DemoReport, run_demo
from coordinator.engine.running import Engine
from survey.synthetic import ShotOptions

CORNER = ShotOptions(width_px=400, height_px=300, n_queries=4, max_stops=4)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory, engine: Engine) -> DemoReport:
    return run_demo(tmp_path_factory.mktemp("demo"), engine, Bars(None), CORNER)


def test_every_query_is_answered_three_ways(report: DemoReport) -> None:
    assert len(report.rows) == 4
    assert {row.query.style for row in report.rows} == {"sepia", "halftone", "engraving", "night"}
    for row in report.rows:
        assert 2 <= len(row.flaneur.detectors) <= 4
        assert row.plain.detectors == ("hesaff",)
        assert row.chance.metres is not None


def test_the_geojson_holds_matches_and_estimates_of_every_query(report: DemoReport) -> None:
    written = json.loads(report.geojson.read_text())
    assert written["flaneur"]["attribution"] == ["Survey and photos rendered by Flaneur"]
    features = written["features"]
    for kind in ("match", "estimate"):
        found = {
            each["properties"]["query"] for each in features if each["properties"]["kind"] == kind
        }
        assert len(found) == 4


def test_the_page_stands_alone_and_shows_every_query(report: DemoReport) -> None:
    page = report.page.read_text()
    assert all(row.query.file in page for row in report.rows)
    assert 'src="http' not in page


def test_the_table_says_what_was_right(report: DemoReport) -> None:
    console = Console(width=80, record=True, file=StringIO())
    console.print(_table(report))
    said = console.export_text()
    assert all(row.query.file.split("-")[0] in said for row in report.rows)
    assert "of 4" in _summary(report, 1.0)


@pytest.mark.parametrize(
    ("metres", "facade", "right"),
    [(24.9, True, True), (25.1, True, False), (1.0, False, False), (None, True, False)],
)
def test_right_is_near_and_on_the_right_facade(
    metres: float | None, facade: bool, right: bool
) -> None:
    assert Answer((), 2, metres, facade).right is right
