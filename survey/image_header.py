"""What an image says of itself before it is decoded: its size, its EXIF and its XMP."""

import io
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from PIL import ExifTags, Image

from survey.fragments import parse_fragment
from survey.image_file import DAMAGED, image_bytes, opened, quietly, regular_file
from survey.xmp import Properties, xmp_properties

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
class ImageHeader:
    """What an image says of itself before it is decoded.

    width_px, height_px : upright, after EXIF orientation. tags, details, gps : EXIF tag number
    -> value, of the main, the Exif and the GPS directory. xmp : properties of its XMP packet;
    xmp_problem : why they could not be read, or "".
    """

    width_px: int
    height_px: int
    tags: Mapping[int, object]
    details: Mapping[int, object]
    gps: Mapping[int, object]
    xmp: Properties
    xmp_problem: str


def read_header(path: str | Path, fragment: str = "") -> ImageHeader:
    """Size, EXIF and XMP of an image file or a message, without decoding it.

    Raises
    ------
    UnusableImage : no file, not a regular one, no such message, or not an image.
    """
    message = parse_fragment(fragment).message
    if message is not None:
        data = image_bytes(path, message, max_pixels=sys.maxsize)
        with opened(io.BytesIO(data)) as image:
            return header_of(image)
    with regular_file(path) as file, opened(file) as image:
        return header_of(image)


def header_of(image: Image.Image) -> ImageHeader:
    """The header of an image that Pillow has opened."""
    _, turns = exif_turns(image)
    width, height = image.size if turns % 2 == 0 else image.size[::-1]
    exif = _exif(image)
    xmp, problem = _xmp(image)
    return ImageHeader(
        width,
        height,
        tags=_directory(lambda: exif),
        details=_directory(lambda: exif.get_ifd(ExifTags.IFD.Exif)),
        gps=_directory(lambda: exif.get_ifd(ExifTags.IFD.GPSInfo)),
        xmp=xmp,
        xmp_problem=problem,
    )


def exif_turns(image: Image.Image) -> tuple[bool, int]:
    """Whether to mirror left-right, then how many quarter turns counter-clockwise.

    Nothing for HEIC: its decoder turns the picture and takes the tag out.
    """
    exif = _exif(image)
    try:
        orientation = quietly(lambda: exif.get(ExifTags.Base.Orientation, 1))
    except DAMAGED:
        orientation = 1
    return _EXIF_TURNS.get(orientation, (False, 0))


def _exif(image: Image.Image) -> Image.Exif:
    try:
        return quietly(image.getexif)
    except DAMAGED:
        return Image.Exif()


def _directory(look: Callable[[], Mapping[int, object]]) -> dict[int, object]:
    """A directory's tags, none where it is damaged; Pillow looks into each as it is asked for."""
    try:
        return quietly(lambda: dict(look()))
    except DAMAGED:
        return {}


def _xmp(image: Image.Image) -> tuple[Properties, str]:
    packet = image.info.get("xmp")
    if not isinstance(packet, bytes) or not packet:
        return {}, ""
    try:
        return xmp_properties(packet), ""
    except ValueError as error:
        return {}, str(error)
