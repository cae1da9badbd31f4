"""A Stereopolis survey by IGN: `panoramicsMetaData.json`, `cameraCalibration.json`, images.

Coordinates are Lambert-93 (EPSG:2154) in metres, by definition of the format. Headings count from
true north: docs/decisions/0003-stereopolis-north.md.
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contracts.config import North
from contracts.errors import BadSurvey
from contracts.places import Place
from contracts.records import Camera, Pose, PosedImage, Skipped
from geo.attitude import Attitude, camera_attitude, enu_from_frd
from geo.crs import grid_of
from survey.files import Listing, list_images, printable_uri
from survey.options import Reader, Reading, ReadOptions
from survey.poses import pose_problem
from survey.stereopolis_rig import RigCamera, read_json_list, read_rig
from survey.times import zoned_time

PANORAMAS = "panoramicsMetaData.json"
CALIBRATION = "cameraCalibration.json"
CRS = "EPSG:2154"
NORTH: North = "true"

_NAME = re.compile(r".+-(?P<camera>\d+)-\d+_(?P<panorama>\d+)\.jpe?g", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class _Panorama:
    """Where the vehicle was and how it stood at one release of all its cameras."""

    number: int
    easting: float
    northing: float
    altitude_m: float
    attitude: Attitude
    captured_at: str | None


@dataclass(frozen=True, slots=True)
class _Shot:
    """One image: the camera that took it and the panorama it belongs to."""

    camera: RigCamera
    panorama: _Panorama


def recognises(path: Place) -> bool:
    """A folder with both metadata files."""
    return (path / PANORAMAS).is_file() and (path / CALIBRATION).is_file()


def read(path: Place, options: ReadOptions, wanted: Callable[[str], bool]) -> Reading:
    """Every image with the pose of its camera; no image is opened.

    Raises
    ------
    BadSurvey : metadata missing or broken.
    """
    del wanted
    rig = read_rig(path / CALIBRATION)
    panoramas, skipped = _read_panoramas(path / PANORAMAS)
    listing = list_images(path)
    skipped.extend(listing.skipped)
    masks = {printable_uri(camera.mask) for camera in rig.values() if camera.mask}
    if options.use_masks:
        _require(masks, listing, path)
    images: list[PosedImage] = []
    seen: set[int] = set()
    for uri in listing.paths.keys() - masks:
        name = _NAME.fullmatch(uri.rpartition("/")[2])
        found = _shot(name, rig, panoramas)
        if name is not None:
            seen.add(int(name["panorama"]))
        image = found if isinstance(found, str) else _posed(uri, found, listing, options)
        if isinstance(image, str):
            skipped.append(Skipped(uri, image))
        else:
            images.append(image)
    skipped += [
        Skipped(f"{PANORAMAS}#{number}", f"no image of panorama {number} is in the survey")
        for number in panoramas.keys() - seen
    ]
    return Reading(tuple(images), tuple(skipped), CRS)


def _require(masks: set[str], listing: Listing, path: Place) -> None:
    missing = sorted(masks - listing.paths.keys())
    if missing:
        raise BadSurvey(
            f"{path / CALIBRATION} names the mask {missing[0]}, which is not in the survey; put "
            "it there or leave masks unused (--no-masks)"
        )


def _shot(
    name: re.Match[str] | None,
    rig: dict[str, RigCamera],
    panoramas: dict[int, _Panorama | str],
) -> _Shot | str:
    """Which camera took an image and when, from its name; or why that is not known."""
    if name is None:
        return "image without pose: its name is not <place>-<session>-<camera>-<block>_<id>.jpg"
    camera = rig.get(name["camera"])
    if camera is None:
        return f"image without pose: camera {name['camera']} is not in {CALIBRATION}"
    panorama = panoramas.get(int(name["panorama"]))
    if panorama is None:
        return f"image without pose: panorama {int(name['panorama'])} is not in {PANORAMAS}"
    return panorama if isinstance(panorama, str) else _Shot(camera, panorama)


def _posed(uri: str, shot: _Shot, listing: Listing, options: ReadOptions) -> PosedImage | str:
    """One image with its camera's pose, or why that pose cannot be."""
    camera, panorama = shot.camera, shot.panorama
    enu_from_vehicle = enu_from_frd(panorama.attitude)
    east, north, up = np.split(enu_from_vehicle @ camera.lever_arm_m, 3)
    x, y = np.array([panorama.easting]), np.array([panorama.northing])
    # The vehicle is turned from true north and placed on grid north.
    easting, northing = grid_of(CRS).moved(x, y, east, north)
    attitude = camera_attitude(enu_from_vehicle @ camera.frd_from_camera)
    pose = Pose(
        easting=float(easting[0]),
        northing=float(northing[0]),
        crs=CRS,
        altitude_m=panorama.altitude_m + float(up[0]),
        heading_deg=attitude.heading_deg,
        pitch_deg=attitude.pitch_deg,
        roll_deg=attitude.roll_deg,
        north=options.north or NORTH,
    )
    problem = pose_problem(pose, geographic=False)
    if problem is not None:
        return f"{PANORAMAS}, panorama {panorama.number}: {problem}"
    has_mask = options.use_masks and camera.mask is not None
    return PosedImage(
        uri=uri,
        path=listing.paths[uri],
        pose=pose,
        camera=Camera(name=camera.name, hfov_deg=camera.hfov_deg),
        captured_at=panorama.captured_at,
        quarter_turns=camera.quarter_turns if options.make_upright else 0,
        mask_path=listing.paths[printable_uri(camera.mask)] if has_mask and camera.mask else None,
    )


def _read_panoramas(path: Place) -> tuple[dict[int, _Panorama | str], list[Skipped]]:
    """Panoramas by id, or why the images of one cannot be placed."""
    panoramas: dict[int, _Panorama | str] = {}
    skipped: list[Skipped] = []
    for at, entry in enumerate(read_json_list(path)):
        number = entry.get("id") if isinstance(entry, dict) else None
        if not isinstance(entry, dict) or not isinstance(number, int):
            skipped.append(Skipped(f"{PANORAMAS}#[{at}]", "has no whole number as its id"))
        elif number in panoramas:
            panoramas[number] = f"panorama {number} is in {PANORAMAS} more than once; keep one"
        else:
            panoramas[number] = _panorama(number, entry)
    return panoramas, skipped


def _panorama(number: int, entry: dict[str, object]) -> _Panorama | str:
    values: dict[str, float] = {}
    for key in ("easting", "northing", "altitude", "heading", "pitch", "roll"):
        value = entry.get(key)
        if not isinstance(value, int | float) or not math.isfinite(value):
            return f"{PANORAMAS}, panorama {number}: {key} is {value}, expected a finite number"
        values[key] = float(value)
    date = entry.get("date")
    return _Panorama(
        number=number,
        easting=values["easting"],
        northing=values["northing"],
        altitude_m=values["altitude"],
        attitude=Attitude(values["heading"], values["pitch"], values["roll"]),
        captured_at=zoned_time(date) if isinstance(date, str) else None,
    )


READER = Reader("stereopolis", recognises, read)
