"""MCAP surveys by three independent writers: places, attitudes, lenses, pictures."""

import math
from pathlib import Path

import pyproj
import pytest
from mcap_drives import (
    ANTENNA_AT,
    CAMERA,
    CAMERA_AT,
    DIALECTS,
    IMAGE_TIMES,
    Protobuf,
    Ros2,
    drive,
    heading_deg,
    jpeg,
    lon_lat,
    ns,
    turn_of,
)

from contracts.errors import BadSurvey, UnknownCrs
from contracts.records import PosedImage
from survey import read_survey
from survey.fragments import parse_fragment
from survey.mcap.payload import image_bytes
from survey.mcap.reader import READER
from survey.options import Reading, ReadOptions

GEOD = pyproj.Geod(ellps="WGS84")


def read(path: Path, **options: object) -> Reading:
    return READER.read(path, ReadOptions(**options), lambda uri: True)


def in_order(reading: Reading) -> list[PosedImage]:
    return sorted(reading.images, key=lambda image: image.uri)


def picture(image: PosedImage) -> bytes:
    message = parse_fragment(image.fragment).message
    assert message is not None
    return image_bytes(image.path, message)


@pytest.fixture(params=sorted(DIALECTS))
def dialect(request):
    return DIALECTS[request.param]()


def test_a_drive_is_read_alike_from_every_dialect(dialect, tmp_path):
    dialect.write(tmp_path / "drive.mcap", drive(dialect))
    assert READER.recognises(tmp_path / "drive.mcap")
    reading = read(tmp_path / "drive.mcap")
    assert (reading.crs, reading.skipped, reading.notes) == ("EPSG:4979", (), ())
    for number, (at, image) in enumerate(zip(IMAGE_TIMES, in_order(reading), strict=True)):
        assert image.uri == f"right/image/compressed/{1_700_000_000 + number}.250000000.jpg"
        assert image.captured_at == f"2023-11-14T22:13:{20 + number}.250Z"
        assert image.camera.name == CAMERA
        assert (image.camera.width_px, image.camera.height_px) == (32, 24)
        assert image.camera.hfov_deg == pytest.approx(math.degrees(2 * math.atan(16 / 20)))
        assert picture(image) == jpeg(number)
        pose = image.pose
        assert pose is not None
        assert pose.north == "true"
        assert pose.heading_deg == pytest.approx(heading_deg(at) + 90.0, abs=1e-6)
        assert pose.pitch_deg == pytest.approx(0.0, abs=1e-6)
        assert pose.roll_deg == pytest.approx(0.0, abs=1e-6)
        assert pose.position_error_m == pytest.approx(0.2)
        lon, lat = camera_lon_lat(at)
        assert metres(pose.easting, pose.northing, lon, lat) < 0.001
        assert pose.altitude_m == pytest.approx(80.0 + CAMERA_AT[2] - ANTENNA_AT[2], abs=1e-6)


def camera_lon_lat(seconds: float) -> tuple[float, float]:
    """From the antenna along and across the vehicle, one after the other."""
    heading, here = heading_deg(seconds), lon_lat(seconds)
    *ahead, _ = GEOD.fwd(*here, heading, CAMERA_AT[0] - ANTENNA_AT[0])
    lon, lat, _ = GEOD.fwd(*ahead, heading - 90.0, CAMERA_AT[1] - ANTENNA_AT[1])
    return lon, lat


def metres(lon: float, lat: float, other_lon: float, other_lat: float) -> float:
    return float(GEOD.inv(lon, lat, other_lon, other_lat)[2])


def test_images_beyond_a_gap_or_the_track_are_skipped_with_the_gap_named(dialect, tmp_path):
    said = [
        item
        for item in drive(dialect, until=4.0)
        if not (item.topic == "/fix" and ns(1.2) < item.time_ns < ns(2.9))
    ]
    dialect.write(tmp_path / "drive.mcap", said)
    reading = read(tmp_path / "drive.mcap", max_gap_s=1.0)
    assert [image.captured_at for image in in_order(reading)] == [
        "2023-11-14T22:13:20.250Z",
        "2023-11-14T22:13:23.250Z",
    ]
    reasons = {skip.uri[-24:-4]: skip.reason for skip in reading.skipped}
    assert "are 2.000 s apart, more than 1 s" in reasons["1700000001.250000000"]
    assert "2.000 s" in reasons["1700000002.250000000"]
    assert "after the last" in reasons["1700000004.250000000"]


