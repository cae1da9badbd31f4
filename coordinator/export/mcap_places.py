"""Where the images of a survey were taken, in WGS 84, and how their cameras were turned there."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from geo.crs import ToWgs84
from geo.headings import true_headings_deg
from geo.magnetic import decimal_years, declination_deg
from geo.rotations import rotations_from_hpr
from survey.options import Survey

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Place:
    """Of one image, in WGS 84; NaN: not known. quaternion : of the camera (right, down, forward)
    in east, north, up."""

    lon_deg: float
    lat_deg: float
    height_m: float
    heading_deg: float
    quaternion: Floats


def in_wgs84(survey: Survey, allow_ballpark: bool = False) -> list[Place | None]:
    """The place of each image, None where it has no pose. Derived headings are left out.

    allow_ballpark : see `geo.crs.ToWgs84`.

    Raises
    ------
    UnknownCrs : positions have no place in WGS 84.
    """
    posed = [at for at, image in enumerate(survey.images) if image.pose is not None]
    places: list[Place | None] = [None] * len(survey.images)
    if survey.crs is None or not posed:
        return places
    poses = [pose for image in survey.images if (pose := image.pose) is not None]
    easting = np.array([pose.easting for pose in poses])
    northing = np.array([pose.northing for pose in poses])
    altitude = np.array([_or_nan(pose.altitude_m) for pose in poses])
    to_wgs84 = ToWgs84.over(survey.crs, easting, northing, allow_ballpark)
    lon, lat, height = to_wgs84.positions(easting, northing, altitude)
    convergence = to_wgs84.convergence_deg(easting, northing)
    years = decimal_years([survey.images[at].captured_at for at in posed])
    declination = declination_deg(lon, lat, height, years)
    heading = np.array(
        [
            np.nan if pose.heading_derived else _or_nan(pose.heading_deg)
            for pose in poses
        ]
    )  # fmt: skip
    for north in sorted({pose.north for pose in poses}):
        some = np.array([pose.north == north for pose in poses])
        heading[some] = true_headings_deg(
            heading[some], north, convergence[some], declination[some]
        )
    quaternions = _quaternions(
        heading,
        np.array([_or_nan(pose.pitch_deg) for pose in poses]),
        np.array([_or_nan(pose.roll_deg) for pose in poses]),
    )
    for number, at in enumerate(posed):
        places[at] = Place(
            float(lon[number]),
            float(lat[number]),
            float(height[number]),
            float(heading[number]),
            quaternions[number],
        )
    return places


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def _quaternions(heading_deg: Floats, pitch_deg: Floats, roll_deg: Floats) -> Floats:
    """(n, 4) x, y, z, w; NaN where one of the angles is not known."""
    rotations = rotations_from_hpr(heading_deg, pitch_deg, roll_deg)
    known = np.isfinite(rotations).all(axis=(1, 2))
    found = np.full((len(rotations), 4), np.nan)
    if known.any():
        found[known] = Rotation.from_matrix(rotations[known]).as_quat()
    return found
