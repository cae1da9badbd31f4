import json
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from contracts.errors import BadSurvey
from contracts.records import PosedImage
from geo.crs import ToWgs84
from survey import ReadOptions, Survey, decode_image, decode_mask, read_survey

# Optical axis, left, up in (forward, right, down).
FRONT = [1, 0, 0, 0, -1, 0, 0, 0, -1]
LEFT = [0, -1, 0, -1, 0, 0, 0, 0, -1]
SKY = [0, 0, -1, 1, 0, 0, 0, -1, 0]
PROJECTION = [100, 0, 100, 0, 50, 40, 0, 0, 1]


def camera(number: int, rotation: list[int], **more: object) -> dict[str, object]:
    return {
        "id": number,
        "rotation": rotation,
        "position": [1.0, 2.0, -3.0],
        "projection": PROJECTION,
        "size": [200, 80],
        "orientation": 2,
    } | more


def panorama(number: int, **more: object) -> dict[str, object]:
    return {
        "id": number,
        "easting": 651000.0,
        "northing": 6861000.0,
        "altitude": 40.0,
        "heading": 90.0,
        "pitch": 0.0,
        "roll": 0.0,
        "date": "2014-06-16T12:31:34.841Z",
    } | more


def survey_of(
    folder: Path,
    cameras: list[dict[str, object]],
    panoramas: list[dict[str, object]],
    *names: str,
) -> Path:
    (folder / "cameraCalibration.json").write_text(json.dumps(cameras))
    (folder / "panoramicsMetaData.json").write_text(json.dumps(panoramas))
    for name in names or ("images/Town-140616_0740-301-00001_0000007.jpg",):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        Image.new("RGB", (20, 8)).save(folder / name)
    return folder


def only(folder: Path, options: ReadOptions | None = None) -> PosedImage:
    (image,) = read_survey(folder, options or ReadOptions()).images
    return image


def reasons(survey: Survey) -> dict[str, str]:
    return {skip.uri: skip.reason for skip in survey.skipped}


def test_the_front_camera_looks_where_the_vehicle_heads(tmp_path: Path) -> None:
    image = only(survey_of(tmp_path, [camera(301, FRONT)], [panorama(7)]))
    pose = image.pose
    assert pose is not None
    assert (pose.heading_deg, pose.pitch_deg, pose.roll_deg) == pytest.approx((90, 0, 0))
    assert (pose.crs, pose.north) == ("EPSG:2154", "true")
    # Heading east: 1 m forward is east, 2 m right is south, 3 m against down is up.
    assert (pose.easting, pose.northing, pose.altitude_m) == pytest.approx(
        (651001.0, 6860998.0, 43.0)
    )
    assert image.captured_at == "2014-06-16T12:31:34.841Z"
    assert image.camera.name == "301"


def test_a_camera_on_the_left_pitches_up_as_the_vehicle_rolls_right_down(tmp_path: Path) -> None:
    root = survey_of(tmp_path, [camera(301, LEFT)], [panorama(7, roll=5.0, heading=30.0)])
    pose = only(root).pose
    assert pose is not None
    assert (pose.heading_deg, pose.pitch_deg, pose.roll_deg) == pytest.approx((300, 5, 0))


def test_a_sky_camera_looks_up(tmp_path: Path) -> None:
    image = only(survey_of(tmp_path, [camera(301, SKY, orientation=3)], [panorama(7, pitch=1.0)]))
    assert image.pose is not None
    assert image.pose.pitch_deg == pytest.approx(89.0)


@pytest.mark.parametrize(("orientation", "turns"), [(0, 1), (1, 3), (2, 2), (3, 0)])
def test_stored_orientation_becomes_quarter_turns(
    tmp_path: Path, orientation: int, turns: int
) -> None:
    root = survey_of(tmp_path, [camera(301, FRONT, orientation=orientation)], [panorama(7)])
    assert only(root).quarter_turns == turns
    assert only(root, ReadOptions(make_upright=False)).quarter_turns == 0


