"""`flaneur export` as a user runs it."""

import shutil
from pathlib import Path

import pytest
from mcap.reader import make_reader
from typer.testing import CliRunner

from coordinator.cli.main import main


def test_a_survey_becomes_one_mcap_file(small_survey: Path, tmp_path: Path) -> None:
    out = tmp_path / "survey.mcap"
    arguments = ["export", "mcap", str(small_survey), str(out), "--crs", "EPSG:2154"]
    told = CliRunner().invoke(main, arguments)
    assert told.exit_code == 0, told.stderr
    assert "10 of 10 images" in told.stderr
    with out.open("rb") as stream:
        images = [
            message
            for schema, _, message in make_reader(stream).iter_messages()
            if schema is not None and schema.name == "foxglove.CompressedImage"
        ]
    assert len(images) == 10


def test_a_mask_that_is_missing_does_not_stop_an_export(test_data: Path, tmp_path: Path) -> None:
    survey = tmp_path / "survey"
    source = test_data / "stereopolis-paris6"
    shutil.copytree(source, survey, ignore=shutil.ignore_patterns("mask*.jpg"))
    few = ["--include", "*-301-*000048?.jpg"]
    arguments = ["export", "mcap", str(survey), str(tmp_path / "out.mcap"), *few]
    told = CliRunner().invoke(main, arguments)
    assert told.exit_code == 0, told.stderr


def test_a_ballpark_conversion_is_exported_where_it_is_allowed(
    small_survey: Path, tmp_path: Path
) -> None:
    nameless = "+proj=tmerc +lat_0=48 +lon_0=2 +ellps=airy +units=m +no_defs +type=crs"
    out = tmp_path / "out.mcap"
    arguments = ["export", "mcap", str(small_survey), str(out), "--crs", nameless]
    assert CliRunner().invoke(main, arguments).exit_code == 2
    told = CliRunner().invoke(main, [*arguments, "--allow-ballpark"])
    assert told.exit_code == 0, told.stderr
    assert "as --allow-ballpark permits" in " ".join(told.stderr.split())


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["mcap", "SURVEY", "SURVEY"], "a folder"),
        (["mcap", "GONE", "OUT"], "does not exist"),
        (["mcap", "SURVEY", "OUT", "--crs", "EPSG:1"], "EPSG:1"),
    ],
)
def test_what_makes_no_sense_is_refused(
    small_survey: Path, tmp_path: Path, arguments: list[str], says: str
) -> None:
    places = {"SURVEY": small_survey, "GONE": tmp_path / "gone", "OUT": tmp_path / "out.mcap"}
    told = CliRunner().invoke(main, ["export", *(str(places.get(a, a)) for a in arguments)])
    assert told.exit_code == 2
    assert says in told.stderr
    assert list(tmp_path.iterdir()) == []
