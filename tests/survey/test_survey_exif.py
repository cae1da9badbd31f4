import math
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
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
            "2020-05-01T08:11:13.900Z",
        ),
        (
            {0x9003: "2020:05:01 10:11:12", 0x9011: "+02:00", 0x9291: "45"},
            {},
            "2020-05-01T10:11:12.450+02:00",
        ),
        (
            {0x9003: "2020:05:01 10:11:12", 0x9011: "+02:00", 0x9291: "x"},
            {},
            "2020-05-01T10:11:12+02:00",
        ),
        ({0x9003: "2023:02:29 10:11:12", 0x9011: "Z"}, {}, None),
        ({}, {29: "2024:02:29", 7: (23.0, 59.0, 59.9999)}, "2024-02-29T23:59:59.999Z"),
        ({}, {29: "2024:02:29", 7: (25.0, 0.0, 0.0)}, None),
        ({}, {29: "2024:02:29", 7: (8.0, 0.0)}, None),
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


@pytest.mark.parametrize(
    ("error", "expected"), [(3.5, 3.5), (0.0, None), (IFDRational(0, 0), None), (None, None)]
)
def test_the_stated_error_of_a_position_is_kept(
    tmp_path: Path, error: object, expected: float | None
) -> None:
    gps = PARIS | ({} if error is None else {31: error})
    assert pose_of(read(tmp_path, gps)).position_error_m == expected


@pytest.mark.parametrize(
    ("version", "reference", "altitude", "crs"),
    [
        (b"0300", 0, 12.5, "EPSG:4979"),
        (b"0310", 1, -12.5, "EPSG:4979"),
        (b"0300", 2, 12.5, "EPSG:4326"),
        (b"0300", 3, -12.5, "EPSG:4326"),
        (b"0232", 0, 12.5, "EPSG:4326"),
        (b"03", 0, 12.5, "EPSG:4326"),
        (b"\xff\xff\xff\xff", 1, -12.5, "EPSG:4326"),
        (None, 0, 12.5, "EPSG:4326"),
    ],
)
def test_a_height_counts_from_the_ellipsoid_only_where_exif_3_says_so(
    tmp_path: Path, version: bytes | None, reference: int, altitude: float, crs: str
) -> None:
    gps = PARIS | {5: bytes([reference]), 6: 12.5}
    details: dict[int, object] = {} if version is None else {0x9000: version}
    survey = read(tmp_path, gps, details)
    assert survey.crs == crs
    assert {image.pose.crs for image in survey.images if image.pose} == {crs}
    assert pose_of(survey).altitude_m == altitude


def test_heights_of_two_kinds_are_of_no_known_kind(tmp_path: Path) -> None:
    photo(tmp_path / "b.jpg", PARIS | {5: b"\2", 6: 12.5}, {0x9000: b"0300"})
    survey = read(tmp_path, PARIS | {5: b"\0", 6: 12.5}, {0x9000: b"0300"})
    assert survey.crs == "EPSG:4326"


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


def with_xmp(path: Path, gps: dict[int, object], attributes: str, size: tuple[int, int]) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8825).update(gps)
    exif.get_ifd(0x8769).update({0xA405: 28})
    xmp = (
        '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/'
        '22-rdf-syntax-ns#"><rdf:Description xmlns:GPano="http://ns.google.com/photos/1.0/'
        'panorama/" xmlns:drone-dji="http://www.dji.com/drone-dji/1.0/" '
        f"{attributes}/></rdf:RDF></x:xmpmeta>"
    )
    Image.new("RGB", size).save(path, exif=exif, xmp=xmp.encode())


def test_a_panorama_looks_where_its_gpano_says(tmp_path: Path) -> None:
    attributes = (
        'GPano:ProjectionType="equirectangular" GPano:PoseHeadingDegrees="200.5" '
        'GPano:PosePitchDegrees="-2" GPano:PoseRollDegrees="3"'
    )
    with_xmp(tmp_path / "a.jpg", PARIS | {16: "M", 17: 11.0}, attributes, (64, 32))
    survey = read_survey(tmp_path, ReadOptions(cut_panoramas=False))
    pose = pose_of(survey)
    assert (pose.heading_deg, pose.pitch_deg, pose.roll_deg) == (200.5, -2.0, 3.0)
    assert pose.north == "true"
    assert survey.images[0].camera.hfov_deg == 360.0


def test_a_panorama_becomes_views_with_poses_of_their_own(tmp_path: Path) -> None:
    attributes = 'GPano:ProjectionType="equirectangular" GPano:PoseHeadingDegrees="200"'
    with_xmp(tmp_path / "a.jpg", PARIS | {31: 3.0}, attributes, (64, 32))
    photo(tmp_path / "b.jpg", PARIS)
    survey = read_survey(tmp_path, ReadOptions())
    poses = {image.uri: image.pose for image in survey.images}
    assert len(poses) == 9
    view = poses["a.jpg#yaw=270&pitch=0&fov=80"]
    assert view is not None
    assert (view.heading_deg, view.north, view.position_error_m) == (110.0, "true", 3.0)
    assert [image.uri for image in survey.images] == sorted(poses)


