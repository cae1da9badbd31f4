"""Opening the file of an image: its bytes, and Pillow's look at its header.

Pillow reads: unlike OpenCV it refuses a truncated JPEG instead of filling it with grey, it knows
a size before decoding, and it reduces a JPEG in its transform domain. HEIC and HEIF come through
pi-heif, a Pillow plugin with a decoder only.
"""

import io
import os
import stat
import struct
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, TypeVar

import pi_heif
from PIL import Image, UnidentifiedImageError

from contracts.errors import UnusableImage
from contracts.places import is_url
from survey.fragments import Message
from survey.stored import open_object

# Only raster formats: Pillow's others start programs (EPS), hold no photograph, or are obscure.
_FORMATS = ("JPEG", "PNG", "TIFF", "WEBP", "BMP", "JPEG2000", "PPM", "HEIF")
# What Pillow's plugins raise on damaged files; only the first is documented.
DAMAGED = (
    OSError,
    SyntaxError,
    ValueError,
    TypeError,
    LookupError,
    EOFError,
    OverflowError,
    RuntimeError,
    struct.error,
)
_PILLOW_GLOBALS = threading.Lock()
_Result = TypeVar("_Result")

# A worker has one thread an image; thumbnails and depth maps are other pictures.
pi_heif.register_heif_opener(thumbnails=False, depth_images=False, decode_threads=1)


MAX_OBJECT_BYTES = 1 << 30
"""Of an image in a store, which is read as a whole before its header is looked at."""


def regular_file(path: str | Path) -> BinaryIO:
    """Open for reading a file, or an object by its URL; a pipe or device is not waited for.

    Raises
    ------
    UnusableImage : no file, not a regular one, or one that may not be read; no such object.
    TaskFailed : the store does not answer, or not to us: that is not the image's fault.
    """
    try:
        if is_url(str(path)):
            return open_object(str(path))
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        raise UnusableImage(f"cannot be opened: {reason}") from error
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise UnusableImage("is not a regular file")
    return os.fdopen(handle, "rb")


def _whole_object(path: str) -> BinaryIO:
    """All of an object at once: asking for its header first would only cost time."""
    with regular_file(path) as file:
        size = file.seek(0, os.SEEK_END)
        if size > MAX_OBJECT_BYTES:
            raise UnusableImage(
                f"is {size} bytes large, more than the {MAX_OBJECT_BYTES} of an image"
            )
        file.seek(0)
        return io.BytesIO(file.read())


def image_bytes(path: str | Path, message: Message | None, max_pixels: int) -> bytes:
    """An image as it is stored: a whole file, or a message of an MCAP file.

    Read only once its header has shown an image of at most `max_pixels`.

    Raises
    ------
    UnusableImage : as `regular_file` and `opened`, no such message, too many pixels, or an object
        larger than `MAX_OBJECT_BYTES`.
    TaskFailed : as `regular_file`.
    """
    if message is not None:
        from survey.mcap.payload import image_bytes as message_bytes

        data = message_bytes(path, message)
        with opened(io.BytesIO(data)) as image:
            _check_size(image, max_pixels)
        return data
    with _whole_object(str(path)) if is_url(str(path)) else regular_file(path) as file:
        with opened(file) as image:
            _check_size(image, max_pixels)
        file.seek(0)
        try:
            return file.read()
        except OSError as error:
            raise UnusableImage(f"cannot be read: {error.strerror}") from error


def _check_size(image: Image.Image, max_pixels: int) -> None:
    """Raises UnusableImage where the header states more than `max_pixels`."""
    width, height = image.size
    if width * height > max_pixels:
        raise UnusableImage(
            f"{width} x {height} pixels are more than max_pixels = {max_pixels}; "
            "reduce the image or raise max_pixels"
        )


def opened(file: BinaryIO) -> Image.Image:
    """Read the header. Pillow's own pixel limit, a process-wide global, is lifted meanwhile.

    Raises
    ------
    UnusableImage : empty, not an image of a known format, or its header is damaged.
    """

    def lift_limit_and_open() -> Image.Image:
        limit, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
        try:
            return Image.open(file, formats=_FORMATS)
        except UnidentifiedImageError as error:
            file.seek(0)
            what = "is not a supported image" if file.read(1) else "is empty (0 bytes)"
            raise UnusableImage(
                f"{what}; expected JPEG, PNG, TIFF, WebP, HEIC, BMP or PPM"
            ) from error
        except DAMAGED as error:
            raise UnusableImage(f"has a damaged header: {error}") from error
        finally:
            Image.MAX_IMAGE_PIXELS = limit

    return quietly(lift_limit_and_open)


def quietly(look: Callable[[], _Result]) -> _Result:
    """Call `look` while Pillow's warnings, which are process-wide, are ignored."""
    with _PILLOW_GLOBALS, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return look()