def test_an_image_at_the_very_moment_of_a_lone_fix_is_placed(tmp_path):
    dialect = Protobuf()
    said = [dialect.fix("/fix", 3.0, "cam", 2.0, 48.0, 50.0), dialect.image("/c", 3.0, "cam", b"")]
    said[1] = dialect.image("/c", 3.0, "cam", jpeg(0))
    dialect.write(tmp_path / "one.mcap", said)
    (image,) = read(tmp_path / "one.mcap").images
    assert image.pose is not None
    assert (image.pose.easting, image.pose.northing, image.pose.altitude_m) == (2.0, 48.0, 50.0)
    assert image.pose.heading_deg is None


@pytest.mark.parametrize("dialect", [DIALECTS["protobuf"](), DIALECTS["json"]()])
def test_a_heading_of_the_receiver_is_one_of_its_camera(dialect, tmp_path):
    said = [
        dialect.fix("/fix", 0.0, "cam", 2.0, 48.0, 1.0, heading=math.radians(350.0)),
        dialect.image("/c", 0.25, "cam", jpeg(0)),
        dialect.fix("/fix", 0.5, "cam", 2.0, 48.0, 1.0, heading=math.radians(10.0)),
    ]
    dialect.write(tmp_path / "one.mcap", said)
    (image,) = read(tmp_path / "one.mcap").images
    assert image.pose is not None
    assert math.cos(math.radians(image.pose.heading_deg)) == pytest.approx(1.0)
    assert (image.pose.pitch_deg, image.pose.roll_deg) == (None, None)


def test_fixes_without_a_fix_do_not_count(tmp_path):
    dialect = Ros2()
    said = [
        dialect.fix("/fix", 0.0, "cam", 2.0, 48.0, 50.0, status=-1),
        dialect.fix("/fix", 0.5, "cam", math.nan, math.nan, math.nan),
        dialect.fix("/fix", 1.0, "cam", 0.0, 0.0, 0.0),
        dialect.fix("/fix", 2.0, "cam", 3.0, 49.0, math.nan),
        dialect.image("/c", 0.0, "cam", jpeg(0)),
        dialect.image("/c", 2.0, "cam", jpeg(1)),
    ]
    dialect.write(tmp_path / "a.mcap", said)
    reading = read(tmp_path / "a.mcap")
    (image,) = reading.images
    assert image.pose is not None
    assert (image.pose.easting, image.pose.altitude_m, reading.crs) == (3.0, None, "EPSG:4326")
    assert "before the first" in reading.skipped[0].reason
    assert reading.notes == ("a.mcap: 3 positions of topic /fix have no fix",)


def test_poses_of_a_map_need_a_coordinate_system(dialect, tmp_path):
    said = [item for item in drive(dialect) if item.topic != "/fix"]
    dialect.write(tmp_path / "drive.mcap", said)
    with pytest.raises(UnknownCrs, match=r"'map'.*--crs"):
        read(tmp_path / "drive.mcap")


def test_poses_of_a_map_are_places_in_its_coordinate_system(dialect, tmp_path):
    said = [
        dialect.transform("/tf_static", 0.0, "base_link", CAMERA, CAMERA_AT, FRONT),
        dialect.pose("/pose", 0.0, "map", (448000.0, 5411000.0, 35.0), turn_of(0.0)),
        dialect.pose("/pose", 1.0, "map", (448000.0, 5411010.0, 36.0), turn_of(0.0)),
        dialect.image("/c", 0.5, CAMERA, jpeg(0)),
    ]  # fmt: skip
    dialect.write(tmp_path / "drive.mcap", said)
    reading = read(tmp_path / "drive.mcap", crs="EPSG:32631")
    (image,) = reading.images
    pose = image.pose
    assert pose is not None
    assert (pose.crs, reading.crs, pose.north) == ("EPSG:32631", "EPSG:32631", "grid")
    # Heading north: 1.5 m ahead is 1.5 m north, 0.4 m to the right is 0.4 m east.
    assert pose.easting == pytest.approx(448000.4, abs=1e-6)
    assert pose.northing == pytest.approx(5411006.5, abs=1e-6)
    assert pose.altitude_m == pytest.approx(35.5 + 1.9, abs=1e-6)
    assert pose.heading_deg == pytest.approx(0.0, abs=1e-6) or pose.heading_deg > 359.999999


