"""From the bytes of a file to upright 8-bit RGB pixels, reduced while decoding.

Pillow reads: unlike OpenCV it refuses a truncated JPEG instead of filling it with grey, it knows
a size before decoding, and it reduces a JPEG in its transform domain.
"""

import hashlib
import io
import os
import stat
import struct
import threading
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image, UnidentifiedImageError

from contracts.errors import UnusableImage

# Only raster formats: Pillow's others start programs (EPS), hold no photograph, or are obscure.
_FORMATS = ("JPEG", "PNG", "TIFF", "WEBP", "BMP", "JPEG2000", "PPM")
# What Pillow's plugins raise on damaged files; only the first is documented.
_DAMAGED = (
    OSError,
    SyntaxError,
    ValueError,
    TypeError,
    LookupError,
    EOFError,
    OverflowError,
    struct.error,
)
# Modes whose values can be averaged, unlike a palette's.
_REDUCIBLE = {"L", "LA", "RGB", "RGBA", "CMYK", "YCbCr"}
_PILLOW_GLOBALS = threading.Lock()
_MASK_MAX_PIXELS = 250_000_000
_MASKED_ABOVE = 32
"""Masks fade out over some 30 pixels: an eighth of full brightness already hides the vehicle."""

# EXIF orientation -> mirror left-right first, then quarter turns counter-clockwise.
_EXIF_TURNS = {
    1: (False, 0),
    2: (True, 0),
    3: (False, 2),
    4: (True, 2),
    5: (True, 1),
    6: (False, 3),
    7: (True, 3),
    8: (False, 1),
}


@dataclass(frozen=True, slots=True)
class DecodedImage:
    """An image ready for detection.

    rgb : (h, w, 3) uint8, upright. width_px, height_px : of the full upright image.
    scale : pixels of the full image per pixel of `rgb`. sha256 : hex, of the file's bytes.
    """

    rgb: NDArray[np.uint8]
    width_px: int
    height_px: int
    scale: float
    sha256: str


@dataclass(frozen=True, slots=True)
class ImageHeader:
    """What an image says of itself before it is decoded.

    width_px, height_px : upright, after EXIF orientation. tags, details, gps : EXIF tag number
    -> value, of the main, the Exif and the GPS directory.
    """

    width_px: int
    height_px: int
    tags: Mapping[int, object]
    details: Mapping[int, object]
    gps: Mapping[int, object]


def decode_image(
    path: str | Path,
    *,
    quarter_turns: int = 0,
    max_side_px: int = 1024,
    max_pixels: int = 250_000_000,
) -> DecodedImage:
    """Decode one image, upright and at most `max_side_px` long.

    16-bit samples are scaled to 8 bits; transparency is laid over white, as a viewer shows it;
    of several frames the first counts.

    Parameters
    ----------
    quarter_turns : counter-clockwise, after EXIF orientation.
    max_pixels : larger images are refused from their header, before their pixels are read.

    Raises
    ------
    UnusableImage : no file or not a regular one, not an image, truncated, corrupt or too large.
    """
    data = _read_file(path, max_pixels)
    with _open(io.BytesIO(data)) as image:
        mirrored, turns = _exif_turns(image)
        turns = (turns + quarter_turns) % 4
        width, height = image.size
        scale = max(1.0, max(width, height) / max_side_px)
        size = (max(1, round(width / scale)), max(1, round(height / scale)))
        rgb = _upright(_resized(_pixels(image, size, "RGB"), size), mirrored, turns)
    if turns % 2:
        width, height = height, width
    return DecodedImage(rgb, width, height, scale, hashlib.sha256(data).hexdigest())


def decode_mask(
    path: str | Path, *, quarter_turns: int, width: int, height: int
) -> NDArray[np.bool_]:
    """Where an image shows usable scenery, from its mask (bright = vehicle).

    Parameters
    ----------
    quarter_turns : counter-clockwise, those of the image the mask belongs to.
    width, height : of the decoded upright image.

    Returns
    -------
    usable : (height, width) bool. Any trace of the vehicle within a pixel hides it.

    Raises
    ------
    UnusableImage : as `decode_image`.
    """
    data = _read_file(path, _MASK_MAX_PIXELS)
    with _open(io.BytesIO(data)) as image:
        mirrored, turns = _exif_turns(image)
        grey = _upright(_pixels(image, image.size, "L"), mirrored, (turns + quarter_turns) % 4)
    return np.asarray(_resized(grey, (width, height)) < _MASKED_ABOVE)


def read_header(path: str | Path) -> ImageHeader:
    """Size and EXIF of an image, without decoding it.

    Raises
    ------
    UnusableImage : no file, not a regular one, or not an image.
    """
    with _regular_file(path) as file, _open(file) as image:
        _, turns = _exif_turns(image)
        width, height = image.size if turns % 2 == 0 else image.size[::-1]
        exif = _exif(image)
        return ImageHeader(
            width,
            height,
            tags=dict(exif),
            details=_directory(exif, ExifTags.IFD.Exif),
            gps=_directory(exif, ExifTags.IFD.GPSInfo),
        )


def _regular_file(path: str | Path) -> BinaryIO:
    """Open for reading; a pipe or device is refused instead of waited for."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise UnusableImage(f"cannot be opened: {reason}") from error
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise UnusableImage("is not a regular file")
    return os.fdopen(handle, "rb")


def _read_file(path: str | Path, max_pixels: int) -> bytes:
    """The file's bytes, once its header has shown an image of at most `max_pixels`."""
    with _regular_file(path) as file:
        with _open(file) as image:
            width, height = image.size
            if width * height > max_pixels:
                raise UnusableImage(
                    f"{width} x {height} pixels are more than max_pixels = {max_pixels}; "
                    "reduce the image or raise max_pixels"
                )
        file.seek(0)
        try:
            return file.read()
        except OSError as error:
            raise UnusableImage(f"cannot be read: {error.strerror}") from error


def _open(file: BinaryIO) -> Image.Image:
    """Read the header. Pillow's own pixel limit, a process-wide global, is lifted meanwhile."""
    with _PILLOW_GLOBALS, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        limit, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
        try:
            return Image.open(file, formats=_FORMATS)
        except UnidentifiedImageError as error:
            file.seek(0)
            what = "is not a supported image" if file.read(1) else "is empty (0 bytes)"
            raise UnusableImage(f"{what}; expected JPEG, PNG, TIFF, WebP, BMP or PPM") from error
        except _DAMAGED as error:
            raise UnusableImage(f"has a damaged header: {error}") from error
        finally:
            Image.MAX_IMAGE_PIXELS = limit


def _exif(image: Image.Image) -> Image.Exif:
    with _PILLOW_GLOBALS, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return image.getexif()
        except _DAMAGED:
            return Image.Exif()


def _directory(exif: Image.Exif, number: int) -> dict[int, object]:
    with _PILLOW_GLOBALS, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return dict(exif.get_ifd(number))
        except _DAMAGED:
            return {}


def _exif_turns(image: Image.Image) -> tuple[bool, int]:
    orientation = _exif(image).get(ExifTags.Base.Orientation, 1)
    return _EXIF_TURNS.get(orientation, (False, 0))


def _pixels(image: Image.Image, size: tuple[int, int], mode: str) -> NDArray[np.uint8]:
    """Decode, no smaller than `size` unless the image is; (h, w, 3) for RGB, (h, w) for L."""
    if image.format in {"JPEG", "MPO"}:
        image.draft(None, size)
    try:
        image.load()
        return np.asarray(_eight_bits(_reduced(image, size)).convert(mode), np.uint8)
    except _DAMAGED as error:
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
