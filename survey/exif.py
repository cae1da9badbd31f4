"""A folder of photographs whose EXIF and XMP say where they were taken and where they look.

North: `GPSImgDirectionRef` says true or magnetic, image by image; where it is missing, true, as in
XMP. Heights: above the ellipsoid where all photographs say so (EXIF 3.0), else from a level that
is not known, since most cameras write sea level of some kind and many the ellipsoid.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from numbers import Rational

from PIL import ExifTags

from contracts.config import North
from contracts.errors import BadSurvey, UnusableImage
from contracts.places import Place
from contracts.records import Camera, Pose, PosedImage, Skipped
from survey.equirectangular import PanoramaArea
from survey.files import list_images
from survey.image_header import ImageHeader, read_header
from survey.mcap.listing import mcap_files
from survey.options import Reader, Reading, ReadOptions
from survey.panorama import panorama_area
from survey.poses import normalised, on_null_island, pose_problem
from survey.tables.reader import untaken_tables
from survey.times import zoned_time
from survey.xmp import stated_angles

CRS = "EPSG:4326"
CRS_WITH_ELLIPSOIDAL_HEIGHT = "EPSG:4979"
_FILM_DIAGONAL_MM = math.hypot(36.0, 24.0)
_NO_GPS = "no GPS position in its EXIF"

_Tags = Mapping[int, object]


def recognises(path: Place) -> bool:
    """Any folder: whether its images have positions is known once they have been opened."""
    return path.is_dir()


def read(path: Place, options: ReadOptions, wanted: Callable[[str], bool]) -> Reading:
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
    unread: list[str] = []
    ellipsoidal: list[bool] = []
    for uri, file in listing.paths.items():
        if not wanted(uri):
            continue
        try:
            header = read_header(file)
        except UnusableImage as error:
            skipped.append(Skipped(uri, str(error)))
            continue
        if header.xmp_problem:
            unread.append(f"{uri}: {header.xmp_problem}")
        image = _posed(uri, file, header, options.north)
        if isinstance(image, PosedImage):
            images.append(image)
            if image.pose is not None and image.pose.altitude_m is not None:
                ellipsoidal.append(_above_ellipsoid(header))
        else:
            skipped.append(image)
            without += image.reason.startswith(_NO_GPS)
    if without and not images:
        raise BadSurvey(
            f"{path}: none of its {without} images has a pose: no Stereopolis metadata, no pose "
            "table (CSV with a file column and coordinates), no GPS in EXIF. Add a pose table, "
            "or index without positions: --no-pose" + untaken_tables(path) + _untaken_mcap(path)
        )
    crs = CRS_WITH_ELLIPSOIDAL_HEIGHT if ellipsoidal and all(ellipsoidal) else CRS
    notes = (
        (f"XMP of {len(unread)} images is left out; the first is {unread[0]}",) if unread else ()
    )
    return Reading(tuple(_in_crs(image, crs) for image in images), tuple(skipped), crs, notes)


def _untaken_mcap(path: Place) -> str:
    names = list(mcap_files(path)[0])
    return f"; {names[0]} is there: --format mcap reads the images in it instead" if names else ""


def _in_crs(image: PosedImage, crs: str) -> PosedImage:
    return image if image.pose is None else replace(image, pose=replace(image.pose, crs=crs))


def _posed(uri: str, file: str, header: ImageHeader, north: North | None) -> PosedImage | Skipped:
    area = _panorama_area(header)
    pose = _pose(header, north, is_panorama=area is not None)
    if isinstance(pose, str):
        return Skipped(uri, pose)
    camera = Camera(
        name=_text(header.tags.get(ExifTags.Base.Model)),
        hfov_deg=_hfov_deg(header) if area is None else 360.0 * area.width,
        width_px=header.width_px,
        height_px=header.height_px,
    )
    return PosedImage(uri, file, pose=pose, camera=camera, captured_at=_captured_at(header))


def _panorama_area(header: ImageHeader) -> PanoramaArea | None:
    """Why a panorama cannot be cut is told where it is to be cut."""
    try:
        return panorama_area(header)
    except UnusableImage:
        return None


def _pose(header: ImageHeader, north: North | None, *, is_panorama: bool) -> Pose | str:
    """The pose, or why there is none."""
    gps = header.gps
    lon = _coordinate(gps, ExifTags.GPS.GPSLongitude, ExifTags.GPS.GPSLongitudeRef, "EW")
    lat = _coordinate(gps, ExifTags.GPS.GPSLatitude, ExifTags.GPS.GPSLatitudeRef, "NS")
    if lon is None or lat is None:
        return _NO_GPS
    if on_null_island(lon, lat):
        return f"GPS position ({lon:g}, {lat:g}) is what cameras write without a fix"
    angles = stated_angles(header.xmp)
    heading, stated = _heading(gps, angles.heading_deg, xmp_first=is_panorama)
    pose = Pose(
        easting=lon,
        northing=lat,
        crs=CRS,
        altitude_m=_altitude_m(gps),
        heading_deg=heading,
        pitch_deg=angles.pitch_deg,
        roll_deg=angles.roll_deg,
        north=north or stated,
        position_error_m=_position_error_m(gps),
    )
    return pose_problem(pose, geographic=True) or normalised(pose)


def _heading(gps: _Tags, in_xmp: float | None, *, xmp_first: bool) -> tuple[float | None, North]:
    """Heading and its north. EXIF says where the camera pointed, GPano the panorama's middle."""
    direction = _known(gps.get(ExifTags.GPS.GPSImgDirection))
    if in_xmp is not None and (xmp_first or direction is None):
        return in_xmp, "true"
    magnetic = _text(gps.get(ExifTags.GPS.GPSImgDirectionRef)).upper() == "M"
    return direction, "magnetic" if magnetic else "true"