def test_a_coordinate_system_that_is_not_the_poses_is_refused(dialect, tmp_path):
    dialect.write(tmp_path / "drive.mcap", drive(dialect))
    with pytest.raises(BadSurvey, match="Leave --crs out"):
        read(tmp_path / "drive.mcap", crs="EPSG:2154")
    fixes = list(drive(dialect, posed=False, mounted=False))
    dialect.write(tmp_path / "fixes.mcap", fixes)
    with pytest.raises(BadSurvey, match="leave --crs out"):
        read(tmp_path / "fixes.mcap", crs="EPSG:2154")


def test_a_tree_of_moving_transforms_places_its_cameras(dialect, tmp_path):
    still = (0.0, 0.0, 0.0)
    said = [dialect.transform("/tf_static", 0.0, "base_link", "left", still, LEFT)]
    said += [dialect.transform("/tf_static", 0.0, "base_link", "front", still, FRONT)]
    for at in (0.0, 1.0):
        place = (500000.0 + 20.0 * at, 4000000.0, 0.0)
        said.append(dialect.transform("/tf", at, "odom", "base_link", place, turn_of(90.0)))
        said.append(dialect.transform("/tf", at, "map", "odom", (0.0, 7.0, 0.0), turn_of(90.0)))
    said += [dialect.image(f"/{name}", 0.25, name, jpeg(0)) for name in ("left", "front")]
    dialect.write(tmp_path / "drive.mcap", sorted(said, key=lambda item: item.time_ns))
    front, left = in_order(read(tmp_path / "drive.mcap", crs="EPSG:32633"))
    assert front.pose is not None
    assert left.pose is not None
    assert (front.camera.name, left.camera.name) == ("front", "left")
    assert front.pose.easting == pytest.approx(500005.0)
    assert front.pose.northing == pytest.approx(4000007.0)
    assert front.pose.heading_deg == pytest.approx(90.0)
    assert left.pose.heading_deg % 360.0 == pytest.approx(0.0, abs=1e-6) or (
        left.pose.heading_deg > 359.999999
    )


FRONT = (0.5, -0.5, 0.5, -0.5)
LEFT = (-math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))


def test_attitudes_of_an_odometry_frame_are_not_taken_for_headings(dialect, tmp_path):
    said = drive(dialect, posed=False)
    said += [
        dialect.odometry("/o", float(at), "odom", "base_link", (0.0, 0.0, 0.0), turn_of(0.0))
        for at in range(6)
    ]
    dialect.write(tmp_path / "drive.mcap", sorted(said, key=lambda item: item.time_ns))
    reading = read(tmp_path / "drive.mcap")
    assert len(reading.images) == len(IMAGE_TIMES)
    assert all(image.pose and image.pose.heading_deg is None for image in reading.images)
    assert any("'odom'" in note for note in reading.notes)


def test_a_lone_camera_without_a_mounting_looks_ahead_and_it_is_said(dialect, tmp_path):
    dialect.write(tmp_path / "drive.mcap", drive(dialect, mounted=False))
    reading = read(tmp_path / "drive.mcap")
    first = in_order(reading)[0].pose
    assert first is not None
    assert first.heading_deg == pytest.approx(heading_deg(IMAGE_TIMES[0]))
    assert any("look ahead" in note for note in reading.notes)


