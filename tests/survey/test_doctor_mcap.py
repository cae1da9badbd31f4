"""What the doctor says of recordings."""

from pathlib import Path

from doctored_survey import NOW
from mcap_drives import CAMERA, Protobuf, drive, jpeg

from survey import ReadOptions
from survey.doctor import Finding, examine


def findings(path: Path, options: ReadOptions | None = None) -> dict[str, Finding]:
    return {each.check: each for each in examine(path, options or ReadOptions(), NOW).findings}


def test_a_good_drive_has_no_errors(tmp_path: Path) -> None:
    Protobuf().write(tmp_path / "drive.mcap", drive(Protobuf()))
    found = findings(tmp_path / "drive.mcap")
    assert {finding.severity for finding in found.values()} <= {"note", "warning"}


def test_metres_of_a_local_frame_are_not_taken_for_degrees(tmp_path: Path) -> None:
    said = [item for item in drive(Protobuf()) if item.topic != "/fix"]
    Protobuf().write(tmp_path / "drive.mcap", said)
    for options in (ReadOptions(), ReadOptions(crs="EPSG:2154")):
        found = findings(tmp_path / "drive.mcap", options)
        assert "--no-pose" in found["local-frame"].mend
        assert not any("--crs" in each.mend for each in found.values())
        assert not any("EPSG:4326" in each.what + each.mend for each in found.values())


def test_a_drive_that_places_no_image_is_refused(tmp_path: Path) -> None:
    made = Protobuf()
    said = [
        made.fix("/fix", 0.0, CAMERA, 2.35, 48.85, 80.0),
        made.image("/c", 1.0, CAMERA, jpeg(0)),
    ]
    made.write(tmp_path / "drive.mcap", said)
    assert findings(tmp_path / "drive.mcap")["refused"].severity == "error"


def test_positions_with_a_gap_are_mended_by_the_gap_allowed(tmp_path: Path) -> None:
    made = Protobuf()
    said = [made.fix("/fix", at, CAMERA, 2.35 + at * 1e-5, 48.85, 80.0) for at in (0.0, 3.0, 3.5)]
    said += [made.image("/c", at, CAMERA, jpeg(0)) for at in (1.0, 3.25)]
    made.write(tmp_path / "drive.mcap", sorted(said, key=lambda item: item.time_ns))
    assert "--max-gap" in findings(tmp_path / "drive.mcap")["image-without-pose"].mend
    options = ReadOptions(max_gap_s=5.0)
    assert "image-without-pose" not in findings(tmp_path / "drive.mcap", options)