def _position_error_m(gps: _Tags) -> float | None:
    error = _known(gps.get(ExifTags.GPS.GPSHPositioningError))
    return error if error is not None and error > 0.0 else None


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
    """Signed: references 1 and 3 are below their level."""
    altitude = _known(gps.get(ExifTags.GPS.GPSAltitude))
    below = _reference(gps) in (1, 3)
    return -altitude if altitude is not None and below else altitude


def _reference(gps: _Tags) -> object:
    reference = gps.get(ExifTags.GPS.GPSAltitudeRef)
    return reference[0] if isinstance(reference, bytes) and len(reference) == 1 else reference


def _above_ellipsoid(header: ImageHeader) -> bool:
    """Whether the altitude counts from the ellipsoid.

    EXIF 3.0 made that the meaning of references 0 and 1, which had been sea level until then,
    and added 2 and 3 for sea level.
    """
    version = header.details.get(ExifTags.Base.ExifVersion)
    return (
        isinstance(version, bytes)
        and version.isdigit()
        and version >= b"0300"
        and _reference(header.gps) in (0, 1)
    )


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
    details = header.details
    date, _, clock = _text(details.get(ExifTags.Base.DateTimeOriginal)).partition(" ")
    fraction = _text(details.get(ExifTags.Base.SubsecTimeOriginal))
    if fraction.isdecimal():
        clock += f".{fraction[:6]:0<6}"
    zone = _text(details.get(ExifTags.Base.OffsetTimeOriginal)) or _text(
        details.get(ExifTags.Base.OffsetTime)
    )
    if zone and (moment := zoned_time(f"{date.replace(':', '-')}T{clock}{zone}")):
        return moment
    day = _text(header.gps.get(ExifTags.GPS.GPSDateStamp)).replace(":", "-")
    stamp = header.gps.get(ExifTags.GPS.GPSTimeStamp)
    parts = [_known(part) for part in stamp] if isinstance(stamp, tuple) else []
    known = [part for part in parts if part is not None]
    if len(known) != 3:
        return None
    hour, minute, second = int(known[0]), int(known[1]), int(known[2] * 1000.0) / 1000.0
    return zoned_time(f"{day}T{hour:02d}:{minute:02d}:{second:06.3f}Z")


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
