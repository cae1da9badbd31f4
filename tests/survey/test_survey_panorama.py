import base64
import functools
import hashlib
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer
from PIL import Image
from scipy.spatial.transform import Rotation

from contracts.errors import UnusableImage
from contracts.records import Camera, Pose, PosedImage
from survey import decode_image, decode_mask
from survey.equirectangular import PanoramaArea, perspective
from survey.fragments import Fragment, Message, View
from survey.image_header import ImageHeader
from survey.panorama import VIEW_FOV_DEG, cut, cut_panoramas, panorama_area, view_pose
from survey.xmp import xmp_properties

POSE = Pose(2.34, 48.85, "EPSG:4326", 40.0, 30.0, 5.0, -8.0, "true", position_error_m=2.0)
WHOLE = PanoramaArea()
GPANO = (
    '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF '
    'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" '
    'xmlns:GPano="http://ns.google.com/photos/1.0/panorama/" {}/></rdf:RDF></x:xmpmeta>'
)


def gpano(**tags: object) -> bytes:
    return GPANO.format(" ".join(f'GPano:{name}="{tag}"' for name, tag in tags.items())).encode()


def save(path: Path, pixels: np.ndarray, xmp: bytes = b"") -> Path:
    """As PNG, or as JPEG with XMP, whatever the name says."""
    Image.fromarray(pixels).save(path, **({"xmp": xmp, "quality": 97} if xmp else {}))
    return path


def world_from_panorama(pose: Pose) -> Rotation:
    """Of vectors (ahead, right, down) into (north, east, down), heading then pitch then roll."""
    angles = [pose.heading_deg, pose.pitch_deg, pose.roll_deg]
    return Rotation.from_euler("ZYX", angles, degrees=True)


def directions(width: int, height: int) -> np.ndarray:
    """(height, width, 3) ahead, right, down of the centre of every pixel of a panorama."""
    lon = ((np.arange(width) + 0.5) / width * 2.0 - 1.0) * math.pi
    lat = (0.5 - (np.arange(height) + 0.5) / height)[:, None] * math.pi
    ahead, right = np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon)
    return np.stack([ahead, right, np.broadcast_to(-np.sin(lat), right.shape)], axis=-1)


def panorama_of_lights(lights_ned: np.ndarray, pose: Pose, width: int = 2048) -> np.ndarray:
    """Round lights half a degree wide on black, as seen with this attitude."""
    rays = directions(width, width // 2)
    seen = world_from_panorama(pose).inv().apply(lights_ned)
    cosine = np.clip(rays @ seen.T, -1.0, 1.0).max(axis=-1)
    glow = 255.0 * np.exp(-((np.degrees(np.arccos(cosine)) / 0.5) ** 2))
    return np.repeat(glow.astype(np.uint8)[..., None], 3, axis=2)


@functools.cache
def lit_panorama() -> np.ndarray:
    return panorama_of_lights(lights(), POSE)


def lights() -> np.ndarray:
    """24 directions (north, east, down) spread over the band that the views show."""
    azimuth = np.radians(np.arange(24) * 15.0 + 3.0)
    elevation = np.radians(np.tile([-18.0, 0.0, 9.0, 20.0], 6))
    level = np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), -np.sin(elevation)], axis=1)


