"""A folder of photographs whose EXIF says where they were taken.

North: `GPSImgDirectionRef` says true or magnetic, image by image; where it is missing, true.
"""

import math
from collections.abc import Callable, Mapping
from numbers import Rational
from pathlib import Path

from PIL import ExifTags

from contracts.config import North
from contracts.errors import BadSurvey, UnusableImage
from contracts.records import Camera, Pose, PosedImage, Skipped
from survey.decode import ImageHeader, read_header
from survey.files import list_images
from survey.options import Reader, Reading, ReadOptions
from survey.poses import normalised, on_null_island, pose_problem
from survey.times import zoned_time

CRS = "EPSG:4326"
_FILM_DIAGONAL_MM = math.hypot(36.0, 24.0)
_NO_GPS = "no GPS position in its EXIF"

_Tags = Mapping[int, object]


def recognises(path: Path) -> bool:
    """Any folder: whether its images have positions is known once they have been opened."""
    return path.is_dir()


def read(path: Path, options: ReadOptions, wanted: Callable[[str], bool]) -> Reading:
    """Every image with a GPS position; opens the header of each.

    Raises
    ------
    BadSurvey : images, but not one with a position.
    """
    if not path.is_dir():
        raise BadSurvey(f"{path} is not a folder; the exif format reads a folder of photographs")
    listing = list_images(path)
    images: list[PosedImage] = []
    skipped = list(listing.skipped)
    without = 0
    for uri, file in listing.paths.items():
        if not wanted(uri):
            continue
        image = _posed(uri, file, options.north)
        if isinstance(image, PosedImage):
            images.append(image)
        else:
            skipped.append(image)
            without += image.reason.startswith(_NO_GPS)
    if without and not images:
        raise BadSurvey(
            f"{path}: none of its {without} images has a pose: no Stereopolis metadata, no pose "
            "table (CSV with a file column and coordinates), no GPS in EXIF. Add a pose table, "
            "or index without positions: --no-pose"
        )
    return Reading(tuple(images), tuple(skipped), CRS)


def _posed(uri: str, file: str, north: North | None) -> PosedImage | Skipped:
    try:
        header = read_header(file)
    except UnusableImage as error:
        return Skipped(uri, str(error))
    pose = _pose(header.gps, north)
    if isinstance(pose, str):
        return Skipped(uri, pose)
    camera = Camera(
        name=_text(header.tags.get(ExifTags.Base.Model)),
        hfov_deg=_hfov_deg(header),
        width_px=header.width_px,
        height_px=header.height_px,
    )
    return PosedImage(uri, file, pose, camera, _captured_at(header))


def _pose(gps: _Tags, north: North | None) -> Pose | str:
    """The pose, or why there is none."""
    lon = _coordinate(gps, ExifTags.GPS.GPSLongitude, ExifTags.GPS.GPSLongitudeRef, "EW")
    lat = _coordinate(gps, ExifTags.GPS.GPSLatitude, ExifTags.GPS.GPSLatitudeRef, "NS")
    if lon is None or lat is None:
        return _NO_GPS
    if on_null_island(lon, lat):
        return f"GPS position ({lon:g}, {lat:g}) is what cameras write without a fix"
    magnetic = _text(gps.get(ExifTags.GPS.GPSImgDirectionRef)).upper() == "M"
    stated: North = "magnetic" if magnetic else "true"
    pose = Pose(
        easting=lon,
        northing=lat,
        crs=CRS,
        altitude_m=_altitude_m(gps),
        heading_deg=_known(gps.get(ExifTags.GPS.GPSImgDirection)),
        north=north or stated,
    )
    return pose_problem(pose, geographic=True) or normalised(pose)


def _coordinate(gps: _Tags, value_tag: int, side_tag: int, sides: str) -> float | None:
    """Signed degrees, NaN if the numbers mean nothing, None if any part is missing."""
    value, side = gps.get(value_tag), _text(gps.get(side_tag)).upper()
    if not isinstance(value, tuple) or not value or side not in tuple(sides):
        return None
    parts = [_number(part) for part in value[:3]]
    if any(part is None for part in parts):
        return math.nan
    degrees = sum(part / 60.0**at for at, part in enumerate(parts) if part is not None)
    return degrees if side == sides[0] else -degrees


def _altitude_m(gps: _Tags) -> float | None:
    altitude = _known(gps.get(ExifTags.GPS.GPSAltitude))
    below = gps.get(ExifTags.GPS.GPSAltitudeRef) in (1, b"\x01")
    return -altitude if altitude is not None and below else altitude


def _hfov_deg(header: ImageHeader) -> float | None:
    """From the 35 mm equivalent focal length, which CIPA DCG-001 defines by the diagonal."""
    focal_mm = _known(header.details.get(ExifTags.Base.FocalLengthIn35mmFilm))
    if focal_mm is None or not focal_mm > 0.0:
        return None
    diagonal_px = math.hypot(header.width_px, header.height_px)
    half_width_mm = _FILM_DIAGONAL_MM / 2 * header.width_px / diagonal_px
    return 2.0 * math.degrees(math.atan(half_width_mm / focal_mm))


def _captured_at(header: ImageHeader) -> str | None:
    """The camera's clock if its zone is known, else the GPS clock, which is UTC."""
    date, _, clock = _text(header.details.get(ExifTags.Base.DateTimeOriginal)).partition(" ")
    zone = _text(header.details.get(ExifTags.Base.OffsetTimeOriginal)) or _text(
        header.details.get(ExifTags.Base.OffsetTime)
    )
    if zone and (moment := zoned_time(f"{date.replace(':', '-')}T{clock}{zone}")):
        return moment
    day = _text(header.gps.get(ExifTags.GPS.GPSDateStamp)).replace(":", "-")
    stamp = header.gps.get(ExifTags.GPS.GPSTimeStamp)
    parts = [_known(part) for part in stamp] if isinstance(stamp, tuple) else []
    known = [int(part) for part in parts if part is not None]
    if len(known) != 3:
        return None
    hour, minute, second = known
    return zoned_time(f"{day}T{hour:02d}:{minute:02d}:{second:02d}Z")


def _number(value: object) -> float | None:
    """A float, None if the tag is missing or no number; a rational over zero is NaN."""
    if not isinstance(value, int | float | Rational):
        return None
    return float(value)


def _known(value: object) -> float | None:
    """A finite number or None: cameras write 0/0 for what they do not know."""
    number = _number(value)
    return number if number is not None and math.isfinite(number) else None


def _text(value: object) -> str:
    return value.strip("\0 ") if isinstance(value, str) else ""


READER = Reader("exif", recognises, read)
