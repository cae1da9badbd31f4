"""What the doctor says of image files, times, doubles, and of a vehicle in the picture."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from doctored_survey import (
    EAST_M,
    FIELDS,
    NORTH_M,
    NOW,
    Row,
    good_rows,
    of_camera,
    write_picture,
    write_pictures,
    write_table,
)
from PIL import Image, ImageDraw

from contracts.errors import BadSurvey
from survey import ReadOptions, read_survey
from survey.doctor import Examination, Finding, examine

LAMBERT = ReadOptions(crs="EPSG:2154")


@pytest.fixture
def rows() -> list[Row]:
    """One camera: 60 images."""
    return of_camera(good_rows(), "ahead")


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a rig; drawn once."""
    folder = tmp_path_factory.mktemp("pictures")
    write_pictures(folder, good_rows())
    return folder


@pytest.fixture
def folder(pictures: Path, tmp_path: Path, rows: list[Row]) -> Path:
    """A survey of one camera that a test may spoil."""
    for row in rows:
        shutil.copy(pictures / str(row["file"]), tmp_path)
    return tmp_path


def examined(
    folder: Path, rows: list[Row], options: ReadOptions = LAMBERT, fields: tuple[str, ...] = FIELDS
) -> Examination:
    return examine(write_table(folder / "poses.csv", rows, fields), options, NOW)


def found(examination: Examination, check: str) -> Finding:
    """The one finding of a check."""
    (finding,) = [each for each in examination.findings if each.check == check]
    return finding


def test_images_without_a_row_and_rows_without_an_image_are_counted(
    folder: Path, rows: list[Row]
) -> None:
    (folder / str(rows[3]["file"])).unlink()
    (folder / str(rows[4]["file"])).unlink()
    examination = examined(folder, [row for row in rows if row is not rows[9]])
    without_image = found(examination, "pose-without-image")
    assert without_image.what.startswith("2 of 60 (3 %) left out")
    assert len(without_image.uris) == 2
    assert found(examination, "image-without-pose").uris == (rows[9]["file"],)


def test_files_that_cannot_be_read_are_named(folder: Path, rows: list[Row]) -> None:
    (folder / str(rows[2]["file"])).write_bytes(b"")
    finding = found(examined(folder, rows), "unreadable")
    assert (finding.severity, finding.uris) == ("warning", (rows[2]["file"],))
    assert "empty (0 bytes)" in finding.what


def test_many_files_that_cannot_be_read_are_an_error(folder: Path, rows: list[Row]) -> None:
    for row in rows[::3]:
        (folder / str(row["file"])).write_text("no picture")
    assert found(examined(folder, rows), "unreadable").severity == "error"


def test_thumbnails_are_told(folder: Path, rows: list[Row]) -> None:
    for number, row in enumerate(rows):
        write_picture(folder / str(row["file"]), number, (160, 120))
    assert "small" in found(examined(folder, rows), "image-size").what


def test_wide_and_tall_images_of_a_camera_are_a_note(folder: Path, rows: list[Row]) -> None:
    for number, row in enumerate(rows[:10]):
        write_picture(folder / str(row["file"]), number, (384, 512))
    finding = found(examined(folder, rows), "orientation")
    assert (finding.severity, "50 images" in finding.what) == ("note", True)


