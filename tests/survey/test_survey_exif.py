import math
from pathlib import Path

import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from contracts.errors import BadSurvey
from contracts.records import Pose
from survey import ReadOptions, Survey, read_survey

PARIS: dict[int, object] = {1: "N", 2: (48.0, 51.0, 12.6), 3: "E", 4: (2.0, 20.0, 24.0)}


def photo(
    path: Path,
    gps: dict[int, object],
    details: dict[int, object] | None = None,
    orientation: int = 1,
) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    exif.get_ifd(0x8825).update(gps)
    exif.get_ifd(0x8769).update(details or {})
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", (36, 24)).save(path, exif=exif)


def read(
    folder: Path,
    gps: dict[int, object],
    details: dict[int, object] | None = None,
    orientation: int = 1,
) -> Survey:
    photo(folder / "a.jpg", gps, details, orientation)
    photo(folder / "good.jpg", PARIS)
    return read_survey(folder, ReadOptions())


def pose_of(survey: Survey, uri: str = "a.jpg") -> Pose:
    (pose,) = (image.pose for image in survey.images if image.uri == uri)
    assert pose is not None
    return pose


def test_a_position_is_read_in_degrees(tmp_path: Path) -> None:
    survey = read(tmp_path, PARIS)
    assert (survey.format, survey.crs) == ("exif", "EPSG:4326")
    pose = pose_of(survey)
    assert (pose.easting, pose.northing) == pytest.approx((2.34, 48.8535))
    assert pose.heading_deg is None
    assert pose.altitude_m is None


def test_west_south_and_below_the_sea_are_negative(tmp_path: Path) -> None:
    gps: dict[int, object] = {
        1: "S",
        2: (33.0, 30.0, 0.0),
        3: "W",
        4: (70.0, 45.0, 0.0),
        5: b"\1",
        6: 12.5,
    }
    pose = pose_of(read(tmp_path, gps))
    assert (pose.easting, pose.northing, pose.altitude_m) == (-70.75, -33.5, -12.5)


@pytest.mark.parametrize(("reference", "north"), [("T", "true"), ("M", "magnetic"), (None, "true")])
def test_the_reference_of_a_direction_is_kept(
    tmp_path: Path, reference: str | None, north: str
) -> None:
    gps = PARIS | {17: 123.25} | ({} if reference is None else {16: reference})
    pose = pose_of(read(tmp_path, gps))
    assert (pose.heading_deg, pose.north) == (123.25, north)


def test_what_the_camera_did_not_know_is_not_known(tmp_path: Path) -> None:
    pose = pose_of(read(tmp_path, PARIS | {17: IFDRational(0, 0), 6: IFDRational(0, 0)}))
    assert pose.heading_deg is None
    assert pose.altitude_m is None


@pytest.mark.parametrize(
    ("gps", "reason"),
    [
        ({}, "no GPS position"),
        ({2: PARIS[2], 4: PARIS[4]}, "no GPS position"),
        (PARIS | {2: (95.0, 0.0, 0.0)}, "latitude 95"),
        (PARIS | {2: (IFDRational(0, 0),) * 3}, "northing is nan"),
        (PARIS | {2: (0.0, 0.0, 0.0), 4: (0.0, 0.0, 0.0)}, "without a fix"),
    ],
)
def test_a_photo_without_a_usable_position_is_skipped(
    tmp_path: Path, gps: dict[int, object], reason: str
) -> None:
    survey = read(tmp_path, gps)
    assert [image.uri for image in survey.images] == ["good.jpg"]
    (skip,) = survey.skipped
    assert skip.uri == "a.jpg"
    assert reason in skip.reason


def test_what_is_no_image_is_skipped_with_its_reason(tmp_path: Path) -> None:
    photo(tmp_path / "good.jpg", PARIS)
    (tmp_path / "a.jpg").write_bytes(b"")
    (tmp_path / "b.jpg").write_text("hello")
    survey = read_survey(tmp_path, ReadOptions())
    assert len(survey.images) == 1
    assert [skip.reason.split(";")[0] for skip in survey.skipped] == [
        "is empty (0 bytes)",
        "is not a supported image",
    ]


@pytest.mark.parametrize(
    ("details", "gps", "captured_at"),
    [
        (
            {0x9003: "2020:05:01 10:11:12", 0x9011: "+02:00"},
            {29: "2020:05:01", 7: (8.0, 11.0, 13.0)},
            "2020-05-01T10:11:12+02:00",
        ),
        (
            {0x9003: "2020:05:01 10:11:12"},
            {29: "2020:05:01", 7: (8.0, 11.0, 13.9)},
            "2020-05-01T08:11:13Z",
        ),
        ({0x9003: "2020:05:01 10:11:12"}, {}, None),
        ({}, {29: "2020:13:01", 7: (8.0, 11.0, 13.0)}, None),
        ({}, {}, None),
    ],
)
def test_a_time_is_written_only_with_its_zone(
    tmp_path: Path, details: dict[int, object], gps: dict[int, object], captured_at: str | None
) -> None:
    survey = read(tmp_path, PARIS | gps, details=details)
    assert survey.images[0].captured_at == captured_at


@pytest.mark.parametrize(("orientation", "width"), [(1, 36.0), (6, 24.0)])
def test_the_field_of_view_is_that_of_the_upright_image(
    tmp_path: Path, orientation: int, width: float
) -> None:
    survey = read(tmp_path, PARIS, details={0xA405: 28}, orientation=orientation)
    # A 36 x 24 image has the sides of the film itself.
    expected = 2 * math.degrees(math.atan(width / 2 / 28))
    height = 60 - width
    camera = survey.images[0].camera
    assert camera.hfov_deg == pytest.approx(expected)
    assert (camera.width_px, camera.height_px) == (width, height)


def test_photos_without_any_position_are_refused(tmp_path: Path) -> None:
    photo(tmp_path / "a.jpg", {})
    with pytest.raises(BadSurvey, match="--no-pose"):
        read_survey(tmp_path, ReadOptions())


def test_real_photos_lie_where_they_were_taken(test_data: Path) -> None:
    survey = read_survey(test_data / "gps-photos", ReadOptions())
    towns = {"lund": (13.19, 55.70), "arezzo": (11.88, 43.47), "mapillary": (-122.57, 45.51)}
    assert len(survey.images) == 40
    assert survey.skipped == ()
    for image in survey.images:
        assert image.pose is not None
        place = towns[image.uri.split("/")[0]]
        assert (image.pose.easting, image.pose.northing) == pytest.approx(place, abs=0.02)
