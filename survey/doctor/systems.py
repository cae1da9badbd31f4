"""Where on the Earth numbers may lie: swapped axes and a wrong coordinate system.

Guesses, and worded as such: they name what fits the numbers, never change them.
"""

import functools
from dataclasses import dataclass

import numpy as np
import pyproj
from numpy.typing import NDArray
from pyproj.database import CRSInfo, query_crs_info
from pyproj.enums import PJType
from pyproj.exceptions import CRSError

from contracts.errors import UnknownCrs
from contracts.records import PosedImage
from geo.crs import parse_crs
from survey.doctor.findings import Finding, uris_of
from survey.doctor.opening import Opened
from survey.poses import outside_area

_USUAL = (
    2154, 27572, 3942, 3943, 3944, 3945, 3946, 3947, 3948, 3949, 3950, 31370, 3812, 28992, 2169,
    2056, 21781, 27700, 2157, 29902, 31466, 31467, 31468, 31287, 31256, 5514, 2180, 3006, 3007,
    3008, 3011, 3067, 3301, 3346, 3059, 23700, 3794, 3765, 3003, 3004, 6707, 3763, 2100, 3844,
    2039, 5179, 5186, 6677, 3414, 2326, 2193, 2263, 2227, 3435, 2249, 32188, 2048,
)  # fmt: skip
"""EPSG codes of national and city systems; UTM zones are hinted at by `_utm_hint`."""

_METRIC = frozenset({"mcap", "kapture"})
"""Formats whose bare numbers are metres, however small."""

_MOST_NAMED = 4
_WIDEST_NATIONAL_DEG2 = 150.0
_FEW_NATIONAL, _SOME_NATIONAL = 0, 2


def check_system(opened: Opened) -> tuple[tuple[PosedImage, ...], list[Finding]]:
    """The images whose positions can be true in the survey's system, and what is wrong else."""
    posed = [image for image in opened.images if image.pose is not None]
    if not posed:
        return (), []
    x = np.array([image.pose.easting for image in posed if image.pose])
    y = np.array([image.pose.northing for image in posed if image.pose])
    if opened.bare:
        return (), [_unknown_system(opened, x, y)]
    if opened.crs is None:  # known, and why it cannot be used is said
        return (), []
    outside = outside_area([image.pose for image in posed if image.pose], opened.crs)
    inside = tuple(image for image, out in zip(posed, outside, strict=True) if not out)
    if not outside.any():
        return inside, _at_sea(x, y, opened.crs)
    if outside.all():
        return (), [_all_outside(opened, posed, x, y)]
    first = int(np.argmax(outside))
    what = (
        f"{outside.sum():,} of {len(posed):,} positions lie far outside the area of use of "
        f"{opened.crs} and are left out; the first has x {x[first]:.9g}, y {y[first]:.9g}"
    )
    uris = uris_of(posed, np.flatnonzero(outside))
    return inside, [Finding("outside-area", "warning", what, uris, "mend or remove these rows")]


def likely_systems(x: float, y: float) -> tuple[str, ...]:
    """Codes of usual systems in whose area of use the numbers lie, national ones first.

    x, y : easting and northing (or longitude and latitude), in that order.
    """
    if abs(x) <= 180.0 and abs(y) <= 90.0:
        return ("EPSG:4326",)
    codes = (f"EPSG:{number}" for number in (*_USUAL, 3857))
    return tuple(code for code in codes if _lies_within(code, x, y))


def _all_outside(
    opened: Opened, posed: list[PosedImage], x: NDArray[np.float64], y: NDArray[np.float64]
) -> Finding:
    crs = str(opened.crs)
    if _inside(crs, y, x).all():
        what = (
            f"axes are swapped: every one of {len(x):,} positions lies outside the area of use of "
            f"{crs} (first: x {x[0]:.9g}, y {y[0]:.9g}), and with x and y swapped all "
            f"{len(x):,} lie within {_area_name(crs)}"
        )
        return Finding("swapped-axes", "error", what, mend=_SWAP_COLUMNS)
    what = (
        f"all {len(x):,} positions lie outside the area of use of {crs} ({_area_name(crs)}), "
        f"swapped or not; the first, {posed[0].uri}, has x {x[0]:.9g}, y {y[0]:.9g}"
    )
    return _with_suggestion(opened, what, x, y)


_SWAP_COLUMNS = (
    "exchange the names of the two columns, or --mapping with [columns] x = the one that counts to "
    "the east"
)


_NEAR_AN_ORIGIN_M = 10_000.0
LOCAL_FRAME = "local-frame"
_LOCAL = "bring the poses into a map's system first, or index without positions: --no-pose"


def _unknown_system(opened: Opened, x: NDArray[np.float64], y: NDArray[np.float64]) -> Finding:
    what = (
        f"the coordinate system of {len(x):,} positions is not known or not possible; x is "
        f"{x.min():.9g} to {x.max():.9g}, y {y.min():.9g} to {y.max():.9g}"
    )
    return _with_suggestion(opened, what, x, y)


