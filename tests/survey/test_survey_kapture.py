from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy.spatial.transform import Rotation

from contracts.errors import BadSurvey, FlaneurError, UnknownCrs
from contracts.records import Pose
from survey import kapture
from survey.options import Reading, ReadOptions

# Columns right, down, ahead of a level camera that looks east and of one that looks north.
EAST = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
NORTH = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
PLACE = np.array([652_000.0, 6_862_000.0, 40.0])
SENSORS = """# kapture format: 1.1
# sensor_device_id, name, sensor_type, [sensor_params]+
cam0, Hero, camera, PINHOLE, 800, 600, 400, 410, 400, 300
cam1,, camera, SIMPLE_RADIAL, 600, 800, 300.0, 300, 400, -0.03
gps1, , gnss, EPSG:4326
"""


def cells(device_from_world: np.ndarray, centre: np.ndarray) -> str:
    """`qw, qx, qy, qz, tx, ty, tz` by scipy, from the rotation and where the device stands."""
    x, y, z, w = Rotation.from_matrix(device_from_world).as_quat()
    translation = -device_from_world @ centre
    return ", ".join(repr(float(number)) for number in (w, x, y, z, *translation))


def folder(
    root: Path, records: str, trajectories: str, rigs: str = "", sensors: str = SENSORS
) -> Path:
    data = root / "sensors" / "records_data"
    data.mkdir(parents=True)
    for name in ("a.jpg", "b.jpg"):
        Image.new("RGB", (8, 6)).save(data / name)
    texts = {"records_camera": records, "trajectories": trajectories, "sensors": sensors}
    if rigs:
        texts["rigs"] = rigs
    for name, text in texts.items():
        (root / "sensors" / f"{name}.txt").write_text(text, encoding="utf-8")
    return root


def read(root: Path, crs: str | None = "EPSG:2154") -> Reading:
    return kapture.READER.read(root, ReadOptions(crs=crs), lambda _uri: True)


def pose_of(reading: Reading, name: str) -> Pose:
    (pose,) = (image.pose for image in reading.images if image.uri.endswith(name))
    assert pose is not None
    return pose


def reason(reading: Reading, name: str) -> str:
    (found,) = (skip.reason for skip in reading.skipped if skip.uri.endswith(name))
    return found


def test_a_pose_from_world_to_camera_is_turned_round(tmp_path: Path) -> None:
    records = "# kapture format: 1.1\n\n0000, cam0, a.jpg\n1, cam1, b.jpg\n"
    trajectory = f"0, cam0, {cells(EAST.T, PLACE)}\n0001, cam1, {cells(NORTH.T, PLACE + 5)}\n"
    reading = read(folder(tmp_path, records, trajectory))
    first, second = pose_of(reading, "a.jpg"), pose_of(reading, "b.jpg")
    assert (first.easting, first.northing, first.altitude_m) == pytest.approx(PLACE)
    assert (first.heading_deg, first.pitch_deg, first.roll_deg) == pytest.approx((90, 0, 0))
    assert (second.easting, second.heading_deg) == pytest.approx((652_005.0, 0.0), abs=1e-6)
    assert (first.crs, first.north, reading.crs) == ("EPSG:2154", "grid", "EPSG:2154")
    assert reading.skipped == ()
    assert sorted(image.uri for image in reading.images) == [
        "sensors/records_data/a.jpg",
        "sensors/records_data/b.jpg",
    ]


def test_the_field_of_view_is_that_of_the_pinhole(tmp_path: Path) -> None:
    records = "0, cam0, a.jpg\n0, cam1, b.jpg\n"
    trajectory = f"0, cam0, {cells(EAST.T, PLACE)}\n0, cam1, {cells(EAST.T, PLACE)}\n"
    reading = read(folder(tmp_path, records, trajectory))
    cameras = {image.camera.name: image.camera for image in reading.images}
    assert cameras["cam0"].hfov_deg == pytest.approx(90.0)
    assert (cameras["cam0"].width_px, cameras["cam0"].height_px) == (800, 600)
    assert cameras["cam1"].hfov_deg == pytest.approx(90.0)