def test_a_photograph_looks_where_its_exif_says_before_its_xmp(tmp_path: Path) -> None:
    attributes = 'drone-dji:GimbalYawDegree="-114.2" drone-dji:GimbalPitchDegree="-5"'
    with_xmp(tmp_path / "a.jpg", PARIS | {16: "M", 17: 11.0}, attributes, (60, 40))
    with_xmp(tmp_path / "b.jpg", PARIS, attributes, (60, 40))
    survey = read_survey(tmp_path, ReadOptions())
    first, second = pose_of(survey), pose_of(survey, "b.jpg")
    assert (first.heading_deg, first.north, first.pitch_deg) == (11.0, "magnetic", -5.0)
    assert second.heading_deg == pytest.approx(245.8)
    assert second.north == "true"


def test_xmp_that_cannot_be_read_is_told_and_the_photo_kept(tmp_path: Path) -> None:
    photo(tmp_path / "good.jpg", PARIS)
    with_xmp(tmp_path / "a.jpg", PARIS, "broken<", (60, 40))
    survey = read_survey(tmp_path, ReadOptions())
    assert len(survey.images) == 2
    (note,) = (note for note in survey.notes if "XMP" in note)
    assert note.startswith("XMP of 1 images is left out; the first is a.jpg: XMP that is not XML")


@pytest.mark.skipif(shutil.which("exiftool") is None, reason="exiftool is not installed")
def test_what_exiftool_writes_is_read(tmp_path: Path) -> None:
    Image.new("RGB", (64, 32)).save(tmp_path / "a.jpg")
    tags = {
        "GPSLatitude": "48.8584",
        "GPSLatitudeRef": "N",
        "GPSLongitude": "2.2945",
        "GPSLongitudeRef": "W",
        "GPSAltitude": "33.25",
        "GPSAltitudeRef#": "1",
        "GPSImgDirection": "271.5",
        "GPSImgDirectionRef": "M",
        "GPSHPositioningError": "2.5",
        "GPSDateStamp": "2024:02:29",
        "GPSTimeStamp": "10:20:30.5",
        "XMP-GPano:ProjectionType": "equirectangular",
        "XMP-GPano:PoseHeadingDegrees": "15.25",
        "XMP-GPano:PosePitchDegrees": "1.5",
        "XMP-GPano:PoseRollDegrees": "-0.5",
    }
    command = ["exiftool", "-q", "-overwrite_original"]
    command += [f"-{name}={value}" for name, value in tags.items()]
    subprocess.run([*command, str(tmp_path / "a.jpg")], check=True, timeout=60)
    survey = read_survey(tmp_path, ReadOptions(cut_panoramas=False))
    pose = pose_of(survey)
    assert (pose.easting, pose.northing) == pytest.approx((-2.2945, 48.8584), abs=1e-7)
    assert (pose.altitude_m, pose.position_error_m) == (-33.25, 2.5)
    assert (pose.heading_deg, pose.pitch_deg, pose.roll_deg) == (15.25, 1.5, -0.5)
    assert survey.images[0].captured_at == "2024-02-29T10:20:30.500Z"


@settings(max_examples=60, deadline=None)
@example([(17, 2)])  # a pointer to a directory that is two pointers
@given(st.lists(st.tuples(st.integers(8, 420), st.integers(0, 255)), min_size=1, max_size=12))
def test_tags_of_any_type_and_count_are_read_or_the_photo_is_skipped(
    tmp_path_factory: pytest.TempPathFactory, changes: list[tuple[int, int]]
) -> None:
    """Bytes of a good EXIF block are changed: types, counts, offsets and values."""
    exif = Image.Exif()
    exif.get_ifd(0x8825).update(PARIS | {5: b"\0", 6: 12.5, 7: (8.0, 11.0, 13.0), 16: "T", 17: 7.5})
    exif.get_ifd(0x8825).update({29: "2020:05:01", 31: 2.0})
    exif.get_ifd(0x8769).update({0x9003: "2020:05:01 10:11:12", 0x9011: "+02:00", 0xA405: 26})
    block = bytearray(exif.tobytes())
    for at, value in changes:
        block[min(6 + at, len(block) - 1)] = value
    folder = tmp_path_factory.mktemp("odd")
    Image.new("RGB", (36, 24)).save(folder / "a.jpg", exif=bytes(block))
    photo(folder / "good.jpg", PARIS)
    survey = read_survey(folder, ReadOptions())
    assert len(survey.images) + len(survey.skipped) == 2