@pytest.mark.parametrize(
    ("orientation", "half_tangents"), [(2, (1.0, 1.0)), (1, (40 / 50, 40 / 50))]
)
def test_the_field_of_view_is_across_the_upright_image(
    tmp_path: Path, orientation: int, half_tangents: tuple[float, float]
) -> None:
    root = survey_of(tmp_path, [camera(301, FRONT, orientation=orientation)], [panorama(7)])
    expected = sum(math.degrees(math.atan(tangent)) for tangent in half_tangents)
    assert only(root).camera.hfov_deg == pytest.approx(expected)


def test_a_lens_that_compresses_its_edges_sees_wider(tmp_path: Path) -> None:
    # 120 ideal pixels are stored at 120 (1 - 120^2 / 86400) = 100.
    distortion = {"pps": [100, 40], "poly357": [-1 / 86_400, 0, 0]}
    root = survey_of(tmp_path, [camera(301, FRONT, distortion=distortion)], [panorama(7)])
    expected = 2 * math.degrees(math.atan(1.2))
    assert only(root).camera.hfov_deg == pytest.approx(expected)


def test_a_mask_belongs_to_its_camera_and_is_no_image(tmp_path: Path) -> None:
    root = survey_of(
        tmp_path,
        [camera(301, FRONT, mask="images/mask301.jpg"), camera(302, LEFT)],
        [panorama(7)],
        "images/T-1-301-1_7.jpg",
        "images/T-1-302-1_7.jpg",
        "images/mask301.jpg",
    )
    first, second = read_survey(root, ReadOptions()).images
    assert first.mask_path == str(root / "images" / "mask301.jpg")
    assert second.mask_path is None
    without = read_survey(root, ReadOptions(use_masks=False)).images
    assert [image.mask_path for image in without] == [None, None]


@pytest.mark.parametrize("mask", ["images/gone.jpg", "../outside.jpg", "/etc/hosts.jpg"])
def test_a_mask_that_is_not_in_the_survey_is_refused(tmp_path: Path, mask: str) -> None:
    root = survey_of(tmp_path, [camera(301, FRONT, mask=mask)], [panorama(7)])
    with pytest.raises(BadSurvey, match="mask"):
        read_survey(root, ReadOptions())
    assert only(root, ReadOptions(use_masks=False)).mask_path is None


def test_images_and_panoramas_without_each_other_are_skipped(tmp_path: Path) -> None:
    root = survey_of(
        tmp_path,
        [camera(301, FRONT)],
        [panorama(7), panorama(8), panorama(9), panorama(9), panorama(10, heading=None)],
        *(f"i/T-1-{name}.jpg" for name in ("301-1_7", "999-1_7", "301-1_6", "301-1_9")),
        "i/T-1-301-1_10.jpg",
        "i/holiday.jpg",
    )
    survey = read_survey(root, ReadOptions())
    assert [image.uri for image in survey.images] == ["i/T-1-301-1_7.jpg"]
    found = reasons(survey)
    assert "camera 999 is not in" in found["i/T-1-999-1_7.jpg"]
    assert "panorama 6 is not in" in found["i/T-1-301-1_6.jpg"]
    assert "more than once" in found["i/T-1-301-1_9.jpg"]
    broken = "panoramicsMetaData.json, panorama 10: heading is None"
    assert broken in found["i/T-1-301-1_10.jpg"]
    assert "its name" in found["i/holiday.jpg"]
    assert "no image of panorama 8" in found["panoramicsMetaData.json#8"]
    # Of panoramas that cannot be placed or are told twice, the images say so already.
    assert len(found) == 6


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"rotation": [1, 0, 0, 0, 1, 0, 0, 0, -1]}, "not a rotation"),
        ({"rotation": [1, 0]}, "expected 9 finite numbers"),
        ({"orientation": 7}, "orientation is 7"),
        ({"projection": [0] * 9}, "focal length"),
        ({"position": [0, 0, float("nan")]}, "position"),
        ({"size": None}, "size"),
    ],
)
def test_a_broken_calibration_is_refused_by_camera(
    tmp_path: Path, change: dict[str, object], reason: str
) -> None:
    root = survey_of(tmp_path, [camera(301, FRONT) | change], [panorama(7)])
    with pytest.raises(BadSurvey, match=f"camera 301: .*{reason}"):
        read_survey(root, ReadOptions())


