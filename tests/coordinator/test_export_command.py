"""`flaneur export` as a user runs it."""

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
