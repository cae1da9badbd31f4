"""Positions that cannot be true, or hardly, and how far apart images stand."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from survey.doctor.findings import Finding, share, uris_of
from survey.doctor.track import Indices, Track
from survey.poses import on_null_island

_MAX_SPEED_M_S = 200.0 / 3.6
_WHOLE_SECONDS = 1.0
"""Times are often cut to whole seconds: two images may be that much farther apart."""
_MIN_JUMP_M = 50.0
_JUMP_OVER_STEP = 10.0
_FAR_OVER_USUAL = 10.0
_FAR_FLOOR_M = 5_000.0
_STATION_M = 0.5
_UNEVEN = 5.0
_MIN_STEPS = 10


def check_positions(track: Track) -> Iterator[Finding]:
    """Null island, single jumps, impossible speeds, strays."""
    yield from _null_island(track)
    jumps = jumping(track)
    if len(jumps):
        yield Finding(
            "position-jump",
            "warning",
            f"{share(len(jumps), len(track))} positions jump away from their neighbours and back, "
            f"the farthest by {_jump_lengths(track)[jumps].max():,.0f} m",
            uris_of(track.images, jumps),
            "mend these rows, or leave the images out with --exclude",
        )
    yield from _speed(track, jumps)
    yield from _strays(track, jumps)


def check_spacing(track: Track) -> Iterator[Finding]:
    """How far apart images stand, which bounds how well a photo can be placed."""
    steps = station_steps_m(track)
    if len(steps) < _MIN_STEPS:
        yield Finding(
            "spacing",
            "note",
            f"spacing cannot be judged: only {len(steps)} steps between images of one sequence",
        )
        return
    median, wide = float(np.median(steps)), float(np.quantile(steps, 0.95))
    uneven = wide > _UNEVEN * median
    what = (
        f"images stand {median:.1f} m apart (median; 95 % within {wide:.1f} m): a photo is placed "
        "at the best at one of them"
    )
    if uneven:
        what += ", and spacing is uneven: where it is wide, photos are placed worse"
    yield Finding("spacing", "note", what)


def station_steps_m(track: Track) -> NDArray[np.float64]:
    """(m,) metres between neighbours of a sequence that do not stand at one place."""
    steps = [np.hypot(np.diff(track.x_m[run]), np.diff(track.y_m[run])) for run in track.sequences]
    lengths = np.concatenate(steps) if steps else np.zeros(0)
    return lengths[lengths > _STATION_M]


def jumping(track: Track) -> Indices:
    """Images far from the one before and the one after, which are near each other."""
    away = _jump_lengths(track)
    usual = station_steps_m(track)
    floor = max(_MIN_JUMP_M, _JUMP_OVER_STEP * float(np.median(usual)) if len(usual) else 0.0)
    return np.flatnonzero(away > floor).astype(np.int64)


def _jump_lengths(track: Track) -> NDArray[np.float64]:
    """(n,) metres to the nearer neighbour, 0 where the neighbours are not near each other."""
    lengths = np.zeros(len(track))
    before, at, after = track.order[:-2], track.order[1:-1], track.order[2:]
    same = (track.camera[before] == track.camera[at]) & (track.camera[at] == track.camera[after])
    near = np.minimum(_metres(track, before, at), _metres(track, at, after))
    back = same & (_metres(track, before, after) < near / 2.0)
    lengths[at[back]] = near[back]
    return lengths


def _metres(track: Track, one: Indices, other: Indices) -> NDArray[np.float64]:
    return np.hypot(track.x_m[one] - track.x_m[other], track.y_m[one] - track.y_m[other])


def _null_island(track: Track) -> Iterator[Finding]:
    near = np.hypot(track.lon_deg, track.lat_deg) < 1.0
    found = [
        int(at)
        for at in np.flatnonzero(near)
        if on_null_island(float(track.lon_deg[at]), float(track.lat_deg[at]))
    ]
    if found:
        yield Finding(
            "null-island",
            "error",
            f"{share(len(found), len(track))} positions are longitude 0, latitude 0, which devices "
            "write when they have none",
            uris_of(track.images, found),
            "remove these rows, or leave the images out with --exclude",
        )


def _speed(track: Track, jumps: Indices) -> Iterator[Finding]:
    at = np.flatnonzero(track.previous >= 0)
    at = at[~np.isin(at, jumps) & ~np.isin(track.previous[at], jumps)]
    before = track.previous[at]
    metres, gap_s = _metres(track, before, at), track.time_s[at] - track.time_s[before]
    fast = metres > _MAX_SPEED_M_S * (gap_s + _WHOLE_SECONDS)  # false where a time is not known
    if not fast.any():
        return
    worst = int(np.argmax(np.where(fast, metres / (gap_s + _WHOLE_SECONDS), 0.0)))
    yield Finding(
        "speed",
        "warning",
        f"{share(int(fast.sum()), len(track))} images lie farther from the one before than "
        f"200 km/h allows; the worst: {metres[worst]:,.0f} m in {gap_s[worst]:.1f} s",
        uris_of(track.images, at[fast]),
        "check positions and times; where cameras share a name or folder, name them apart",
    )


def _strays(track: Track, jumps: Indices) -> Iterator[Finding]:
    """Beyond ten times the distance within which 95 % lie."""
    metres = np.hypot(track.x_m - np.median(track.x_m), track.y_m - np.median(track.y_m))
    usual = float(np.quantile(metres, 0.95))
    far = metres > max(_FAR_OVER_USUAL * usual, _FAR_FLOOR_M)
    far[jumps] = False
    if far.any():
        yield Finding(
            "far-away",
            "warning",
            f"{share(int(far.sum()), len(track))} images lie up to "
            f"{metres[far].max() / 1000.0:,.0f} km from the middle of the survey; 95 % lie within "
            f"{usual / 1000.0:,.1f} km",
            uris_of(track.images, np.flatnonzero(far)),
            "if they are another place's, index them as a survey of their own (--also)",
        )
