"""Headings against the track: steady, loose, turned round."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from survey.doctor.circular import wrapped
from survey.doctor.findings import Finding, share, uris_of
from survey.doctor.mountings import MIN_IMAGES, Mounting, difference_deg, mountings
from survey.doctor.norths import true_headings
from survey.doctor.readings import misread_headings
from survey.doctor.track import Floats, Indices, Track

_LOOSE_DEG = 40.0
_NEAR_DEG, _ROUND_DEG = 35.0, 145.0
_EVEN_STEPS = 0.6
_NOT_TOLD = (
    "headings cannot be compared with the direction of travel: {}; so flips, units and the north "
    "they count from were not checked"
)


def check_headings(track: Track) -> Iterator[Finding]:
    """All that the direction of travel says of the headings."""
    known = np.isfinite(track.heading_deg)
    if not known.any():
        yield Finding(
            "headings",
            "note",
            f"none of {len(track):,} images has a heading: it is taken from the track where there "
            "is one, else matches show no direction",
        )
        return
    if not known.all():
        missing = np.flatnonzero(~known)
        yield Finding(
            "headings",
            "note",
            f"{share(len(missing), len(track))} images have no heading",
            uris_of(track.images, missing),
        )
    true = true_headings(track)
    mounted = mountings(track, true)
    if not mounted:
        yield Finding("headings-track", "note", _NOT_TOLD.format(_why_not(track)))
        return
    misread = misread_headings(track)
    if misread is not None:
        yield misread
        return
    for mounting in mounted:
        yield from _loose(track, mounting)
    steady = [mounting for mounting in mounted if mounting.spread_deg < _LOOSE_DEG]
    if steady:
        yield _described(steady)
        yield from _backwards(track, steady)
    for mounting in steady:
        yield from _flips(track, mounting, true)


def _why_not(track: Track) -> str:
    if not np.isfinite(track.travel_deg).any():
        return "no images follow each other closely enough to make a track"
    return f"no camera that looks ahead has {MIN_IMAGES} images with a heading on the move"


def _described(steady: list[Mounting]) -> Finding:
    offsets = ", ".join(
        f"{each.camera or 'camera'} {each.offset_deg:+.1f}° ± {each.spread_deg:.1f}°"
        for each in steady[:8]
    )
    more = f" and {len(steady) - 8} more" if len(steady) > 8 else ""
    return Finding(
        "headings-track",
        "note",
        f"cameras keep one angle to the direction of travel, as they should: {offsets}{more}",
    )


def _loose(track: Track, mounting: Mounting) -> Iterator[Finding]:
    """Headings that follow nothing: usual by hand, a fault of a vehicle."""
    if mounting.spread_deg < _LOOSE_DEG:
        return
    several = _several_cameras(track, mounting.images)
    vehicle = not several and _even(track, mounting.images)
    if several:
        why = "several images have one time, so these are several cameras without names"
    elif vehicle:
        why = "images stand as evenly as a vehicle's, so this is likely not their heading"
    else:
        why = "usual for photographs taken by hand, wrong for a vehicle"
    yield Finding(
        "headings-track",
        "warning" if vehicle else "note",
        f"headings of {mounting.camera or 'the camera'} do not follow the direction of travel "
        f"(spread {mounting.spread_deg:.0f}° over {len(mounting.images):,} images): {why}",
        mend="--mapping with heading and camera in [columns]" if vehicle or several else "",
    )


def _several_cameras(track: Track, images: Indices) -> bool:
    times = track.time_s[images]
    known = times[np.isfinite(times)]
    return len(known) > 0 and len(np.unique(known)) <= len(known) / 2.0


def _even(track: Track, images: Indices) -> bool:
    """Whether images stand at even steps: a clock or a wheel released the camera."""
    steps = np.hypot(np.diff(track.x_m[images]), np.diff(track.y_m[images]))
    steps = steps[steps > 0.0]
    if len(steps) < 2 * MIN_IMAGES:
        return False
    low, middle, high = np.quantile(steps, (0.25, 0.5, 0.75))
    return bool(high - low < _EVEN_STEPS * middle)


def _backwards(track: Track, steady: list[Mounting]) -> Iterator[Finding]:
    offsets = np.array([each.offset_deg for each in steady])
    if len(steady) > 1 or abs(offsets[0]) < _ROUND_DEG:
        return
    timed = np.isfinite(track.time_s[steady[0].images]).all()
    yield Finding(
        "headings-flipped",
        "warning" if timed else "note",
        f"the only camera looks {abs(offsets[0]):.0f}° away from the direction of travel: it was "
        "mounted looking back, or all headings are turned by 180°"
        + ("" if timed else ", or names do not follow the order of travel (there are no times)"),
        uris_of(track.images, steady[0].images),
        '--mapping with [angles] heading_zero = "south", unless the camera did look back',
    )


def _flips(track: Track, mounting: Mounting, true_heading_deg: Floats) -> Iterator[Finding]:
    """Some images turned round against the others of their camera."""
    difference = np.full(len(track), np.nan)
    difference[mounting.images] = difference_deg(track, mounting, true_heading_deg)
    flipped: list[int] = []
    for run in track.sequences:
        images = run[np.isfinite(difference[run])]
        turned = np.abs(difference[images]) > _ROUND_DEG
        if turned.any() and _by_heading(track, images, turned):
            flipped += images[turned].tolist()
    straight = int((np.abs(difference[mounting.images]) < _NEAR_DEG).sum())
    if flipped and straight + len(flipped) >= 0.8 * len(mounting.images):
        yield Finding(
            "headings-flipped",
            "warning",
            f"{share(len(flipped), len(mounting.images))} headings of "
            f"{mounting.camera or 'the camera'} are turned by 180° against the others, measured "
            "from the direction of travel",
            uris_of(track.images, sorted(flipped)),
            "turn the headings of these rows by 180° in the table",
        )


def _by_heading(track: Track, images: Indices, turned: NDArray[np.bool_]) -> bool:
    """Whether it is the heading that turns where `turned` changes, not the travel.

    A vehicle that reverses changes its travel. A whole sequence may run against its names.
    """
    changes = np.flatnonzero(turned[1:] != turned[:-1])
    if not len(changes):
        return bool(np.isfinite(track.time_s[images]).all())
    before, after = images[changes], images[changes + 1]
    by_heading = np.abs(wrapped(track.heading_deg[after] - track.heading_deg[before]))
    by_travel = np.abs(wrapped(track.travel_deg[after] - track.travel_deg[before]))
    return bool((by_heading > by_travel).mean() > 0.5)
