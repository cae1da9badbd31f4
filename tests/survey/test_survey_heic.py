import hashlib
import math
from pathlib import Path

import numpy as np
import pillow_heif
import pytest
from PIL import Image

from contracts.errors import UnusableImage
from survey import ReadOptions, decode_image, read_survey

GRADIENT = np.dstack(
    [
        np.tile(np.arange(0, 240, 2, dtype=np.uint8), (80, 1)),
        np.repeat(np.arange(0, 240, 3, dtype=np.uint8)[:, None], 120, axis=1),
        np.full((80, 120), 90, np.uint8),
    ]
)


def save(path: Path, pixels: np.ndarray, exif: Image.Exif | None = None, **how: object) -> Path:
    """Written by pillow-heif, whose encoder is x265; Flaneur reads with libde265."""
    if exif is not None:
        how["exif"] = exif.tobytes()
    height, width, channels = pixels.shape
    mode = {3: "RGB", 4: "RGBA"}[channels]
    with path.open("wb") as file:
        pillow_heif.encode(mode, (width, height), pixels.tobytes(), file, **how)
    return path


@pytest.mark.parametrize("suffix", [".heic", ".heif", ".HEIC"])
def test_a_heic_photo_is_decoded(tmp_path: Path, suffix: str) -> None:
    path = save(tmp_path / f"a{suffix}", GRADIENT)
    image = decode_image(path)
    assert (image.width_px, image.height_px, image.scale) == (120, 80, 1.0)
    np.testing.assert_allclose(image.rgb.astype(int), GRADIENT.astype(int), atol=12)
    assert image.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def test_a_large_heic_photo_is_reduced(tmp_path: Path) -> None:
    large = np.repeat(np.repeat(GRADIENT, 5, axis=0), 5, axis=1)
    image = decode_image(save(tmp_path / "a.heic", large), max_side_px=60)
    assert (image.width_px, image.height_px, image.scale) == (600, 400, 10.0)
    assert image.rgb.shape == (40, 60, 3)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_heic_photo_is_turned_upright_once(tmp_path: Path, orientation: int) -> None:
    """As a telephone writes it: turned by a property of the container, and the EXIF says it too."""
    stored = {
        1: GRADIENT,
        2: GRADIENT[:, ::-1],
        3: GRADIENT[::-1, ::-1],
        4: GRADIENT[::-1],
        5: GRADIENT.transpose(1, 0, 2),
        6: np.rot90(GRADIENT, 1),
        7: GRADIENT[::-1, ::-1].transpose(1, 0, 2),
        8: np.rot90(GRADIENT, 3),
    }
    exif = Image.Exif()
    exif[274] = orientation
    image = decode_image(save(tmp_path / "a.heic", stored[orientation], exif))
    assert b"irot" in (tmp_path / "a.heic").read_bytes() or orientation in {1, 2, 4}
    assert (image.width_px, image.height_px) == (120, 80)
    np.testing.assert_allclose(image.rgb.astype(int), GRADIENT.astype(int), atol=14)


def test_quarter_turns_of_a_heic_photo_are_counter_clockwise(tmp_path: Path) -> None:
    image = decode_image(save(tmp_path / "a.heic", GRADIENT), quarter_turns=1)
    assert (image.width_px, image.height_px) == (80, 120)
    np.testing.assert_allclose(image.rgb.astype(int), np.rot90(GRADIENT).astype(int), atol=12)


def test_a_heic_photo_has_its_pose(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0110] = "Phone 12"
    exif.get_ifd(0x8825).update(
        {1: "N", 2: (48.0, 51.0, 12.6), 3: "E", 4: (2.0, 20.0, 24.0), 16: "T", 17: 77.5, 31: 4.5}
    )
    exif.get_ifd(0x8769).update({0xA405: 26})
    save(tmp_path / "IMG_0001.HEIC", GRADIENT, exif)
    (image,) = read_survey(tmp_path, ReadOptions()).images
    assert image.pose is not None
    assert (image.pose.easting, image.pose.northing) == pytest.approx((2.34, 48.8535))
    assert (image.pose.heading_deg, image.pose.north) == (77.5, "true")
    assert image.pose.position_error_m == 4.5
    assert image.camera.name == "Phone 12"
    diagonal = math.hypot(36, 24) / 2
    expected = 2 * math.degrees(math.atan(diagonal * 120 / math.hypot(120, 80) / 26))
    assert image.camera.hfov_deg == pytest.approx(expected)


def test_transparent_parts_of_a_heic_photo_lie_over_white(tmp_path: Path) -> None:
    rgba = np.dstack([np.full((64, 64, 3), 40, np.uint8), np.zeros((64, 64), np.uint8)])
    image = decode_image(save(tmp_path / "a.heic", rgba, quality=100))
    assert image.rgb.min() > 250


def test_too_many_pixels_are_refused_from_the_header_of_a_heic(tmp_path: Path) -> None:
    path = save(tmp_path / "a.heic", GRADIENT)
    with pytest.raises(UnusableImage, match="120 x 80 pixels are more than max_pixels"):
        decode_image(path, max_pixels=9_599)


def test_a_header_that_says_less_than_is_there_does_not_get_past_the_limit(
    tmp_path: Path,
) -> None:
    big = np.zeros((600, 800, 3), np.uint8)
    path = save(tmp_path / "a.heic", big)
    whole = path.read_bytes()
    size = (800).to_bytes(4, "big") + (600).to_bytes(4, "big")
    assert whole.count(size) == 1
    path.write_bytes(whole.replace(size, (8).to_bytes(4, "big") + (6).to_bytes(4, "big")))
    with pytest.raises(UnusableImage):
        decode_image(path, max_pixels=1000)


@pytest.mark.parametrize("share", [0.01, 0.2, 0.5, 0.95])
def test_a_truncated_heic_is_refused(tmp_path: Path, share: float) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (200, 200, 3), dtype=np.uint8)
    path = save(tmp_path / "a.heic", noise)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * share)])
    with pytest.raises(UnusableImage):
        decode_image(path)


def test_damaged_heic_files_are_only_ever_refused_as_unusable(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 256, (40, 40, 3), dtype=np.uint8)
    whole = np.frombuffer(save(tmp_path / "a.heic", noise).read_bytes(), np.uint8)
    refused = 0
    for trial in range(150):
        broken = whole.copy()
        reach = 600 if trial % 2 else len(broken)
        broken[rng.integers(0, min(reach, len(broken)), 4)] = rng.integers(0, 256, 4)
        (tmp_path / "b").write_bytes(broken.tobytes())
        try:
            decode_image(tmp_path / "b", max_pixels=1_000_000)
        except UnusableImage:
            refused += 1
    assert refused > 30


def test_the_reader_of_heic_cannot_write_it() -> None:
    """Its wheel has no encoder: x265 would put Flaneur under the GPL."""
    import pi_heif

    assert "x265" not in str(pi_heif.libheif_info())
