"""Images whose names hold their pose, as visual place recognition keeps its datasets.

`@UTM_east@UTM_north@zone@letter@latitude@longitude@pano_id@tile@heading@pitch@roll@height@
timestamp@note@.jpg` (github.com/gmberton/VPR-datasets-downloader); a field may be empty. Not used:
the timestamp, which has no zone, and the height, since nobody says from what it counts. North:
true, as in the street views that these datasets are made of; `north` overrides.
"""

import os
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path, PurePath

import numpy as np

from contracts.config import North
from contracts.errors import BadSurvey
from contracts.places import Place
from contracts.records import Pose, PosedImage, Skipped
from geo.crs import ToWgs84
from survey.files import is_image_name, list_images
from survey.options import Reader, Reading, ReadOptions
from survey.poses import crs_name, finite_number, normalised, pose_problem

_N_FIELDS = 14
_NORTHERN, _SOUTHERN = "NPQRSTUVWX", "CDEFGHJKLM"
_DEGREES = "EPSG:4326"


def recognises(path: Place) -> bool:
    """A folder; the first of its folders that holds images names one like this."""
    if not isinstance(path, Path):
        return any(_fields(PurePath(name).name) is not None for name in list_images(path).paths)
    for _, folders, names in os.walk(path):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        images = [name for name in names if is_image_name(name)]
        if images:
            return any(_fields(name) is not None for name in images)
    return False


def read(path: Place, options: ReadOptions, wanted: Callable[[str], bool]) -> Reading:
    """Every image whose name holds a position; no image is opened.

    Of several UTM zones the positions are brought into longitude and latitude.

    Raises
    ------
    BadSurvey : several zones together with a `--crs` or a grid north, of which there are several.
    """
    listing = list_images(path)
    images: list[PosedImage] = []
    skipped = list(listing.skipped)
    given = None if options.crs is None else crs_name(options.crs)
    for uri, file in listing.paths.items():
        if not wanted(uri):
            continue
        pose = _pose(uri.rpartition("/")[2], options.north or "true")
        if isinstance(pose, Pose):
            images.append(PosedImage(uri, file, pose=pose))
        else:
            skipped.append(Skipped(uri, pose))
    zones = sorted({image.pose.crs for image in images if image.pose})
    if len(zones) > 1:
        _refuse_one_grid(path, zones, given, options.north)
        note = f"positions of {len(zones)} UTM zones ({', '.join(zones)}) are given in {_DEGREES}"
        return Reading(_in_degrees(images), tuple(skipped), _DEGREES, (note,))
    crs = given or (zones[0] if zones else None)
    if crs is not None:
        images = [_in_crs(image, crs) for image in images]
    return Reading(tuple(images), tuple(skipped), crs)


def _fields(name: str) -> list[str] | None:
    """The 14 fields of a name, None if it is no such name."""
    parts = [part.strip() for part in name.split("@")]
    if len(parts) != _N_FIELDS + 2 or parts[0]:
        return None
    return parts[1:-1]


def _pose(name: str, north: North) -> Pose | str:
    """The pose in a name, in the system of its UTM zone, or why there is none."""
    fields = _fields(name)
    if fields is None:
        return f"image without pose: its name is not {_N_FIELDS} fields between @"
    east, north_m, zone, letter, latitude = fields[:5]
    try:
        if not (east and north_m):
            raise ValueError("image without pose: its name has no UTM position")
        pose = Pose(
            easting=finite_number("UTM easting", east),
            northing=finite_number("UTM northing", north_m),
            crs=_zone_crs(zone, letter, latitude),
            heading_deg=finite_number("heading", fields[8]) if fields[8] else None,
            pitch_deg=finite_number("pitch", fields[9]) if fields[9] else None,
            roll_deg=finite_number("roll", fields[10]) if fields[10] else None,
            north=north,
        )
    except ValueError as error:
        return str(error)
    return pose_problem(pose, geographic=False) or normalised(pose)


def _zone_crs(zone: str, letter: str, latitude: str) -> str:
    """WGS 84 / UTM; the band's letter says which hemisphere, without one the latitude."""
    number = int(zone) if zone.isascii() and zone.isdigit() and len(zone) < 4 else 0
    if not 1 <= number <= 60:
        raise ValueError(f"UTM zone is {zone!r}, expected 1 to 60")
    north = finite_number("latitude", latitude) >= 0.0 if latitude else None
    if letter:
        if letter.upper() not in _NORTHERN + _SOUTHERN or len(letter) > 1:
            raise ValueError(f"UTM band is {letter!r}, expected a letter C to X without I and O")
        northern = letter.upper() in _NORTHERN
        if north is not None and north != northern:
            raise ValueError(f"UTM band {letter!r} and latitude {latitude} are on two hemispheres")
        north = northern
    if north is None:
        raise ValueError("neither UTM band nor latitude says which hemisphere it is")
    return f"EPSG:{326 if north else 327}{number:02d}"


def _refuse_one_grid(
    path: Place, zones: Sequence[str], given: str | None, north: North | None
) -> None:
    what = f"--crs {given}" if given is not None else "--north grid" if north == "grid" else ""
    if what:
        raise BadSurvey(
            f"survey {path}: its names are of {len(zones)} UTM zones ({', '.join(zones)}), so that "
            f"{what} does not hold for all; leave it out, or read a zone at a time"
        )


def _in_crs(image: PosedImage, crs: str) -> PosedImage:
    return image if image.pose is None else replace(image, pose=replace(image.pose, crs=crs))


def _in_degrees(images: Sequence[PosedImage]) -> tuple[PosedImage, ...]:
    of_zone: dict[str, list[int]] = defaultdict(list)
    for at, image in enumerate(images):
        if image.pose is not None:
            of_zone[image.pose.crs].append(at)
    moved = list(images)
    for crs, members in of_zone.items():
        poses = [pose for at in members if (pose := images[at].pose)]
        places = np.array([(pose.easting, pose.northing) for pose in poses], np.float64)
        lon_deg, lat_deg = ToWgs84(crs).lon_lat(*places.T)
        for at, pose, lon, lat in zip(
            members, poses, lon_deg.tolist(), lat_deg.tolist(), strict=True
        ):
            placed = replace(pose, easting=lon, northing=lat, crs=_DEGREES)
            moved[at] = replace(images[at], pose=placed)
    return tuple(moved)


READER = Reader("utm-names", recognises, read)
