import hashlib
import os
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from contracts.errors import UnusableImage
from survey import decode_image, decode_mask

GRADIENT = np.dstack(
    [
        np.tile(np.arange(0, 240, 4, dtype=np.uint8), (40, 1)),
        np.repeat(np.arange(0, 200, 5, dtype=np.uint8)[:, None], 60, axis=1),
        np.full((40, 60), 90, np.uint8),
    ]
)


def save(
    path: Path, pixels: np.ndarray, exif: Image.Exif | None = None, progressive: bool = False
) -> Path:
    Image.fromarray(pixels).save(path, exif=exif or Image.Exif(), progressive=progressive)
    return path


def test_pixels_of_a_lossless_image_are_kept_as_they_are(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", GRADIENT)
    image = decode_image(path)
    np.testing.assert_array_equal(image.rgb, GRADIENT)
    assert (image.width_px, image.height_px, image.scale) == (60, 40, 1.0)
    assert image.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_a_large_image_is_reduced_to_the_means_of_its_areas(tmp_path: Path, suffix: str) -> None:
    large = np.repeat(np.repeat(GRADIENT, 40, axis=0), 40, axis=1)
    image = decode_image(save(tmp_path / f"a{suffix}", large), max_side_px=60)
    assert (image.width_px, image.height_px, image.scale) == (2400, 1600, 40.0)
    assert image.rgb.shape == (40, 60, 3)
    np.testing.assert_allclose(image.rgb.astype(int), GRADIENT.astype(int), atol=4)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_every_exif_orientation_comes_out_upright(
    tmp_path: Path, orientation: int, suffix: str
) -> None:
    # How the upright picture is stored for each value of the tag (EXIF 2.3, tag 274).
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
    path = save(tmp_path / f"a{suffix}", np.ascontiguousarray(stored[orientation]), exif=exif)
    image = decode_image(path)
    assert (image.width_px, image.height_px) == (60, 40)
    np.testing.assert_allclose(image.rgb.astype(int), GRADIENT.astype(int), atol=12)


@pytest.mark.parametrize("turns", range(4))
def test_quarter_turns_are_counter_clockwise(tmp_path: Path, turns: int) -> None:
    image = decode_image(save(tmp_path / "a.png", GRADIENT), quarter_turns=turns)
    np.testing.assert_array_equal(image.rgb, np.rot90(GRADIENT, turns))
    assert (image.height_px, image.width_px) == image.rgb.shape[:2]


def test_decoding_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (700, 500, 3), dtype=np.uint8)
    path = save(tmp_path / "a.jpg", noise)
    first, second = (decode_image(path, max_side_px=123).rgb for _ in range(2))
    assert first.tobytes() == second.tobytes()


def test_sixteen_bit_grey_is_scaled_to_eight(tmp_path: Path) -> None:
    samples = np.array([[0, 257, 128 * 257, 65_535]], np.uint16)
    image = decode_image(save(tmp_path / "a.png", samples))
    np.testing.assert_array_equal(image.rgb[0, :, 1], [0, 1, 128, 255])


def test_sixteen_bit_colour_is_scaled_to_eight(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    row = np.array([[10 * 257, 200 * 257, 65_535]], ">u2").tobytes()
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", 1, 1, 16, 2, 0, 0, 0)),
        (b"IDAT", zlib.compress(b"\0" + row)),
        (b"IEND", b""),
    ]
    body = b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + body)
    np.testing.assert_array_equal(decode_image(path).rgb, [[[10, 200, 255]]])


def test_transparency_is_laid_over_white(tmp_path: Path) -> None:
    rgba = np.array([[[200, 0, 0, 255], [0, 0, 0, 0], [0, 0, 0, 127]]], np.uint8)
    image = decode_image(save(tmp_path / "a.png", rgba))
    np.testing.assert_array_equal(image.rgb, [[[200, 0, 0], [255, 255, 255], [128, 128, 128]]])


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "PA", "RGBA", "CMYK", "YCbCr", "I;16", "I"])
def test_every_mode_of_pixels_becomes_rgb(tmp_path: Path, mode: str) -> None:
    suffix = ".jpg" if mode in {"CMYK", "YCbCr"} else ".tif" if mode in {"I", "PA"} else ".png"
    path = tmp_path / f"a{suffix}"
    white = {"I;16": 65_535, "I": 65_535}.get(mode)
    grey = Image.new("L", (30, 20), 255)
    picture = Image.new(mode, (30, 20), white) if white else grey.convert(mode)
    if mode == "PA":
        picture = grey.convert("P")
        picture.info["transparency"] = 0
    picture.save(path)
    image = decode_image(path)
    assert image.rgb.dtype == np.uint8
    np.testing.assert_array_equal(image.rgb, np.full((20, 30, 3), 255))


def test_a_cmyk_jpeg_keeps_its_colours(tmp_path: Path) -> None:
    Image.new("RGB", (32, 32), (250, 30, 30)).convert("CMYK").save(tmp_path / "a.jpg", quality=95)
    assert np.abs(decode_image(tmp_path / "a.jpg").rgb.astype(int) - [250, 30, 30]).max() < 6


