"""`flaneur plan`: what it prints, its exit codes, and that it leaves nothing behind."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from coordinator.cli import main

FEW = ("--max-frames", "40", "--detectors", "mser", "--max-words", "50", "--crs", "EPSG:2154")


def plan(*arguments: str | Path) -> Result:
    answer = CliRunner().invoke(main, ["plan", *map(str, arguments)])
    assert answer.exception is None or isinstance(answer.exception, SystemExit)
    return answer


def report_of(*arguments: str | Path, exit_code: int = 0) -> dict[str, Any]:
    answer = plan(*arguments, *FEW, "--json")
    assert answer.exit_code == exit_code, answer.stderr
    report: dict[str, Any] = json.loads(answer.stdout)
    return report


@pytest.fixture
def survey(small_survey: Path, tmp_path: Path) -> Path:
    """A copy that may be damaged."""
    folder = tmp_path / "survey"
    shutil.copytree(small_survey, folder)
    return folder


def test_the_report_has_every_stage_and_the_workers_asked_for(small_survey: Path) -> None:
    before = sorted(small_survey.iterdir())
    report = report_of(small_survey, "--workers", "3", "--workers", "1", "--sample", "4")
    assert (report["images"], report["sampled"], report["shards"]) == (10, 4, 2)
    assert report["shard_size"] == 8
    assert list(report["stages"]) == ["extract", "train", "assign", "merge", "join"]
    assert list(report["wall_s"]) == ["1", "3"]
    assert set(report["channels"]) == {"mser-sift", "mser-surf", "mser-sc"}
    assert {channel["words"] for channel in report["channels"].values()} == {50}
    assert 0.0 < report["core_s"]["low"] < report["core_s"]["likely"] < report["core_s"]["high"]
    assert report["messages"] == 2 + 3 + 2 + 3 + 3
    assert sorted(small_survey.iterdir()) == before


def test_a_person_reads_times_memory_and_disk(small_survey: Path) -> None:
    answer = plan(small_survey, *FEW, "--sample", "3")
    assert answer.exit_code == 0, answer.stderr
    lines = answer.stdout.splitlines()
    assert lines[0].startswith("10 images; 3 sampled")
    assert "Shards: 2 of 8 images" in lines
    for beginning in ("extract", "whole job", "memory", "finished index", "room needed"):
        assert any(line.startswith(beginning) for line in lines), beginning
    assert "8 workers" in answer.stdout


def test_unreadable_images_of_the_sample_are_told_with_the_share_to_expect(survey: Path) -> None:
    (survey / "04.jpg").write_bytes((survey / "04.jpg").read_bytes()[:300])
    answer = plan(survey, *FEW)
    assert answer.exit_code == 3
    assert "1 of the 10 sampled cannot be read: expect 1 (" in answer.stdout
    assert "04.jpg" in answer.stderr


def test_images_that_the_survey_leaves_out_are_told_as_index_tells_them(survey: Path) -> None:
    (survey / "03.jpg").unlink()
    report = report_of(survey, "--sample", "2", exit_code=3)
    assert (report["images"], report["not_read"]) == (9, 1)


def test_a_survey_of_which_nothing_can_be_read_is_refused(survey: Path) -> None:
    for image in survey.glob("*.jpg"):
        image.write_bytes(b"no image")
    answer = plan(survey, *FEW)
    assert answer.exit_code == 2
    assert "Not one of the" in answer.stderr or "not one usable image" in answer.stderr


@pytest.mark.parametrize(
    "wrong", [("--sample", "0"), ("--workers", "0"), ("--detectors", "eye"), ("--also", "nameless")]
)
def test_wrong_options_are_refused_before_any_work(
    small_survey: Path, wrong: tuple[str, str]
) -> None:
    assert plan(small_survey, *wrong).exit_code == 2