def test_files_of_a_folder_are_one_drive_unless_they_overlap(tmp_path):
    dialect = Protobuf()
    said = drive(dialect)
    folder = tmp_path / "survey"
    folder.mkdir()
    pictures = [item for item in said if "image" in item.topic]
    dialect.write(folder / "images.mcap", pictures)
    dialect.write(folder / "rest.mcap", [item for item in said if "image" not in item.topic])
    reading = read(folder)
    assert in_order(reading)[0].uri == (
        "images.mcap/right/image/compressed/1700000000.250000000.jpg"
    )
    assert len(reading.images) == 5
    # A second vehicle at the same time: its fixes are not mixed with the first one's.
    other = [
        dialect.fix("/fix", 0.0, "gnss", 10.0, 50.0, 0.0),
        dialect.fix("/fix", 5.0, "gnss", 10.0, 50.0, 0.0),
    ]
    dialect.write(folder / "second.mcap", other)
    reading = read(folder)
    assert not reading.images
    assert all("no position" in skip.reason for skip in reading.skipped)


def test_files_that_follow_each_other_share_what_the_first_says_of_the_mounting(tmp_path):
    dialect, folder = Ros2(), tmp_path / "bag"
    folder.mkdir()
    said = drive(dialect)
    # A recorder overlaps a little when it changes files.
    dialect.write(folder / "bag_0.mcap", [item for item in said if item.time_ns < ns(2.6)])
    dialect.write(folder / "bag_1.mcap", [item for item in said if item.time_ns >= ns(2.5)])
    reading = read(folder)
    assert len(reading.images) == 5
    for at, image in zip(IMAGE_TIMES, in_order(reading), strict=True):
        assert image.pose is not None
        assert image.pose.heading_deg == pytest.approx(heading_deg(at) + 90.0, abs=1e-6)


def test_poses_of_things_that_were_seen_are_not_the_vehicles(dialect, tmp_path):
    said = drive(dialect, posed=False)
    for at in range(6):
        said.append(dialect.pose("/marker", float(at), CAMERA, (0.0, 0.0, 3.0), turn_of(0.0)))
        said.append(dialect.pose("/sign", float(at), "base_link", (9.0, 0.0, 3.0), turn_of(0.0)))
    dialect.write(tmp_path / "drive.mcap", sorted(said, key=lambda item: item.time_ns))
    reading = read(tmp_path / "drive.mcap")
    assert len(reading.images) == 5
    assert all(image.pose and image.pose.heading_deg is None for image in reading.images)


def test_the_source_that_places_the_most_images_wins(dialect, tmp_path):
    said = drive(dialect)
    for at in (0.0, 0.5):
        said.append(dialect.fix("/a_fix", at, "gnss", 10.0, 50.0, 80.0, variance=1e-6))
        said.append(dialect.odometry("/a_o", at, "map", "base_link", (0.0,) * 3, turn_of(0.0)))
    dialect.write(tmp_path / "drive.mcap", sorted(said, key=lambda item: item.time_ns))
    first = in_order(read(tmp_path / "drive.mcap"))[0].pose
    assert first is not None
    assert first.easting == pytest.approx(2.35, abs=0.01)
    assert first.heading_deg == pytest.approx(heading_deg(IMAGE_TIMES[0]) + 90.0)


def test_of_equal_sources_the_surer_one_wins(dialect, tmp_path):
    said = [item for item in drive(dialect) if item.topic != "/fix"]
    for at in (0.0, 1.0, 2.0, 3.0, 4.0, 5.0):
        said.append(dialect.fix("/a", at, "gnss", 10.0, 50.0, 80.0, variance=4.0))
        said.append(dialect.fix("/b", at, "gnss", 11.0, 50.0, 80.0, variance=1.0))
        said.append(dialect.fix("/c", at, "gnss", 12.0, 50.0, 80.0))
    dialect.write(tmp_path / "drive.mcap", sorted(said, key=lambda item: item.time_ns))
    pose = read(tmp_path / "drive.mcap").images[0].pose
    assert pose is not None
    assert pose.easting == pytest.approx(11.0, abs=0.01)
    assert pose.position_error_m == pytest.approx(math.sqrt(2.0))


def test_a_folder_is_recognised_by_what_its_files_begin_with(tmp_path):
    assert not READER.recognises(tmp_path)
    (tmp_path / "x.mcap").write_bytes(b"not one")
    assert not READER.recognises(tmp_path)
    Protobuf().write(tmp_path / "y.mcap", drive(Protobuf()))
    assert READER.recognises(tmp_path)
    assert read(tmp_path).skipped[0].uri == "x.mcap"