@pytest.mark.parametrize("text", ["", "{", "{}", "[[1]]", "\udcff"])
def test_broken_metadata_is_refused_by_file(tmp_path: Path, text: str) -> None:
    root = survey_of(tmp_path, [], [panorama(7)])
    (root / "cameraCalibration.json").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(BadSurvey, match="cameraCalibration"):
        read_survey(root, ReadOptions())


@pytest.fixture(scope="module")
def paris(test_data: Path) -> Survey:
    return read_survey(test_data / "stereopolis-paris6", ReadOptions())


def test_the_real_survey_is_read_whole(paris: Survey) -> None:
    assert (len(paris.images), paris.format, paris.crs) == (250, "stereopolis", "EPSG:2154")
    assert paris.skipped == ()
    assert not any("mask" in image.uri for image in paris.images)
    assert sum(image.mask_path is not None for image in paris.images) == 100


def test_the_real_rig_looks_ahead_left_back_right_and_up(paris: Survey) -> None:
    heading: dict[str, list[float]] = {}
    for image in paris.images:
        pose = image.pose
        assert pose is not None
        assert pose.pitch_deg is not None
        assert pose.roll_deg is not None
        assert pose.heading_deg is not None
        if image.camera.name == "300":
            assert pose.pitch_deg > 60.0
            continue
        assert abs(pose.pitch_deg) < 4.0
        assert abs(pose.roll_deg) < 4.0
        heading.setdefault(image.camera.name, []).append(pose.heading_deg)
    ahead = np.array(heading["301"])
    for name, turned in (("302", -90.0), ("303", 180.0), ("304", 90.0)):
        off = (np.array(heading[name]) - ahead - turned + 180.0) % 360.0 - 180.0
        assert np.abs(off).max() < 1.0


def test_the_real_headings_fit_the_track_as_true_ones_better_than_as_grid_ones(
    test_data: Path,
) -> None:
    panoramas = json.loads((test_data / "stereopolis-paris6/panoramicsMetaData.json").read_text())
    off = []
    for before, at, after in zip(panoramas, panoramas[1:], panoramas[2:], strict=False):
        east = after["easting"] - before["easting"]
        north = after["northing"] - before["northing"]
        straight = abs(after["heading"] - before["heading"]) < 2.0
        if straight and after["id"] - before["id"] == 2 and math.hypot(east, north) > 3.0:
            off.append(at["heading"] - math.degrees(math.atan2(east, north)) % 360.0)
    first = panoramas[0]
    to_grid = ToWgs84("EPSG:2154").convergence_deg(first["easting"], first["northing"])[0]
    assert len(off) > 20
    assert abs(np.mean(off) - to_grid) < abs(np.mean(off)) / 2


def test_real_images_come_out_upright_with_the_vehicle_hidden_at_the_bottom(
    paris: Survey,
) -> None:
    (image,) = (image for image in paris.images if image.uri.endswith("301-00001_0000490.jpg"))
    decoded = decode_image(image.path, quarter_turns=image.quarter_turns, max_side_px=256)
    assert decoded.rgb.shape == (256, 256, 3)
    assert decoded.scale == 4.0
    # The sky above the street is brighter than the road ahead.
    assert decoded.rgb[:60, 115:145].mean() > decoded.rgb[150:190, 115:145].mean() + 40
    assert image.mask_path is not None
    usable = decode_mask(image.mask_path, quarter_turns=image.quarter_turns, width=256, height=256)
    assert usable[:128].all()
    assert usable[-8:].mean() < 0.3
    assert 0.8 < usable.mean() < 0.95