def test_copies_of_a_file_are_told_by_their_bytes(folder: Path, rows: list[Row]) -> None:
    same = (folder / str(rows[1]["file"])).read_bytes()
    (folder / str(rows[30]["file"])).write_bytes(same)
    other = bytearray(same)
    other[len(other) // 3] ^= 1  # of the same size, and alike in the middle
    (folder / str(rows[31]["file"])).write_bytes(other)
    finding = found(examined(folder, rows), "duplicate-image")
    assert finding.uris == (rows[1]["file"], rows[30]["file"])


def test_a_pose_that_is_there_twice_is_told(folder: Path, rows: list[Row]) -> None:
    for name in ("x", "y", "z", "heading", "pitch", "roll"):
        rows[21][name] = rows[20][name]
    finding = found(examined(folder, rows), "duplicate-pose")
    assert (finding.severity, finding.uris) == ("warning", (rows[20]["file"], rows[21]["file"]))


def test_a_time_that_is_there_twice_is_told(folder: Path, rows: list[Row]) -> None:
    rows[21]["time"] = rows[20]["time"]
    finding = found(examined(folder, rows), "duplicate-time")
    assert (finding.severity, len(finding.uris)) == ("warning", 2)


def test_cameras_without_names_are_guessed_from_repeated_times(
    pictures: Path, tmp_path: Path
) -> None:
    rig = good_rows(20)
    for number, row in enumerate(rig):
        row["file"] = shutil.copy(pictures / str(row["file"]), tmp_path / f"{number}.jpg").name
    no_camera = tuple(name for name in FIELDS if name != "camera")
    examination = examined(tmp_path, rig, fields=no_camera)
    finding = found(examination, "duplicate-time")
    assert (finding.severity, "rig" in finding.what) == ("note", True)
    assert "several cameras" in found(examination, "headings-track").what


def test_cameras_without_names_are_told_apart_by_their_files(pictures: Path) -> None:
    no_camera = tuple(name for name in FIELDS if name != "camera")
    examination = examined(pictures, good_rows(), fields=no_camera)
    assert examination.figures.cameras == tuple(
        f"{name}-#.jpg" for name in ("ahead", "back", "left", "right")
    )
    assert {each.severity for each in examination.findings} == {"note"}


def test_times_without_a_zone_are_told(folder: Path, rows: list[Row]) -> None:
    for row in rows[:7]:
        row["time"] = str(row["time"]).removesuffix("+00:00")
    finding = found(examined(folder, rows), "time")
    assert (finding.severity, len(finding.uris)) == ("warning", 7)
    assert "[time] zone" in finding.mend


def test_no_time_at_all_is_a_note(folder: Path, rows: list[Row]) -> None:
    examination = examined(folder, rows, fields=tuple(name for name in FIELDS if name != "time"))
    assert found(examination, "time").severity == "note"


@pytest.mark.parametrize("time", ["2031-05-01T00:00:00Z", "1980-01-06T00:00:00Z"])
def test_times_that_cannot_be_are_told(folder: Path, rows: list[Row], time: str) -> None:
    rows[11]["time"] = time
    finding = found(examined(folder, rows), "time-impossible")
    assert finding.uris == (rows[11]["file"],)


def test_a_clock_that_goes_back_is_told(folder: Path, rows: list[Row]) -> None:
    for row in rows[30:]:
        row["time"] = str(row["time"]).replace("T09:", "T08:")
    finding = found(examined(folder, rows), "clock-backwards")
    assert finding.uris == (rows[30]["file"],)
    assert "3,599 s" in finding.what


def test_names_in_no_order_of_time_are_no_fault(folder: Path, rows: list[Row]) -> None:
    times = [row["time"] for row in rows]
    for row, at in zip(rows, np.random.default_rng(0).permutation(60), strict=True):
        row["time"] = times[at]
    assert "clock-backwards" not in {each.check for each in examined(folder, rows).findings}


def test_a_pause_is_a_note_with_its_length(folder: Path, rows: list[Row]) -> None:
    for row in rows[30:]:
        row["time"] = str(row["time"]).replace("T09:", "T12:")
        row["x"] = float(row["x"]) + 400.0
    finding = found(examined(folder, rows), "time-gap")
    assert "3 hours" in finding.what
    assert finding.what.startswith("1 pauses")
    assert "over 1 of them" in finding.what


def test_a_vehicle_in_the_picture_is_told_with_where(folder: Path, rows: list[Row]) -> None:
    for row in rows:
        bonnet(folder / str(row["file"]))
    finding = found(examined(folder, rows), "vehicle")
    assert finding.severity == "warning"
    assert "% down" in finding.what


def test_a_vehicle_in_a_dense_film_is_told(folder: Path, rows: list[Row]) -> None:
    """0.7 m from image to image is not standing still."""
    for number, row in enumerate(rows):
        row |= {"x": EAST_M + 0.7 * number, "y": NORTH_M, "heading": 90.0}
        bonnet(folder / str(row["file"]))
    assert found(examined(folder, rows), "vehicle").severity == "warning"


def test_a_street_without_a_vehicle_is_none(folder: Path, rows: list[Row]) -> None:
    assert "vehicle" not in {each.check for each in examined(folder, rows).findings}


def test_images_alone_are_examined_as_files(folder: Path, rows: list[Row]) -> None:
    del rows
    (folder / "ahead-001.jpg").write_bytes((folder / "ahead-000.jpg").read_bytes())
    examination = examine(folder, ReadOptions(no_pose=True), NOW)
    assert {each.check for each in examination.findings} == {"time", "duplicate-image"}
    assert examination.figures.images == 60
    assert examination.track is None


def test_real_vehicles_show_without_their_masks_and_not_with_them(test_data: Path) -> None:
    """Stereopolis: cameras 301 and 303 see the vehicle, 302 and 304 do not, 300 the sky."""
    survey = test_data / "stereopolis-paris6"
    bare = examine(survey, ReadOptions(use_masks=False), NOW)
    seen = [each for each in bare.findings if each.check == "vehicle"]
    assert [each.what[:3] for each in seen] == ["301", "303"]
    masked = examine(survey, ReadOptions(), NOW)
    assert {each.severity for each in masked.findings} == {"note"}


@pytest.mark.parametrize("name", ["lund", "arezzo", "mapillary"])
def test_photographs_with_gps_raise_no_false_alarm(test_data: Path, name: str) -> None:
    examination = examine(test_data / "gps-photos" / name, ReadOptions(), NOW)
    assert {each.severity for each in examination.findings} == {"note"}


def bonnet(file: Path) -> None:
    """Draw the front of a vehicle into a picture."""
    with Image.open(file) as image:
        picture = image.copy()
    draw = ImageDraw.Draw(picture)
    draw.polygon([(80, 384), (140, 320), (370, 320), (430, 384)], "black", "white", 6)
    for x in range(160, 350, 48):
        draw.rectangle((x, 336, x + 20, 368), "white")
    picture.save(file, quality=80)


def test_a_folder_without_images_is_refused_as_by_index(tmp_path: Path) -> None:
    examination = examine(tmp_path, ReadOptions(), NOW)
    refusal = found(examination, "refused")
    assert refusal.severity == "error"
    with pytest.raises(BadSurvey) as refused:
        read_survey(tmp_path, ReadOptions())
    assert refusal.what == str(refused.value)
