"""`flaneur doctor` as a person and as a program run it."""

import json
from pathlib import Path
from typing import Any

import pytest
from flaneur_command import run
from PIL import Image
from typer.testing import CliRunner

from coordinator.cli import main


def doctor(*arguments: str | Path) -> tuple[int, str, str]:
    answer = CliRunner().invoke(main, ["doctor", *map(str, arguments)])
    assert answer.exception is None or isinstance(answer.exception, SystemExit)
    return answer.exit_code, answer.stdout, answer.stderr


@pytest.fixture
def survey(tmp_path: Path) -> Path:
    """Twelve images of noise, 4 m apart, east through Paris."""
    folder = tmp_path / "my survey"
    folder.mkdir()
    lines = ["file,x,y,z,heading,pitch,roll,time"]
    for number in range(12):
        noise = Image.effect_noise((640, 480), 40 + number)
        noise.save(folder / f"{number:02d}.jpg")
        place = f"{652000 + 4 * number},6862000,{40 + 0.1 * number},{90 + 0.1 * (number % 3)},0,1"
        lines.append(f"{number:02d}.jpg,{place},2020-05-01T10:00:{number:02d}Z")
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    return folder


def test_a_good_survey_exits_with_0_and_says_what_it_is(survey: Path) -> None:
    code, stdout, _ = doctor(survey, "--crs", "EPSG:2154")
    assert code == 0
    assert "12 images, 12 at a known position" in stdout
    assert "0 errors, 0 warnings" in stdout


def test_a_warning_exits_with_3_and_names_the_images(survey: Path) -> None:
    (survey / "unposed.jpg").write_bytes((survey / "03.jpg").read_bytes()[:-9])
    code, stdout, _ = doctor(survey, "--crs", "EPSG:2154")
    assert code == 3
    assert "WARNING image-without-pose" in stdout
    assert "unposed.jpg" in stdout


def test_an_error_exits_with_2_and_says_what_mends_it(survey: Path) -> None:
    code, stdout, _ = doctor(survey)
    assert code == 2
    assert "mend: --crs EPSG:2154" in stdout


def test_nothing_there_is_wrong_input(tmp_path: Path) -> None:
    code, stdout, stderr = doctor(tmp_path / "nowhere")
    assert (code, stdout) == (2, "")
    assert "does not exist" in stderr


def test_json_has_keys_that_stay(survey: Path) -> None:
    answer = run("doctor", survey, "--crs", "EPSG:2154", "--json")
    assert answer.returncode == 0
    report: dict[str, Any] = json.loads(answer.stdout)
    assert report.keys() == {
        "survey", "format", "crs", "errors", "warnings", "notes", "figures", "findings",
    }  # fmt: skip
    assert (report["format"], report["crs"]) == ("table", "EPSG:2154")
    assert report["figures"]["images"] == 12
    for finding in report["findings"]:
        assert finding.keys() == {"check", "severity", "what", "n_images", "examples", "mend"}
    assert len(report["findings"]) == report["errors"] + report["warnings"] + report["notes"]


def test_a_report_is_a_folder_with_a_map(survey: Path, tmp_path: Path) -> None:
    code, _, _ = doctor(survey, "--crs", "EPSG:2154", "--out", tmp_path / "report")
    assert code == 0
    assert json.loads((tmp_path / "report" / "report.json").read_text())["errors"] == 0
    assert "0 errors" in (tmp_path / "report" / "report.txt").read_text()
    with Image.open(tmp_path / "report" / "track.png") as picture:
        assert picture.width > 800


@pytest.mark.parametrize("option", [("--out", "report"), ("--picture", "maps/track.png")])
@pytest.mark.parametrize("read", ["", "poses.csv"])
def test_a_picture_in_the_survey_s_own_folder_is_refused(
    survey: Path, option: tuple[str, str], read: str
) -> None:
    before = sorted(survey.iterdir())
    name, value = option
    code, stdout, stderr = doctor(survey / read, "--crs", "EPSG:2154", name, survey / value)
    assert (code, stdout) == (2, "")
    assert f"{name} {survey / value} lies in the survey's own folder" in " ".join(stderr.split())
    assert sorted(survey.iterdir()) == before


def test_a_picture_of_nothing_is_said(survey: Path, tmp_path: Path) -> None:
    code, _, stderr = doctor(survey, "--no-pose", "--picture", tmp_path / "track.png")
    assert code == 0
    assert "Nothing drawn" in stderr
    assert not (tmp_path / "track.png").exists()


@pytest.mark.parametrize(
    "option",
    [("--picture", "track.gif"), ("--out", "poses.csv"), ("--format", "nonsense"),
     ("--crs", "EPSG:0")],
)  # fmt: skip
def test_a_wrong_option_is_refused_before_the_work(survey: Path, option: tuple[str, str]) -> None:
    name, value = option
    code, stdout, stderr = doctor(survey, name, survey / value if name == "--out" else value)
    assert (code, stdout) == (2, "")
    assert value in stderr


def test_a_name_cannot_write_to_the_terminal(survey: Path) -> None:
    (survey / "\x1b[31mred.jpg").write_bytes((survey / "03.jpg").read_bytes()[:-9])
    _, stdout, _ = doctor(survey, "--crs", "EPSG:2154")
    assert "\x1b" not in stdout
    assert "red.jpg" in stdout