def test_a_camera_on_a_rig_has_the_rigs_pose_and_its_place_there(tmp_path: Path) -> None:
    """The rig looks east; the camera on it looks to its left, north, from 2 m ahead."""
    left = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    rigs = f"rig, cam0, {cells(left, np.array([0.0, 0.0, 2.0]))}\nvan, rig, 1, 0, 0, 0, 0, 0, 0\n"
    trajectory = f"7, van, {cells(EAST.T, PLACE)}\n"
    reading = read(folder(tmp_path, "7, cam0, a.jpg", trajectory, rigs))
    pose = pose_of(reading, "a.jpg")
    assert (pose.easting, pose.northing, pose.altitude_m) == pytest.approx(
        (652_002.0, 6_862_000.0, 40.0)
    )
    assert (pose.heading_deg, pose.pitch_deg, pose.roll_deg) == pytest.approx((0, 0, 0), abs=1e-6)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("0, cam0, 1, 0, 0, 0, , ,", "line 1: a partial pose without tx, ty, tz"),
        ("0, cam0, , , , , 1, 2, 3", "a partial pose without qw, qx, qy, qz"),
        ("0, cam0, 1, 0, 0", "a partial pose without qz, tx, ty, tz"),
        ("0, cam0, 1, 0, 0, 0, x, 2, 3", "tx is 'x', expected a number"),
        ("0, cam0, nan, 0, 0, 0, 1, 2, 3", "qw is 'nan', expected a number"),
        ("0, cam0, 0, 0, 0, 0, 1, 2, 3", "is no rotation"),
        ("0, cam0, 1, 0, 0, 0, 1, 2, 99999", "altitude is"),
        ("5, cam0, 1, 0, 0, 0, 1, 2, 3", "none for 'cam0' or its rig at 0"),
        ("", "none for 'cam0' or its rig at 0"),
        ("0, cam0, 1, 0, 0, 0, 1, 2, 3\n0, cam0, 1, 0, 0, 0, 1, 2, 4", "line 1 is given again"),
    ],
)
def test_an_image_without_a_whole_pose_is_skipped(tmp_path: Path, line: str, why: str) -> None:
    reading = read(folder(tmp_path, "0, cam0, a.jpg\n", line))
    assert reading.images == ()
    assert why in reason(reading, "a.jpg")


def test_an_impossible_pose_is_told_with_the_line_that_says_it(tmp_path: Path) -> None:
    too_high = cells(EAST.T, PLACE + np.array([0.0, 0.0, 20_000.0]))
    root = folder(tmp_path, "1, cam0, a.jpg\n", f"# poses\n1, cam0, {too_high}\n")
    assert reason(read(root), "a.jpg").startswith("sensors/trajectories.txt, line 2: altitude is 2")


def test_a_record_that_does_not_hold_is_skipped_with_its_line(tmp_path: Path) -> None:
    records = (
        "0, cam0, a.jpg\n0, cam0, a.jpg\n0, gps1, b.jpg\nx, cam0, b.jpg\n"
        "0, cam0, gone.jpg\n0, cam0, ../../../etc/passwd\n0, cam0\n"
    )
    trajectory = f"0, cam0, {cells(EAST.T, PLACE)}\nx, y, 1\n"
    reading = read(folder(tmp_path, records, trajectory))
    assert [image.uri for image in reading.images] == ["sensors/records_data/a.jpg"]
    reasons = " ".join(skip.reason for skip in reading.skipped)
    for line, why in [
        (2, "the same image as a line before"),
        (3, "camera 'gps1' is not in sensors.txt"),
        (4, "timestamp is 'x', expected an integer"),
        (5, "no image 'sensors/records_data/gone.jpg'"),
        (6, "no image 'sensors/records_data/../../../etc/passwd'"),
        (7, "expected a timestamp, a device and a path"),
    ]:
        assert f"records_camera.txt, line {line}: " in reasons
        assert why in reasons
    assert "timestamp is 'x'" in reason(reading, "trajectories.txt, line 2")


