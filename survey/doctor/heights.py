"""Heights: whether there are any, what they count from, and whether they can be true."""

from collections.abc import Iterator

import numpy as np

from survey.doctor.findings import Finding, share, uris_of
from survey.doctor.track import Track

_LOWEST_STREET_M = -30.0
"""Below what streets there are but for the shores of the Dead Sea and a few tunnels."""
_JUMP_M, _STEEPEST = 10.0, 0.5


def check_heights(track: Track) -> Iterator[Finding]:
    """Missing, constant, below the sea, jumping, or counted from an unknown zero."""
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
            "--crs with the heights' own system, such as --crs EPSG:4979 for ellipsoidal ones",
        )
    yield from _jumps(track)
    yield from _unknown_zero(track)


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


def _unknown_zero(track: Track) -> Iterator[Finding]:
    heights = track.place.heights
    if heights.why_not:
        yield Finding(
            "height-datum",
            "note",
            f"results carry no heights: {heights.why_not}",
            mend=f"pyproj sync --file {heights.missing_grids[0]}"
            if heights.missing_grids
            else "--crs with both, such as EPSG:2154+5720 (France, above the sea)",
        )