def pinhole(lights_ned: np.ndarray, pose: Pose, side: int) -> np.ndarray:
    """(n, 2) column and row of each light in a view, NaN where it lies behind the camera."""
    ahead, right, down = world_from_panorama(pose).inv().apply(lights_ned).T
    focal = side / 2 / math.tan(math.radians(VIEW_FOV_DEG) / 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        xy = np.stack([right / ahead, down / ahead], axis=1) * focal + side / 2 - 0.5
    return np.where(ahead[:, None] > 0.0, xy, np.nan)


def centre_of_light(grey: np.ndarray, column: float, row: float) -> tuple[float, float]:
    x0, y0 = round(column), round(row)
    patch = grey[y0 - 6 : y0 + 7, x0 - 6 : x0 + 7].astype(float)
    total = patch.sum()
    assert total > 1000.0, f"no light near column {column:.1f}, row {row:.1f}"
    rows, columns = np.mgrid[-6:7, -6:7]
    return x0 + (patch * columns).sum() / total, y0 + (patch * rows).sum() / total


@pytest.mark.parametrize("max_side_px", [2000, 300])
def test_a_direction_lands_where_the_pose_of_its_view_says(
    tmp_path: Path, max_side_px: int
) -> None:
    path = save(tmp_path / "pano.png", lit_panorama())
    views = cut(PosedImage("pano.png", str(path), pose=POSE), WHOLE)
    seen = 0
    for view in views:
        assert view.pose is not None
        decoded = decode_image(view.path, fragment=view.fragment, max_side_px=max_side_px)
        side = len(decoded.rgb)
        for column, row in pinhole(lights(), view.pose, side):
            if 10 < column < side - 10 and 10 < row < side - 10:
                found = centre_of_light(decoded.rgb[..., 1], column, row)
                assert found == pytest.approx((column, row), abs=0.15)
                seen += 1
    assert seen > 30  # 80 of 360 degrees eight times over 24 lights


def test_a_straight_line_stays_straight() -> None:
    rays = directions(2048, 1024)
    normal = np.array([0.3, 0.5, -0.4]) / np.linalg.norm([0.3, 0.5, -0.4])
    glow = 255.0 * np.exp(-((np.degrees(np.arcsin(rays @ normal)) / 0.4) ** 2))
    cut_out = perspective(glow.astype(np.uint8), WHOLE, View(320.0, 0.0, 75.0), 500).astype(float)
    rows = np.arange(500)
    columns = (cut_out * np.arange(500)).sum(axis=1) / np.maximum(cut_out.sum(axis=1), 1e-9)
    inside = (cut_out.sum(axis=1) > 500.0) & (columns > 20) & (columns < 480)
    line = np.polyfit(rows[inside], columns[inside], 1)
    assert inside.sum() > 100
    assert np.abs(np.polyval(line, rows[inside]) - columns[inside]).max() < 0.3


def test_the_seam_behind_the_camera_is_not_seen() -> None:
    ramp = np.round(127.5 - 127.5 * np.cos(np.linspace(-math.pi, math.pi, 1025)[:-1] + 0.003))
    panorama = np.repeat(ramp[None, :].astype(np.uint8), 512, axis=0)
    behind = perspective(panorama, WHOLE, View(180.0, 0.0, 75.0), 251)
    steps = np.abs(np.diff(behind[125].astype(int)))
    assert steps.max() <= 2


def test_views_go_all_round_and_overlap() -> None:
    level = replace(POSE, pitch_deg=0.0, roll_deg=0.0)
    views = cut(PosedImage("d/pano.jpg", "/d/pano.jpg", pose=level), WHOLE)
    headings = [view.pose.heading_deg for view in views if view.pose is not None]
    assert headings == pytest.approx([30.0, 75.0, 120.0, 165.0, 210.0, 255.0, 300.0, 345.0])
    assert {view.camera.hfov_deg for view in views} == {80.0}
    assert views[1].uri == "d/pano.jpg#yaw=45&pitch=0&fov=80"
    assert views[1].fragment == "yaw=45&pitch=0&fov=80"
    assert {view.pose.position_error_m for view in views if view.pose is not None} == {2.0}


def test_views_of_a_panorama_in_an_mcap_file_keep_its_message() -> None:
    message = Message("/pano", 17, 4096)
    fragment = str(Fragment(message))
    image = PosedImage(f"a.mcap#{fragment}", "/a.mcap", fragment=fragment)
    view = cut(image, WHOLE)[2]
    assert view.fragment == str(Fragment(message, View(90.0, 0.0, 80.0)))
    assert view.uri == f"a.mcap#{view.fragment}"


def test_what_is_not_known_of_a_panorama_is_not_known_of_its_views() -> None:
    view = View(90.0, 0.0, 80.0)
    level = view_pose(replace(POSE, pitch_deg=None), view)
    assert (level.heading_deg, level.pitch_deg, level.roll_deg) == (120.0, None, None)
    tilted = view_pose(replace(POSE, heading_deg=None), view)
    assert tilted.heading_deg is None
    assert (tilted.pitch_deg, tilted.roll_deg) == pytest.approx((8.0, 5.0), abs=0.1)


def test_all_views_of_a_panorama_have_its_digest_and_its_fineness(tmp_path: Path) -> None:
    path = save(tmp_path / "pano.png", panorama_of_lights(lights()[:1], POSE, 1024))
    first, second = (
        decode_image(path, fragment=f"yaw={yaw}&pitch=0&fov=90", max_side_px=100) for yaw in (0, 45)
    )
    assert first.sha256 == second.sha256 == decode_image(path).sha256
    # One radian is 1024 / 2 pi pixels in the middle; half of 90 degrees has the tangent 1.
    assert (first.width_px, first.height_px) == (326, 326)
    assert first.rgb.shape == (100, 100, 3)
    assert first.scale == pytest.approx(3.26)


def test_a_panorama_that_changed_is_read_again(tmp_path: Path) -> None:
    path = save(tmp_path / "pano.png", np.zeros((100, 200, 3), np.uint8))
    assert decode_image(path, fragment="yaw=0&pitch=0&fov=90").rgb.max() == 0
    save(path, np.full((102, 204, 3), 200, np.uint8))
    assert decode_image(path, fragment="yaw=0&pitch=0&fov=90").rgb.min() == 200


def test_a_mask_is_cut_like_its_panorama(tmp_path: Path) -> None:
    mask = np.zeros((500, 1000), np.uint8)
    mask[250:, 700:800] = 255  # 72 to 108 degrees to the right, below the horizon
    path = save(tmp_path / "mask.png", mask)
    usable = decode_mask(
        path, fragment="yaw=90&pitch=0&fov=80", quarter_turns=0, width=400, height=400
    )
    assert usable.shape == (400, 400)
    reach = math.tan(math.radians(18.0)) / math.tan(math.radians(40.0)) * 200
    hidden = np.flatnonzero(~usable[300])
    assert (hidden[0], hidden[-1]) == pytest.approx((199.5 - reach, 199.5 + reach), abs=2.5)
    assert usable[:197].all()
    behind = decode_mask(
        path, fragment="yaw=270&pitch=0&fov=80", quarter_turns=0, width=400, height=400
    )
    assert behind.all()


def panorama(path: Path) -> Path:
    return save(path, np.zeros((20, 40, 3), np.uint8), gpano(ProjectionType="equirectangular"))


def cropped(path: Path, left: float, top: float) -> Path:
    """The lights' panorama, `left` and `top` of its pixels cut off, the other sides too."""
    whole, width = lit_panorama(), 2048
    x, y = int(left * width), int(top * width / 2)
    part = whole[y : width // 2 - y, x : width - x]
    tags = {
        "ProjectionType": "equirectangular",
        "FullPanoWidthPixels": width,
        "FullPanoHeightPixels": width // 2,
        "CroppedAreaImageWidthPixels": part.shape[1],
        "CroppedAreaImageHeightPixels": part.shape[0],
        "CroppedAreaLeftPixels": x,
        "CroppedAreaTopPixels": y,
    }
    return save(path, np.ascontiguousarray(part), gpano(**tags))


def test_a_cropped_panorama_gives_the_views_it_shows_in_the_right_place(tmp_path: Path) -> None:
    path = cropped(tmp_path / "part.jpg", left=0.25, top=0.2)
    views, skipped = cut_panoramas([PosedImage("part.jpg", str(path), pose=POSE)])
    assert skipped == ()
    assert [view.fragment.split("&")[0] for view in views] == ["yaw=0", "yaw=45", "yaw=315"]
    whole = save(tmp_path / "whole.png", lit_panorama())
    for view in views:
        part = decode_image(path, fragment=view.fragment).rgb.astype(int)
        full = decode_image(whole, fragment=view.fragment).rgb.astype(int)
        np.testing.assert_allclose(part, full, atol=12)


def test_a_crop_too_narrow_for_a_view_is_used_as_it_is(tmp_path: Path) -> None:
    path = cropped(tmp_path / "part.jpg", left=0.4, top=0.4)
    image = PosedImage("part.jpg", str(path), pose=POSE)
    assert cut_panoramas([image]) == ((image,), ())


def test_a_crop_that_cannot_be_is_told_with_its_numbers(tmp_path: Path) -> None:
    pixels = np.zeros((100, 300, 3), np.uint8)
    tags = {"FullPanoWidthPixels": 400, "FullPanoHeightPixels": 200, "CroppedAreaLeftPixels": 300}
    xmp = gpano(ProjectionType="equirectangular", **tags)
    path = save(tmp_path / "a.jpg", pixels, xmp)
    kept, (skip,) = cut_panoramas([PosedImage("a.jpg", str(path))])
    assert kept == ()
    assert "crop does not fit its 300 x 100 pixels" in skip.reason
    with pytest.raises(UnusableImage, match="crop does not fit"):
        decode_image(path, fragment="yaw=0&pitch=0&fov=80")


@pytest.mark.parametrize(
    ("size", "xmp", "n_views"),
    [
        ((4096, 2048), b"", 8),
        ((4096, 2047), b"", 1),
        ((2048, 1024), b"", 1),
        ((400, 200), gpano(ProjectionType="equirectangular"), 8),
        ((400, 120), gpano(ProjectionType="equirectangular"), 8),
        ((400, 200), gpano(ProjectionType="cylindrical"), 1),
        ((4096, 2048), b"<not xml", 8),
    ],
)
def test_a_panorama_is_known_by_its_gpano_or_its_shape(
    tmp_path: Path, size: tuple[int, int], xmp: bytes, n_views: int
) -> None:
    Image.new("RGB", size).save(tmp_path / "a.jpg", xmp=xmp)
    image = PosedImage("a.jpg", str(tmp_path / "a.jpg"), camera=Camera("", None, *size))
    views, skipped = cut_panoramas([image])
    assert (len(views), skipped) == (n_views, ())


def test_headers_are_read_only_where_an_image_may_be_a_panorama(tmp_path: Path) -> None:
    image = PosedImage("a.jpg", str(panorama(tmp_path / "a.jpg")))
    for camera, n_views in [
        (Camera(), 8),
        (Camera("", None, 400, 200), 8),
        (Camera("", 360.0), 8),
        (Camera("", None, 3000, 2000), 1),
        (Camera("", 92.0), 1),
    ]:
        views, _ = cut_panoramas([replace(image, camera=camera)])
        assert len(views) == n_views


def test_the_first_image_of_a_camera_speaks_for_the_others(tmp_path: Path) -> None:
    Image.new("RGB", (60, 40)).save(tmp_path / "plain.jpg")
    plain = PosedImage("c/1.jpg", str(tmp_path / "plain.jpg"))
    round_one = PosedImage("c/2.jpg", str(panorama(tmp_path / "round.jpg")))
    assert cut_panoramas([plain, round_one]) == ((plain, round_one), ())
    views, _ = cut_panoramas([round_one, plain])
    assert len(views) == 9
    elsewhere = replace(round_one, uri="d/2.jpg")
    views, _ = cut_panoramas([plain, elsewhere])
    assert len(views) == 9


def test_an_image_that_cannot_be_looked_into_is_left_to_whoever_decodes_it(tmp_path: Path) -> None:
    gone = PosedImage("a.jpg", str(tmp_path / "gone.jpg"))
    assert cut_panoramas([gone]) == ((gone,), ())


def test_a_damaged_panorama_is_unusable(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (200, 400, 3), np.uint8)
    path = save(tmp_path / "a.jpg", noise, gpano(ProjectionType="equirectangular"))
    path.write_bytes(path.read_bytes()[:20_000])
    with pytest.raises(UnusableImage, match="truncated"):
        decode_image(path, fragment="yaw=0&pitch=0&fov=80")
    with pytest.raises(UnusableImage, match="null byte"):
        decode_image("a\0b.jpg", fragment="yaw=0&pitch=0&fov=80")
    with pytest.raises(UnusableImage, match="No such file"):
        decode_image(tmp_path / "gone.jpg", fragment="yaw=0&pitch=0&fov=80")
    with pytest.raises(UnusableImage, match="more than max_pixels"):
        decode_image(
            save(tmp_path / "b.png", noise), fragment="yaw=0&pitch=0&fov=80", max_pixels=1000
        )


@pytest.mark.parametrize("size", [(1, 1), (2, 1), (7, 3)])
def test_a_panorama_of_a_few_pixels_is_cut_too(tmp_path: Path, size: tuple[int, int]) -> None:
    Image.new("RGB", size, (9, 80, 200)).save(tmp_path / "a.png")
    for yaw in (0, 180):
        view = decode_image(tmp_path / "a.png", fragment=f"yaw={yaw}&pitch=0&fov=120").rgb
        assert (view == [9, 80, 200]).all()


def test_views_of_zenith_and_nadir_look_up_and_down() -> None:
    panorama = np.zeros((180, 360), np.uint8)
    panorama[:25] = 200
    up = perspective(panorama, WHOLE, View(77.0, 90.0, 30.0), 51)
    down = perspective(panorama, WHOLE, View(77.0, -90.0, 30.0), 51)
    assert up.min() > 190
    assert down.max() == 0


def test_a_panorama_inside_an_mcap_file_is_cut_where_it_is(tmp_path: Path) -> None:
    save(tmp_path / "pano.jpg", lit_panorama(), gpano(ProjectionType="equirectangular"))
    jpeg = (tmp_path / "pano.jpg").read_bytes()
    body = json.dumps(
        {
            "timestamp": {"sec": 1, "nsec": 0},
            "frame_id": "cam",
            "format": "jpeg",
            "data": base64.b64encode(jpeg).decode(),
        }
    ).encode()
    path = tmp_path / "drive.mcap"
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start()
        schema = writer.register_schema("foxglove.CompressedImage", "jsonschema", b"{}")
        channel = writer.register_channel("/pano", "json", schema)
        writer.add_message(channel, log_time=5, publish_time=5, data=body)
        writer.finish()
    # A message record: opcode, length, channel, sequence and two times stand before its data.
    record = path.read_bytes().index(body) - (1 + 8 + 2 + 4 + 8 + 8)
    message = Message("/pano", 5, record, 0, "json:foxglove.CompressedImage")
    fragment = str(Fragment(message))
    image = PosedImage(f"drive.mcap#{fragment}", str(path), pose=POSE, fragment=fragment)
    views, skipped = cut_panoramas([image])
    assert (len(views), skipped) == (8, ())
    inside = decode_image(path, fragment=views[1].fragment)
    outside = decode_image(tmp_path / "pano.jpg", fragment="yaw=45&pitch=0&fov=80")
    np.testing.assert_array_equal(inside.rgb, outside.rgb)
    assert inside.sha256 == outside.sha256 == hashlib.sha256(jpeg).hexdigest()
    assert decode_image(path, fragment=fragment).rgb.shape == (512, 1024, 3)
    with pytest.raises(UnusableImage, match="more than max_pixels"):
        decode_image(path, fragment=fragment, max_pixels=1000)


@given(
    st.dictionaries(
        st.sampled_from(
            [
                "FullPanoWidthPixels",
                "FullPanoHeightPixels",
                "CroppedAreaImageWidthPixels",
                "CroppedAreaImageHeightPixels",
                "CroppedAreaLeftPixels",
                "CroppedAreaTopPixels",
            ]
        ),
        st.floats() | st.integers(-10, 500) | st.just("x"),
    ),
    st.tuples(st.integers(1, 400), st.integers(1, 400)),
)
def test_any_numbers_in_gpano_are_an_area_within_the_sphere_or_refused(
    tags: dict[str, object], size: tuple[int, int]
) -> None:
    xmp = xmp_properties(gpano(ProjectionType="equirectangular", **tags))
    try:
        area = panorama_area(ImageHeader(*size, {}, {}, {}, xmp, ""))
    except UnusableImage:
        return
    assert area is not None
    assert 0.0 < area.width < 1.01
    assert 0.0 < area.height < 1.01
    assert area.left + area.width < 1.01
    assert cut(PosedImage("a", "/a"), area) is not None


def test_a_panorama_stored_on_its_side_is_turned_before_it_is_cut(tmp_path: Path) -> None:
    upright = save(tmp_path / "a.png", lit_panorama())
    lying = save(tmp_path / "b.png", np.ascontiguousarray(np.rot90(lit_panorama(), -1)))
    fragment = "yaw=45&pitch=0&fov=80"
    first = decode_image(upright, fragment=fragment)
    second = decode_image(lying, fragment=fragment, quarter_turns=1)
    np.testing.assert_array_equal(first.rgb, second.rgb)
    assert (first.width_px, first.scale) == (second.width_px, second.scale)
