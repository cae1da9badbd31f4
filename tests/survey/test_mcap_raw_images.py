"""Raw images become files that Pillow reads with the colours that were meant."""

import io

import cv2
import numpy as np
import pytest
from mcap_drives import CAMERA, Protobuf, Ros2
from PIL import Image

from contracts.errors import UnusableImage
from survey.fragments import Message, parse_fragment
from survey.mcap.contents import Stored, read_messages
from survey.mcap.messages import ImageMessage
from survey.mcap.payload import image_bytes
from survey.mcap.raw_images import as_netpbm
from survey.mcap.reader import READER
from survey.options import ReadOptions

WIDTH, HEIGHT = 8, 6
RGB = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
RGB[:, :] = (200, 120, 40)
GREY = np.arange(HEIGHT * WIDTH, dtype=np.uint8).reshape(HEIGHT, WIDTH) * 5

ENCODED = {
    "rgb8": (RGB, RGB),
    "bgr8": (RGB[:, :, ::-1], RGB),
    "8UC3": (RGB[:, :, ::-1], RGB),
    "rgba8": (np.dstack([RGB, GREY]), RGB),
    "bgra8": (np.dstack([RGB[:, :, ::-1], GREY]), RGB),
    "mono8": (GREY, GREY),
    "8UC1": (GREY, GREY),
    "mono16": (GREY.astype("<u2") * 257, GREY.astype(np.int32) * 257),
}


def opened(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)))


def message(encoding: str, data: bytes, step: int, big_endian: bool = False) -> ImageMessage:
    return ImageMessage(
        None, "cam", encoding, memoryview(data), True, WIDTH, HEIGHT, step, big_endian
    )


@pytest.mark.parametrize("encoding", sorted(ENCODED))
@pytest.mark.parametrize("padding", [0, 5])
def test_pixels_come_out_as_they_were_meant(encoding, padding):
    stored, meant = ENCODED[encoding]
    rows = stored.reshape(HEIGHT, -1).view(np.uint8)
    padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=99)
    found = opened(as_netpbm(message(encoding, padded.tobytes(), padded.shape[1])))
    np.testing.assert_array_equal(found, meant)


def test_the_byte_order_of_deep_greys_is_kept():
    stored = GREY.astype(">u2") * 257
    found = opened(as_netpbm(message("mono16", stored.tobytes(), WIDTH * 2, big_endian=True)))
    np.testing.assert_array_equal(found, GREY.astype(np.int32) * 257)


@pytest.mark.parametrize(
    ("encoding", "first", "second"),
    [("rgb", (0, 0), (1, 1)), ("bgg", (1, 1), (0, 0))],
)
def test_bayer_patterns_name_their_first_pixels(encoding, first, second):
    """`bayer_rggb`: red at the top left, blue diagonally below."""
    name = {"rgb": "bayer_rggb8", "bgg": "bayer_bggr8"}[encoding]
    mosaic = np.full((HEIGHT, WIDTH), 120, np.uint8)
    mosaic[first[0] :: 2, first[1] :: 2] = 200
    mosaic[second[0] :: 2, second[1] :: 2] = 40
    found = opened(as_netpbm(message(name, mosaic.tobytes(), WIDTH)))
    np.testing.assert_array_equal(found, RGB)
    deep = mosaic.astype("<u2") * 256
    found = opened(as_netpbm(message(name.replace("8", "16"), deep.tobytes(), WIDTH * 2)))
    np.testing.assert_array_equal(found, RGB)


@pytest.mark.parametrize(("encoding", "order"), [("uyvy", (1, 0, 3, 2)), ("yuyv", (0, 1, 2, 3))])
def test_packed_yuv_keeps_its_colours(encoding, order):
    y, cr, cb = cv2.cvtColor(RGB, cv2.COLOR_RGB2YCrCb)[0, 0].astype(float)
    # Video range of BT.601, as cameras send it: 16 to 235 and 16 to 240.
    luma = 16 + y * 219 / 255
    u, v = 128 + (cb - 128) * 224 / 255, 128 + (cr - 128) * 224 / 255
    yuyv = np.array([luma, u, luma, v])
    row = np.tile(yuyv[list(order)].round().astype(np.uint8), WIDTH // 2)
    data = np.tile(row, HEIGHT).tobytes()
    found = opened(as_netpbm(message(encoding, data, WIDTH * 2))).astype(int)
    assert np.abs(found - RGB).max() <= 4


@pytest.mark.parametrize(
    ("encoding", "data", "step", "reason"),
    [
        ("rgb8", b"\0" * 10, WIDTH * 3, "of 10 bytes, expected 144"),
        ("rgb8", b"\0" * 144, WIDTH, "rows of 8 bytes"),
        ("h264", b"\0" * 144, WIDTH, "encoding 'h264'"),
    ],
)
def test_raw_images_that_do_not_hold_are_refused(encoding, data, step, reason):
    with pytest.raises(ValueError, match=reason):
        as_netpbm(message(encoding, data, step))


@pytest.mark.parametrize("dialect", [Protobuf(), Ros2()], ids=["foxglove", "ros2"])
def test_raw_images_are_read_from_surveys_and_depths_are_not(dialect, tmp_path):
    size = (WIDTH, HEIGHT)
    said = [
        dialect.fix("/fix", 0.0, CAMERA, 2.0, 48.0, 1.0),
        dialect.raw("/c", 0.0, CAMERA, size, RGB.tobytes(), "rgb8", WIDTH * 3),
        dialect.raw("/depth", 0.0, CAMERA, size, bytes(96), "16UC1", WIDTH * 2),
        dialect.raw("/odd", 0.0, CAMERA, size, bytes(96), "nv12", WIDTH),
    ]
    dialect.write(tmp_path / "raw.mcap", said)
    reading = READER.read(tmp_path / "raw.mcap", ReadOptions(), lambda uri: True)
    (image,) = reading.images
    assert image.uri == "c/1700000000.000000000.ppm"
    assert (image.camera.width_px, image.camera.height_px) == size
    assert "raw.mcap: 1 images of topic /depth are depths, not photographs" in reading.notes
    assert "encoding 'nv12'" in reading.skipped[0].reason
    found = parse_fragment(image.fragment).message
    assert found is not None
    np.testing.assert_array_equal(opened(image_bytes(image.path, found)), RGB)


def test_a_raw_image_that_does_not_hold_is_an_unusable_image(tmp_path):
    dialect = Protobuf()
    said = [dialect.raw("/c", 0.0, CAMERA, (WIDTH, HEIGHT), b"short", "rgb8", WIDTH * 3)]
    dialect.write(tmp_path / "raw.mcap", said)
    (stored,) = read_messages(tmp_path / "raw.mcap", lambda topic: True)
    assert isinstance(stored, Stored)
    kind = "protobuf:foxglove.RawImage"
    place = Message("/c", stored.log_time_ns, stored.record, stored.offset, kind)
    with pytest.raises(UnusableImage, match="of 5 bytes, expected 144"):
        image_bytes(tmp_path / "raw.mcap", place)
