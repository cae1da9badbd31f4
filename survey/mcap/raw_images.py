"""Raw images of ROS and Foxglove as image files that every decoder reads.

The encodings are those of ROS (sensor_msgs/image_encodings.hpp), which Foxglove shares. 8-bit
colours of unstated order (8UC3, 8UC4) are taken as OpenCV keeps them, blue first.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from survey.mcap.messages import ImageMessage

DEPTHS = frozenset({"16uc1", "16sc1", "32fc1", "64fc1"})
"""Encodings of distances, not of light: no photographs."""


@dataclass(frozen=True, slots=True)
class _Layout:
    """How pixels are stored. channels : samples a pixel; with `colour`, OpenCV's way to RGB."""

    dtype: type[np.uint8] | type[np.uint16]
    channels: int
    colour: int | None = None


_LAYOUTS: Mapping[str, _Layout] = {
    "rgb8": _Layout(np.uint8, 3),
    "bgr8": _Layout(np.uint8, 3, cv2.COLOR_BGR2RGB),
    "8uc3": _Layout(np.uint8, 3, cv2.COLOR_BGR2RGB),
    "rgba8": _Layout(np.uint8, 4, cv2.COLOR_RGBA2RGB),
    "bgra8": _Layout(np.uint8, 4, cv2.COLOR_BGRA2RGB),
    "8uc4": _Layout(np.uint8, 4, cv2.COLOR_BGRA2RGB),
    "mono8": _Layout(np.uint8, 1),
    "8uc1": _Layout(np.uint8, 1),
    "mono16": _Layout(np.uint16, 1),
    "uyvy": _Layout(np.uint8, 2, cv2.COLOR_YUV2RGB_UYVY),
    "yuv422": _Layout(np.uint8, 2, cv2.COLOR_YUV2RGB_UYVY),
    "yuyv": _Layout(np.uint8, 2, cv2.COLOR_YUV2RGB_YUYV),
    "yuv422_yuy2": _Layout(np.uint8, 2, cv2.COLOR_YUV2RGB_YUYV),
    "bayer_rggb8": _Layout(np.uint8, 1, cv2.COLOR_BayerRGGB2RGB),
    "bayer_bggr8": _Layout(np.uint8, 1, cv2.COLOR_BayerBGGR2RGB),
    "bayer_gbrg8": _Layout(np.uint8, 1, cv2.COLOR_BayerGBRG2RGB),
    "bayer_grbg8": _Layout(np.uint8, 1, cv2.COLOR_BayerGRBG2RGB),
    "bayer_rggb16": _Layout(np.uint16, 1, cv2.COLOR_BayerRGGB2RGB),
    "bayer_bggr16": _Layout(np.uint16, 1, cv2.COLOR_BayerBGGR2RGB),
    "bayer_gbrg16": _Layout(np.uint16, 1, cv2.COLOR_BayerGBRG2RGB),
    "bayer_grbg16": _Layout(np.uint16, 1, cv2.COLOR_BayerGRBG2RGB),
}


def problem(image: ImageMessage) -> str | None:
    """Why a raw image cannot be used, or None."""
    layout = _LAYOUTS.get(image.encoding.lower())
    if layout is None:
        known = ", ".join(_LAYOUTS)
        return f"raw image with encoding {image.encoding[:40]!r}, expected one of {known}"
    row = image.width_px * layout.channels * np.dtype(layout.dtype).itemsize
    if image.width_px == 0 or image.height_px == 0:
        return f"raw image of {image.width_px} x {image.height_px} pixels"
    if image.step_bytes < row:
        return f"raw image with rows of {image.step_bytes} bytes, expected at least {row}"
    needed = image.step_bytes * (image.height_px - 1) + row
    if len(image.data) < needed:
        return f"raw image of {len(image.data)} bytes, expected {needed}"
    return None


def as_netpbm(image: ImageMessage) -> bytes:
    """A raw image as PPM (colour) or PGM (grey); 16-bit greys stay 16-bit, all else is 8-bit.

    Raises
    ------
    ValueError : unknown encoding, or fewer bytes than its size needs.
    """
    if (reason := problem(image)) is not None:
        raise ValueError(reason)
    layout = _LAYOUTS[image.encoding.lower()]
    pixels = _samples(image, layout)
    if layout.colour is not None:
        if pixels.dtype == np.uint16:
            pixels = (pixels >> 8).astype(np.uint8)
        try:
            pixels = np.asarray(cv2.cvtColor(pixels, layout.colour), np.uint8)
        except cv2.error as error:
            raise ValueError(f"{image.encoding} pixels cannot be converted: {error}") from error
    height, width = pixels.shape[:2]
    grey = pixels.ndim == 2 or pixels.shape[2] == 1
    deepest = np.iinfo(pixels.dtype).max
    header = f"{'P5' if grey else 'P6'}\n{width} {height}\n{deepest}\n".encode()
    return header + pixels.astype(pixels.dtype.newbyteorder(">"), copy=False).tobytes()


def _samples(image: ImageMessage, layout: _Layout) -> NDArray[np.uint8 | np.uint16]:
    """(height, width, channels), native byte order."""
    dtype = np.dtype(layout.dtype).newbyteorder(">" if image.big_endian else "<")
    rows = np.ndarray(
        (image.height_px, image.width_px, layout.channels),
        dtype,
        buffer=image.data,
        strides=(image.step_bytes, layout.channels * dtype.itemsize, dtype.itemsize),
    )
    return rows.astype(layout.dtype, copy=False)