def _with_suggestion(
    opened: Opened, what: str, x: NDArray[np.float64], y: NDArray[np.float64]
) -> Finding:
    """What fits the numbers as they are, else swapped, else nothing."""
    if opened.format in _METRIC and max(np.abs(x).max(), np.abs(y).max()) < _NEAR_AN_ORIGIN_M:
        what += "; these are metres from an origin of their own, as in no usual coordinate system"
        return Finding(LOCAL_FRAME, "error", what, mend=_LOCAL)
    middle = float(np.median(x)), float(np.median(y))
    straight, swapped = likely_systems(*middle), likely_systems(middle[1], middle[0])
    for codes, how in ((straight, ""), (swapped, " with x and y swapped")):
        if codes:
            names = ", ".join(_described(code) for code in codes[:_MOST_NAMED])
            more = f" and {len(codes) - _MOST_NAMED} more" if len(codes) > _MOST_NAMED else ""
            what += f"; the numbers fit{how} {names}{more}{_utm_hint(*middle)}"
            mend = f"--crs {codes[0]}, if that is the system the survey was made in"
            return Finding(
                "wrong-crs", "error", what, mend=f"{_SWAP_COLUMNS}; {mend}" if how else mend
            )
    what += _utm_hint(*middle) or "; no usual coordinate system has such numbers"
    return Finding("wrong-crs", "error", what, mend="--crs, with the system the survey was made in")


def _at_sea(x: NDArray[np.float64], y: NDArray[np.float64], crs: str) -> list[Finding]:
    """Swapped degrees stay on the Earth; but hardly a country has a system of its own there."""
    if not parse_crs(crs).is_geographic or abs(float(np.median(x))) > 90.0:
        return []
    lon, lat = float(np.median(x)), float(np.median(y))
    here, there = _national_systems(lon, lat), _national_systems(lat, lon)
    if len(here) > _FEW_NATIONAL or len(there) < _SOME_NATIONAL:
        return []
    what = (
        f"longitude {lon:.4f}, latitude {lat:.4f} lies where no country has a coordinate system of "
        f"its own in the EPSG register, most likely at sea; swapped, it lies in: {there[0]}"
    )
    return [Finding("swapped-axes", "warning", what, mend=_SWAP_COLUMNS)]


def _utm_hint(x: float, y: float) -> str:
    """Almost any pair of metres is somewhere in every UTM zone: no single one can be named."""
    if 1e5 <= x <= 9e5 and 0.0 <= y <= 1e7:
        return "; or they are of a UTM zone zz (EPSG:258zz in Europe, 326zz north, 327zz south)"
    return ""


def _inside(crs: str, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(n,) which points lie in the area of use of a system, with no margin."""
    area = _area_of(parse_crs(crs))
    lon, lat = _plain_lon_lat(crs, x, y)
    finite = np.isfinite(lon) & np.isfinite(lat)
    return finite if area is None else finite & _within(area, lon, lat)


def _lies_within(code: str, x: float, y: float) -> bool:
    try:
        return bool(_inside(code, np.array([x]), np.array([y]))[0])
    except (UnknownCrs, CRSError):  # a PROJ database without it
        return False


def _plain_lon_lat(
    crs: str, x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Without a change of datum, which matters less than 200 m; NaN where there is no place."""
    parsed = parse_crs(crs)
    if parsed.is_geographic:
        good = (np.abs(x) <= 180.0) & (np.abs(y) <= 90.0)
        return np.where(good, x, np.nan), np.where(good, y, np.nan)
    transformer = pyproj.Transformer.from_crs(parsed, parsed.geodetic_crs, always_xy=True)
    lon, lat = (np.asarray(part, np.float64) for part in transformer.transform(x, y))
    good = np.isfinite(lon) & np.isfinite(lat)
    return np.where(good, lon, np.nan), np.where(good, lat, np.nan)


@dataclass(frozen=True, slots=True, order=True)
class _Area:
    """Where a system is used, in degrees; west is above east across longitude 180."""

    size_deg2: float
    name: str
    west: float
    south: float
    east: float
    north: float


def _area_of(crs: pyproj.CRS | CRSInfo) -> _Area | None:
    area = crs.area_of_use
    if area is None:
        return None
    size = ((area.east - area.west) % 360.0 or 360.0) * (area.north - area.south)
    name = (area.name or "its area").rstrip(".")
    return _Area(size, name, area.west, area.south, area.east, area.north)


def _within(
    area: _Area, lon: NDArray[np.float64] | float, lat: NDArray[np.float64] | float
) -> NDArray[np.bool_]:
    width = (area.east - area.west) % 360.0 or 360.0
    along = (np.asarray(lon) - area.west) % 360.0
    return np.asarray((along <= width) & (lat >= area.south) & (lat <= area.north))


def _area_name(crs: str) -> str:
    area = _area_of(parse_crs(crs))
    return "its area" if area is None else area.name


def _described(code: str) -> str:
    return f"{code} ({parse_crs(code).name})"


def _national_systems(lon: float, lat: float) -> list[str]:
    """Names of the areas of small projected systems that hold a place, smallest first."""
    return [area.name for area in _national_areas() if bool(_within(area, lon, lat))]


@functools.cache
def _national_areas() -> tuple[_Area, ...]:
    """Areas of use of the EPSG's projected systems, without those made for a strip of the globe."""
    infos = query_crs_info("EPSG", [PJType.PROJECTED_CRS])
    areas = {area for info in infos if (area := _area_of(info)) is not None}
    return tuple(
        area
        for area in sorted(areas)
        if not area.name.startswith(("Between", "World")) and area.size_deg2 < _WIDEST_NATIONAL_DEG2
    )
