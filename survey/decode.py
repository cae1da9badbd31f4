"""From the bytes of a file to upright 8-bit RGB pixels, reduced while decoding."""

import functools
import hashlib
import io
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from contracts.errors import UnusableImage
from survey.equirectangular import (
    PanoramaArea,
    panorama_width_px,
    perspective,
    view_side_px,
)
from survey.fragments import Message, View, parse_fragment
from survey.image_file import DAMAGED, image_bytes, opened
from survey.image_header import exif_turns, header_of
from survey.panorama import panorama_area
from survey.stored import State, state_of

# Modes whose values can be averaged, unlike a palette's.
_REDUCIBLE = {"L", "LA", "RGB", "RGBA", "CMYK", "YCbCr"}
_MASK_MAX_PIXELS = 250_000_000
_MASKED_ABOVE = 32
"""Masks fade out over some 30 pixels: an eighth of full brightness already hides the vehicle."""
_REMAP_MAX_PX = 32_000
"""cv2.remap takes sides below 2^15."""


@dataclass(frozen=True, slots=True)
class DecodedImage:
    """An image ready for detection.

    rgb : (h, w, 3) uint8, upright. width_px, height_px : of the full upright image.
    scale : pixels of the full image per pixel of `rgb`. sha256 : hex, of the bytes that were
    decoded: of the file or message, so that all views of a panorama have that of the panorama.
    """

    rgb: NDArray[np.uint8]
    width_px: int
    height_px: int
    scale: float
    sha256: str


def decode_image(
    path: str | Path,
    *,
    fragment: str = "",
    quarter_turns: int = 0,
    max_side_px: int = 1024,
    max_pixels: int = 250_000_000,
) -> DecodedImage:
    """Decode one image, upright and at most `max_side_px` long.

    16-bit samples are scaled to 8 bits; transparency is laid over white, as a viewer shows it;
    of several frames the first counts. A view of a panorama is as fine in its middle as the
    panorama; the panorama is decoded no finer than the view is wanted, and kept until another is
    asked for.

    Parameters
    ----------
    fragment : which message or view is meant, as in `contracts.records.PosedImage`.
    quarter_turns : counter-clockwise, after EXIF orientation; of a view's panorama, before.
    max_pixels : larger images are refused from their header, before their pixels are read.

    Raises
    ------
    UnusableImage : no file or not a regular one, not an image, truncated, corrupt or too large;
        no such message; a view of what is no panorama.
    """
    part = parse_fragment(fragment)
    if part.view is not None:
        return _view(str(path), part.message, part.view, quarter_turns, max_side_px, max_pixels)
    data = image_bytes(path, part.message, max_pixels)
    with opened(io.BytesIO(data)) as image:
        mirrored, turns = exif_turns(image)
        turns = (turns + quarter_turns) % 4
        width, height = image.size
        scale = max(1.0, max(width, height) / max_side_px)
        size = (max(1, round(width / scale)), max(1, round(height / scale)))
        rgb = _upright(_resized(_pixels(image, size, "RGB"), size), mirrored, turns)
    if turns % 2:
        width, height = height, width
    return DecodedImage(rgb, width, height, scale, hashlib.sha256(data).hexdigest())


def decode_mask(
    path: str | Path, *, fragment: str = "", quarter_turns: int, width: int, height: int
) -> NDArray[np.bool_]:
    """Where an image shows usable scenery, from its mask (bright = vehicle).

    Parameters
    ----------
    fragment : that of the image. A message has a mask file of its own; a view is cut from the
        mask of its panorama, which shows the whole sphere unless its own GPano says otherwise.
    quarter_turns : counter-clockwise, those of the image the mask belongs to.
    width, height : of the decoded upright image.

    Returns
    -------
    usable : (height, width) bool. Any trace of the vehicle within a pixel hides it.

    Raises
    ------
    UnusableImage : as `decode_image`.
    """
    view = parse_fragment(fragment).view
    data = image_bytes(path, None, _MASK_MAX_PIXELS)
    with opened(io.BytesIO(data)) as image:
        mirrored, turns = exif_turns(image)
        grey = _upright(_pixels(image, image.size, "L"), mirrored, (turns + quarter_turns) % 4)
        if view is None:
            return np.asarray(_resized(grey, (width, height)) < _MASKED_ABOVE)
        area = panorama_area(header_of(image)) or PanoramaArea()
    fine = round(panorama_width_px(width, area, view.fov_deg))
    size = (
        min(fine, _REMAP_MAX_PX),
        min(max(1, round(fine * len(grey) / grey.shape[1])), _REMAP_MAX_PX),
    )
    return np.asarray(perspective(_resized(grey, size), area, view, width) < _MASKED_ABOVE)


