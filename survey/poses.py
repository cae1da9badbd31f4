"""Whether a pose can be true: finite, in range, and where its coordinate system is used."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from contracts.records import Pose
from geo.crs import grid_of, parse_crs, parse_full_crs
from geo.headings import wrapped_180, wrapped_360

Quantity = Literal["easting", "northing", "altitude", "heading", "pitch", "roll"]

_LOWEST_M, _HIGHEST_M = -1_000.0, 10_000.0
_AREA_MARGIN_DEG = 2.0
_NULL_ISLAND_DEG = 1e-4


def crs_name(text: str) -> str:
    """The short name under which poses carry a coordinate system, such as `EPSG:2154`.

    Heights stay part of it: `EPSG:2154+5720` is `EPSG:5698`.

    Raises
    ------
    UnknownCrs : see `geo.crs.parse_full_crs`.
    """
    crs = parse_full_crs(text)
    authority = crs.to_authority(min_confidence=100)
    return ":".join(authority) if authority else crs.to_string()


def is_geographic(crs: str) -> bool:
    """Whether coordinates of this system are degrees of longitude and latitude."""
    return bool(parse_crs(crs).is_geographic)


@dataclass(frozen=True, slots=True)
class PoseProblem:
    """What is impossible about a pose. quantity : which of its numbers."""

    quantity: Quantity
    reason: str


def pose_problem(pose: Pose, geographic: bool) -> str | None:
    """Why a pose is impossible, or None; see `find_problem`."""
    problem = find_problem(pose, geographic)
    return None if problem is None else problem.reason


def find_problem(pose: Pose, geographic: bool) -> PoseProblem | None:
    """The first impossible number of a pose, or None.

    geographic : its coordinates are degrees, x = longitude, y = latitude.
    """
    numbers: dict[Quantity, float | None] = {
        "easting": pose.easting,
        "northing": pose.northing,
        "altitude": pose.altitude_m,
        "heading": pose.heading_deg,
        "pitch": pose.pitch_deg,
        "roll": pose.roll_deg,
    }
    for quantity, value in numbers.items():
        if value is not None and not math.isfinite(value):
            return PoseProblem(quantity, f"{quantity} is {value}, expected a finite number")
    if geographic and not (abs(pose.easting) <= 180.0 and abs(pose.northing) <= 90.0):
        return PoseProblem(
            "easting" if abs(pose.easting) > 180.0 else "northing",
            f"longitude {pose.easting:g}, latitude {pose.northing:g} degrees, expected within "
            "180 and 90; are they swapped, or metres?",
        )
    if pose.altitude_m is not None and not _LOWEST_M <= pose.altitude_m <= _HIGHEST_M:
        expected = f"expected {_LOWEST_M:g} to {_HIGHEST_M:g}"
        return PoseProblem("altitude", f"altitude is {pose.altitude_m:g} m, {expected}")
    if pose.pitch_deg is not None and abs(pose.pitch_deg) > 90.0:
        return PoseProblem("pitch", f"pitch is {pose.pitch_deg:g} degrees, expected -90 to 90")
    return None


def on_null_island(lon_deg: float, lat_deg: float) -> bool:
    """Whether a position is (0, 0), which cameras write when they have none."""
    return abs(lon_deg) < _NULL_ISLAND_DEG and abs(lat_deg) < _NULL_ISLAND_DEG


def normalised(pose: Pose) -> Pose:
    """The same pose with its heading within [0, 360) and its roll within (-180, 180]."""
    return replace(
        pose,
        heading_deg=None if pose.heading_deg is None else wrapped_360(pose.heading_deg),
        roll_deg=None if pose.roll_deg is None else wrapped_180(pose.roll_deg),
    )


def outside_area(poses: Sequence[Pose], crs: str) -> NDArray[np.bool_]:
    """(n,) bool: which poses lie more than 2 degrees outside the area their system is made for.

    Swapped axes and a wrong `--crs` show here. A system that states no area accepts all that it
    can convert.
    """
    grid = grid_of(crs)
    lon, lat = grid.degrees(
        np.array([pose.easting for pose in poses], np.float64),
        np.array([pose.northing for pose in poses], np.float64),
    )
    lon = lon + grid.prime_meridian_deg  # the datum matters less than 200 m here
    # An inverse projection may well answer with a place it would itself put elsewhere.
    finite = np.isfinite(lon) & np.isfinite(lat)
    area = parse_crs(crs).area_of_use
    if area is None:
        return np.asarray(~finite)
    width = (area.east - area.west) % 360.0 or 360.0
    along = (lon - area.west + _AREA_MARGIN_DEG) % 360.0
    inside = (
        finite
        & ((along <= width + 2 * _AREA_MARGIN_DEG) | (width + 2 * _AREA_MARGIN_DEG >= 360.0))
        & (lat >= area.south - _AREA_MARGIN_DEG)
        & (lat <= area.north + _AREA_MARGIN_DEG)
    )
    return np.asarray(~inside)


def finite_number(name: str, text: str) -> float:
    """The number that a piece of text is; ValueError says what `name` is instead."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f"{name} is {text[:40]!r}, expected a number")
    return number
