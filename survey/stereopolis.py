"""A Stereopolis survey by IGN: `panoramicsMetaData.json`, `cameraCalibration.json`, images.

Coordinates are Lambert-93 (EPSG:2154) in metres, by definition of the format. Headings count from
true north: docs/decisions/0003-stereopolis-north.md.
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from contracts.config import North
from contracts.errors import BadSurvey
from contracts.records import Camera, Pose, PosedImage, Skipped
from geo.attitude import Attitude, camera_attitude, enu_from_frd
from survey.files import Listing, list_images, printable_uri
from survey.options import Reader, Reading, ReadOptions
from survey.poses import normalised, pose_problem
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

    easting: float
    northing: float
    altitude_m: float
    attitude: Attitude
    captured_at: str | None


def recognises(path: Path) -> bool:
    """A folder with both metadata files."""
    return (path / PANORAMAS).is_file() and (path / CALIBRATION).is_file()


def read(path: Path, options: ReadOptions, wanted: Callable[[str], bool]) -> Reading:
    """Every image with the pose of its camera; no image is opened.

    Raises
    ------
    BadSurvey : metadata missing or broken.
    """
    del wanted
    rig = read_rig(path / CALIBRATION)
    panoramas, skipped = _read_panoramas(path / PANORAMAS)
    listing = list_images(path)
    masks = _masks(rig, listing, path) if options.use_masks else {}
    all_masks = {printable_uri(camera.mask) for camera in rig.values() if camera.mask}
    skipped += listing.skipped
    images: list[PosedImage] = []
    seen: set[int] = set()
    for uri, file in listing.paths.items():
        if uri in all_masks:
            continue
        match = _NAME.fullmatch(uri.rpartition("/")[2])
        if match is not None:
            seen.add(int(match["panorama"]))
        image = _posed(uri, file, match, rig, panoramas)
        if isinstance(image, str):
            skipped.append(Skipped(uri, image))
        else:
            images.append(image)
    return Reading(tuple(images), tuple(skipped), CRS)