def test_links_out_of_the_survey_are_not_followed(tmp_path):
    Protobuf().write(tmp_path / "secret.mcap", drive(Protobuf()))
    folder = tmp_path / "survey"
    folder.mkdir()
    (folder / "a.mcap").symlink_to(tmp_path / "secret.mcap")
    assert not READER.recognises(folder)


def test_without_poses_images_are_read_alone(dialect, tmp_path):
    said = [item for item in drive(dialect) if "image" in item.topic]
    dialect.write(tmp_path / "drive.mcap", said)
    with pytest.raises(BadSurvey, match=r"no positions.*/right/image/compressed"):
        read(tmp_path / "drive.mcap")
    for path in (tmp_path / "drive.mcap", tmp_path):
        survey = read_survey(path, ReadOptions(no_pose=True))
        assert (len(survey.images), survey.crs, survey.format) == (5, None, "mcap")


@pytest.mark.parametrize(
    ("content", "words"), [(b"", r"empty \(0 bytes\)"), (b"\x00\x01data", "does not begin as one")]
)
def test_a_file_that_is_only_named_as_mcap_is_refused_by_what_it_is(content, words, tmp_path):
    (tmp_path / "x.mcap").write_bytes(content)
    with pytest.raises(BadSurvey, match=words):
        read_survey(tmp_path / "x.mcap", ReadOptions())


def test_only_images_asked_for_are_read(tmp_path):
    Protobuf().write(tmp_path / "drive.mcap", drive(Protobuf()))
    reading = READER.read(tmp_path / "drive.mcap", ReadOptions(), lambda uri: "0002" in uri)
    assert [image.uri for image in reading.images] == [
        "right/image/compressed/1700000002.250000000.jpg"
    ]


def test_a_track_across_longitude_180_goes_the_short_way(dialect, tmp_path):
    said = [
        dialect.fix("/fix", 0.0, "cam", 179.9999, -17.0, 10.0),
        dialect.fix("/fix", 1.0, "cam", -179.9997, -17.0, 10.0),
        dialect.image("/c", 0.5, "cam", jpeg(0)),
    ]
    dialect.write(tmp_path / "fiji.mcap", sorted(said, key=lambda item: item.time_ns))
    (image,) = read(tmp_path / "fiji.mcap").images
    assert image.pose is not None
    assert image.pose.easting == pytest.approx(-179.9999)


def test_the_same_topic_and_time_twice_counts_once(tmp_path):
    dialect = Protobuf()
    said = drive(dialect)
    said += [dialect.image("/right/image/compressed", IMAGE_TIMES[0], CAMERA, jpeg(9))]
    dialect.write(tmp_path / "drive.mcap", sorted(said, key=lambda item: item.time_ns))
    reading = read(tmp_path / "drive.mcap")
    assert len(reading.images) == 5
    assert picture(in_order(reading)[0]) == jpeg(0)
    assert "earlier message" in reading.skipped[0].reason


def test_clocks_that_run_backwards_change_nothing(tmp_path):
    said = drive(Protobuf())
    Protobuf().write(tmp_path / "a.mcap", said)
    Protobuf().write(tmp_path / "b.mcap", said[::-1])
    forth, back = in_order(read(tmp_path / "a.mcap")), in_order(read(tmp_path / "b.mcap"))
    assert [image.pose for image in forth] == [image.pose for image in back]


def test_transforms_in_a_circle_end(tmp_path):
    dialect = Protobuf()
    said = drive(dialect, mounted=False, posed=False)
    for parent, child in ((CAMERA, "a"), ("a", "b"), ("b", CAMERA), ("c", "c")):
        said.append(dialect.transform("/tf", 0.0, parent, child, (1.0, 0.0, 0.0), (0, 0, 0, 1.0)))
    dialect.write(tmp_path / "drive.mcap", sorted(said, key=lambda item: item.time_ns))
    reading = read(tmp_path / "drive.mcap")
    assert len(reading.images) == 5
    assert all(image.pose and image.pose.heading_deg is None for image in reading.images)