def test_an_image_that_no_record_names_is_told(tmp_path: Path) -> None:
    reading = read(folder(tmp_path, "0, cam0, a.jpg", f"0, cam0, {cells(EAST.T, PLACE)}"))
    assert "no line of sensors/records_camera.txt names it" in reason(reading, "b.jpg")


def test_rigs_that_carry_each_other_have_no_pose(tmp_path: Path) -> None:
    rigs = "r1, cam0, 1,0,0,0,0,0,0\nr2, r1, 1,0,0,0,0,0,0\nr1, r2, 1,0,0,0,0,0,0\n"
    reading = read(folder(tmp_path, "0, cam0, a.jpg", "", rigs))
    assert "image without pose" in reason(reading, "a.jpg")


@pytest.mark.parametrize(
    ("crs", "error", "message"),
    [(None, UnknownCrs, "--crs"), ("EPSG:4326", BadSurvey, "in degrees")],
)
def test_poses_in_metres_need_a_projected_system(
    tmp_path: Path, crs: str | None, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        read(folder(tmp_path, "0, cam0, a.jpg", ""), crs)


@pytest.mark.parametrize(
    ("sensors", "rigs", "message"),
    [
        ("c, , camera, PINHOLE, 800, 600, 0, 1, 1, 1", "", "line 1: a PINHOLE camera"),
        ("c, , camera, PINHOLE, 800, x", "", "parameter 2 is 'x'"),
        ("c, , camera, UNKNOWN_CAMERA, 0, 600", "", "size is 0 x 600"),
        ("c, , camera\nc, , camera", "", "line 2: sensor 'c' is there twice"),
        (SENSORS, "r, cam0, 1, 0", "rigs.txt, line 1: a partial pose"),
        (SENSORS, "r", "rigs.txt, line 1: expected a rig"),
    ],
)
def test_a_calibration_that_does_not_hold_is_refused(
    tmp_path: Path, sensors: str, rigs: str, message: str
) -> None:
    with pytest.raises(BadSurvey, match=message):
        read(folder(tmp_path, "0, c, a.jpg", "", rigs, sensors))


def test_a_camera_of_unknown_model_is_kept_without_a_field_of_view(tmp_path: Path) -> None:
    sensors = "c, , camera, UNKNOWN_CAMERA, 800, 600\nd, , camera\n"
    trajectory = f"0, c, {cells(EAST.T, PLACE)}\n0, d, {cells(EAST.T, PLACE)}"
    root = folder(tmp_path, "0, c, a.jpg\n0, d, b.jpg", trajectory, sensors=sensors)
    cameras = [image.camera for image in read(root).images]
    assert [(camera.hfov_deg, camera.width_px) for camera in cameras] == [(None, 800), (None, None)]


def test_a_file_in_latin_1_is_refused(tmp_path: Path) -> None:
    root = folder(tmp_path, "0, cam0, a.jpg", "")
    (root / "sensors" / "records_camera.txt").write_bytes("0, caméra, a.jpg".encode("latin-1"))
    with pytest.raises(BadSurvey, match="is not UTF-8"):
        read(root)


def test_only_a_folder_with_sensors_and_records_is_recognised(tmp_path: Path) -> None:
    assert not kapture.READER.recognises(tmp_path)
    assert kapture.READER.recognises(folder(tmp_path / "k", "", ""))
    with pytest.raises(BadSurvey, match="is no kapture folder"):
        read(tmp_path)


ODD = st.text(st.sampled_from(list("0123456789.-+enaif,# \tcam\r\n\u00e9\ufeff\x00")), max_size=60)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.tuples(ODD, ODD, ODD, ODD))
def test_any_text_is_read_or_refused_as_what_it_is(
    tmp_path_factory: pytest.TempPathFactory, texts: tuple[str, str, str, str]
) -> None:
    records, trajectories, rigs, sensors = texts
    root = folder(
        tmp_path_factory.mktemp("k") / "f",
        f"0, cam0, a.jpg\n{records}",
        f"{trajectories}\n0, rig, {cells(EAST.T, PLACE)}",
        rigs,
        SENSORS + sensors,
    )
    try:
        reading = read(root)
    except FlaneurError:
        return
    assert {image.uri for image in reading.images} <= {"sensors/records_data/a.jpg"}
