"""Heights: whether there are any, what they count from, and whether they can be true."""

from collections.abc import Iterator

import numpy as np

from geo.crs import parse_crs, parse_full_crs
from geo.heights import vertical_reference
from survey.doctor.findings import Finding, share, uris_of
from survey.doctor.track import Track

_LOWEST_STREET_M = -30.0
"""Below what streets there are but for the shores of the Dead Sea and a few tunnels."""
_JUMP_M, _STEEPEST = 10.0, 0.5
_FIXED = frozenset({"exif", "stereopolis"})
"""Formats whose system no option changes."""
_ELLIPSOIDAL = "--crs EPSG:4979, if these are degrees and heights of WGS 84, as receivers give them"
_NGF_WEST_DEG, _NGF_EAST_DEG, _NGF_SOUTH_DEG = -4.87, 8.23, 42.33
"""Where heights of mainland France (EPSG:5720) are used; Corsica has its own."""


def check_heights(track: Track, survey_format: str) -> Iterator[Finding]:
    """Missing, constant, below the sea, jumping, or counted from an unknown zero.

    survey_format : the reader's name.
    """
    known = np.isfinite(track.altitude_m)
    if not known.any():
        yield Finding("height", "note", "no image has a height: results carry none")
        return
    heights = track.altitude_m[known]
    if len(heights) > 1 and np.ptp(heights) == 0.0:
        yield Finding(
            "height",
            "warning" if heights[0] == 0.0 else "note",
            f"the height is {heights[0]:g} m for all {len(heights):,} images: hardly measured",
            mend="--mapping without z in [columns]" if heights[0] == 0.0 else "",
        )
        return
    zeros = np.flatnonzero(track.altitude_m == 0.0)
    if len(zeros) and abs(float(np.median(heights))) > _JUMP_M:
        yield Finding(
            "height",
            "warning",
            f"{share(len(zeros), len(track))} heights are exactly 0 m where the others are about "
            f"{np.median(heights):.0f} m: not measured",
            uris_of(track.images, zeros),
            "leave these cells of the table empty",
        )
    low = np.flatnonzero(known & (track.altitude_m < _LOWEST_STREET_M))
    if len(low):
        yield Finding(
            "height",
            "warning",
            f"{share(len(low), len(track))} heights are below {_LOWEST_STREET_M:g} m, the lowest "
            f"{heights.min():.0f} m: few streets are; heights above the ellipsoid or of depth?",
            uris_of(track.images, low),
            _system_with_heights(track, survey_format),
        )
    yield from _jumps(track)
    yield from _unknown_zero(track, survey_format)


def _jumps(track: Track) -> Iterator[Finding]:
    at = np.flatnonzero(track.previous >= 0)
    before = track.previous[at]
    climb = np.abs(track.altitude_m[at] - track.altitude_m[before])
    metres = np.hypot(track.x_m[at] - track.x_m[before], track.y_m[at] - track.y_m[before])
    jumps = (climb > _JUMP_M) & (climb > _STEEPEST * metres)
    jumps &= (track.altitude_m[at] != 0.0) & (track.altitude_m[before] != 0.0)  # said already
    if jumps.any():
        yield Finding(
            "height-jump",
            "warning",
            f"the height jumps at {int(jumps.sum()):,} of {len(at):,} steps, by up to "
            f"{climb[jumps].max():.0f} m",
            uris_of(track.images, at[jumps]),
            "a device without a fix? leave these heights empty, or the images out (--exclude)",
        )


def _unknown_zero(track: Track, survey_format: str) -> Iterator[Finding]:
    heights, full = track.place.heights, parse_full_crs(track.place.crs_text)
    if vertical_reference(full) is None:
        yield Finding(
            "height-datum",
            "note",
            f"results carry no heights: {full.name} does not say from what altitudes count",
            mend=_system_with_heights(track, survey_format),
        )
    elif heights.why_not:
        yield Finding(
            "height-datum",
            "note",
            f"results carry no heights: {heights.why_not}",
            mend=f"pyproj sync --file {heights.missing_grids[0]}" if heights.missing_grids else "",
        )


def _system_with_heights(track: Track, survey_format: str) -> str:
    """What to give as --crs so that altitudes count from something, "" where nothing can be."""
    crs = parse_crs(track.place.crs_text)
    said = vertical_reference(parse_full_crs(track.place.crs_text)) is not None
    if said or survey_format in _FIXED or (survey_format == "mcap" and crs.is_geographic):
        return ""
    if crs.is_geographic:
        return _ELLIPSOIDAL
    lon, lat = float(np.median(track.lon_deg)), float(np.median(track.lat_deg))
    french = crs.area_of_use is not None and crs.area_of_use.name.startswith("France")
    mainland = _NGF_WEST_DEG < lon < _NGF_EAST_DEG and lat > _NGF_SOUTH_DEG
    code = ":".join(crs.to_authority(min_confidence=100) or ())
    if french and mainland and code:
        return f"--crs {code}+5720, if heights count from the sea (NGF-IGN69)"
    return "--crs with the heights' system joined to the survey's: EPSG:<survey's>+<heights'>"