@dataclass(frozen=True, slots=True)
class _Panorama:
    """A panorama, upright and reduced. full_width_px : before that; rgb is not to be written."""

    rgb: NDArray[np.uint8]
    area: PanoramaArea
    full_width_px: int
    sha256: str


def _view(
    path: str,
    message: Message | None,
    view: View,
    quarter_turns: int,
    max_side_px: int,
    max_pixels: int,
) -> DecodedImage:
    try:
        version = state_of(path)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise UnusableImage(f"cannot be opened: {reason}") from error
    panorama = _panorama(
        path, version, message, quarter_turns, view.fov_deg, max_side_px, max_pixels
    )
    side = view_side_px(panorama.full_width_px, panorama.area, view.fov_deg)
    scale = max(1.0, side / max_side_px)
    rgb = perspective(panorama.rgb, panorama.area, view, max(1, round(side / scale)))
    return DecodedImage(rgb, side, side, scale, panorama.sha256)


@functools.lru_cache(maxsize=1)
def _panorama(
    path: str,
    version: State,
    message: Message | None,
    quarter_turns: int,
    fov_deg: float,
    max_side_px: int,
    max_pixels: int,
) -> _Panorama:
    """The panorama, as fine as views of at most `max_side_px` need it; its views come in a row.

    version : of the file, so that a changed one is read again.
    """
    del version
    data = image_bytes(path, message, max_pixels)
    with opened(io.BytesIO(data)) as image:
        area = panorama_area(header_of(image)) or PanoramaArea()
        mirrored, turns = exif_turns(image)
        turns = (turns + quarter_turns) % 4
        full = image.height if turns % 2 else image.width
        fine = panorama_width_px(max_side_px, area, fov_deg)
        share = min(1.0, fine / full, _REMAP_MAX_PX / max(image.size))
        size = (max(1, round(image.width * share)), max(1, round(image.height * share)))
        rgb = _upright(_resized(_pixels(image, size, "RGB"), size), mirrored, turns)
    rgb.setflags(write=False)
    return _Panorama(rgb, area, full, hashlib.sha256(data).hexdigest())


def _pixels(image: Image.Image, size: tuple[int, int], mode: str) -> NDArray[np.uint8]:
    """Decode, no smaller than `size` unless the image is; (h, w, 3) for RGB, (h, w) for L."""
    if image.format in {"JPEG", "MPO"}:
        image.draft(None, size)
    try:
        image.load()
        return np.asarray(_eight_bits(_reduced(image, size)).convert(mode), np.uint8)
    except DAMAGED as error:
        raise UnusableImage(f"is truncated or damaged: {error}") from error


def _reduced(image: Image.Image, size: tuple[int, int]) -> Image.Image:
    """Means of whole blocks of pixels, before anything makes a second copy of a large picture."""
    factor = min(image.width // size[0], image.height // size[1])
    return image.reduce(factor) if factor > 1 and image.mode in _REDUCIBLE else image


def _eight_bits(image: Image.Image) -> Image.Image:
    """The same picture with opaque 8-bit samples."""
    if image.mode.startswith("I") or image.mode == "F":
        return Image.fromarray(_scaled_samples(image))
    if image.has_transparency_data:
        over = image.convert("RGBA")
        white = Image.new("RGBA", over.size, "white")
        return Image.alpha_composite(white, over)
    return image


def _scaled_samples(image: Image.Image) -> NDArray[np.uint8]:
    samples = np.asarray(image)
    if samples.dtype.kind == "f" or samples.min() < 0 or samples.max() > 65_535:
        raise UnusableImage(
            f"has {samples.dtype} samples from {samples.min()} to {samples.max()}, expected 8 or "
            "16 bits; convert it"
        )
    return np.asarray((samples.astype(np.uint32) + 128) // 257, np.uint8)


def _resized(pixels: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    if (pixels.shape[1], pixels.shape[0]) == size:
        return pixels
    return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)


def _upright(pixels: NDArray[np.uint8], mirrored: bool, turns: int) -> NDArray[np.uint8]:
    if mirrored:
        pixels = pixels[:, ::-1]
    return np.ascontiguousarray(np.rot90(pixels, turns))