def test_an_image_of_one_pixel_is_decoded(tmp_path: Path) -> None:
    image = decode_image(save(tmp_path / "a.jpg", np.full((1, 1, 3), 77, np.uint8)))
    assert image.rgb.shape == (1, 1, 3)
    assert image.scale == 1.0


def test_a_thread_of_an_image_keeps_its_thickness_of_one_pixel(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", np.zeros((1, 5000, 3), np.uint8))
    assert decode_image(path, max_side_px=100).rgb.shape == (1, 100, 3)


@pytest.mark.parametrize("progressive", [False, True])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.95])
def test_a_truncated_jpeg_is_refused(tmp_path: Path, share: float, progressive: bool) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (200, 200, 3), dtype=np.uint8)
    path = save(tmp_path / "a.jpg", noise, progressive=progressive)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * share)])
    with pytest.raises(UnusableImage, match="truncated"):
        decode_image(path, max_side_px=50)


def test_a_truncated_png_is_refused(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (200, 200, 3), dtype=np.uint8)
    path = save(tmp_path / "a.png", noise)
    path.write_bytes(path.read_bytes()[:50_000])
    with pytest.raises(UnusableImage, match="truncated"):
        decode_image(path)


@pytest.mark.parametrize(
    ("content", "reason"),
    [(b"", "empty"), (b"not an image at all", "not a supported image"), (b"\xff\xd8", "image")],
)
def test_what_is_no_image_is_refused_with_its_reason(
    tmp_path: Path, content: bytes, reason: str
) -> None:
    (tmp_path / "a.jpg").write_bytes(content)
    with pytest.raises(UnusableImage, match=reason):
        decode_image(tmp_path / "a.jpg")


def test_damaged_files_are_only_ever_refused_as_unusable(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    noise = rng.integers(0, 256, (40, 40, 3), dtype=np.uint8)
    refused = 0
    for suffix in ("jpg", "png", "tif", "webp", "bmp", "jp2", "ppm"):
        whole = np.frombuffer(save(tmp_path / f"a.{suffix}", noise).read_bytes(), np.uint8)
        for _ in range(30):
            broken = whole.copy()
            broken[rng.integers(0, min(200, len(broken)), 6)] = rng.integers(0, 256, 6)
            (tmp_path / "b").write_bytes(broken.tobytes())
            try:
                decode_image(tmp_path / "b", max_pixels=1_000_000)
            except UnusableImage:
                refused += 1
    assert refused > 30


def test_too_many_pixels_are_refused_from_the_header(tmp_path: Path) -> None:
    path = tmp_path / "huge.png"
    header = b"IHDR" + struct.pack(">IIBBBBB", 30_000, 30_000, 8, 2, 0, 0, 0)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + struct.pack(">I", 13)
        + header
        + struct.pack(">I", zlib.crc32(header))
        + struct.pack(">I", 1_000_000)
        + b"IDAT"
    )
    with pytest.raises(UnusableImage, match="30000 x 30000 pixels are more than max_pixels"):
        decode_image(path)


def test_pillows_own_pixel_limit_neither_warns_nor_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    path = save(tmp_path / "a.png", GRADIENT)
    assert decode_image(path).rgb.shape == (40, 60, 3)
    assert Image.MAX_IMAGE_PIXELS == 100


def test_a_pipe_is_refused_instead_of_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.jpg")
    with pytest.raises(UnusableImage, match="not a regular file"):
        decode_image(tmp_path / "a.jpg")


def test_a_folder_or_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UnusableImage, match="not a regular file"):
        decode_image(tmp_path)
    with pytest.raises(UnusableImage, match="No such file"):
        decode_image(tmp_path / "missing.jpg")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read every file")
def test_a_file_that_may_not_be_read_is_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", GRADIENT)
    path.chmod(0)
    with pytest.raises(UnusableImage, match="Permission denied"):
        decode_image(path)


def test_a_mask_hides_every_trace_of_the_vehicle(tmp_path: Path) -> None:
    mask = np.zeros((100, 200), np.uint8)
    mask[:20, :50] = 255
    mask[:20, 50:60] = 40
    path = save(tmp_path / "mask.png", mask)
    usable = decode_mask(path, quarter_turns=2, width=400, height=200)
    assert usable.shape == (200, 400)
    assert usable.dtype == np.bool_
    expected = np.ones((200, 400), bool)
    expected[160:, 280:] = False
    assert (usable != expected).mean() < 0.01
    assert not usable[170:, 290:].any()


def test_a_mask_of_a_turned_image_is_turned_with_it(tmp_path: Path) -> None:
    mask = np.zeros((100, 200), np.uint8)
    mask[:, :50] = 255
    usable = decode_mask(save(tmp_path / "m.png", mask), quarter_turns=1, width=100, height=200)
    np.testing.assert_array_equal(usable[:, 0], np.arange(200) < 150)
