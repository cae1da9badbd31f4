"""Which north headings count from: grid, true or magnetic, as the track shows it."""

from collections.abc import Iterator, Sequence

import numpy as np

from contracts.config import North
from survey.caveats import WHY_NO_DECLINATION, without_declination
from survey.doctor.circular import circular_mean, wrapped
from survey.doctor.findings import Finding, share, uris_of
from survey.doctor.mountings import Mounting, mountings
from survey.doctor.readings import misread_headings
from survey.doctor.track import Floats, Track

_FOLDS = (4, 5, 6, 8)
"""Rigs look to equal parts of a circle: 4, 5 (Ladybug), 6 or 8."""
_RIG_AGREES_DEG = 2.0
_MIRRORS_DEG = 2.0 * _RIG_AGREES_DEG
_STEADY_DEG = 12.0
_MIN_IMAGES = 20
_INDEPENDENT_EVERY = 5
"""Neighbours share the noise of their positions: so many count as one."""
_TELLING_DEG = 1.5
_EXPLAINED = 0.35


def check_norths(track: Track) -> Iterator[Finding]:
    """Whether all cameras are off by what another north would be off.

    One camera may be mounted askew by that much: only a rig of three or more earns a warning.
    """
    if not np.isfinite(track.heading_deg).any():
        return
    yield from _lost_magnetic(track)
    if misread_headings(track) is not None:
        return
    corrections = corrections_deg(track)
    steady = [
        mounting
        for mounting in mountings(track, true_headings(track))
        if mounting.spread_deg < _STEADY_DEG and len(mounting.images) >= _MIN_IMAGES
    ]
    if not steady:
        return
    off = _common_offset_deg([mounting.offset_deg for mounting in steady])
    if off is None:
        yield Finding(
            "north",
            "note",
            "which north headings count from cannot be told from how the cameras are mounted: only "
            "equal parts of a circle, or one ahead and others alike to its left and right, tell it",
        )
        return
    stated = _stated_north(track)
    usable = {
        name: float(np.nanmean(wrapped(turn - corrections[stated])))
        for name, turn in corrections.items()
        if name != stated and np.isfinite(turn).any()
    }
    error = _standard_error_deg(steady)
    yield from _other_north(off, error, stated, usable, len(steady))
    if "magnetic" not in usable and stated != "magnetic":
        yield Finding(
            "north",
            "note",
            "magnetic against true north cannot be told: the declination is not known without "
            "the images' dates",
        )


def _lost_magnetic(track: Track) -> Iterator[Finding]:
    """Magnetic headings of a place or day whose declination is not known: results have none."""
    lost = without_declination(track.images, track.declination_deg)
    if not lost.any():
        return
    yield Finding(
        "north-unknown",
        "warning",
        f"{share(int(lost.sum()), len(track))} headings count from magnetic north, and "
        f"{WHY_NO_DECLINATION}",
        uris_of(track.images, np.flatnonzero(lost)),
        "times in the survey; or --north true or grid, if they were corrected already",
    )


def true_headings(track: Track) -> Floats:
    """(n,) headings clockwise from true north, as the survey states them; NaN: not known."""
    corrections = corrections_deg(track)
    stated = np.array([image.pose.north if image.pose else "" for image in track.images])
    true = np.full(len(track), np.nan)
    for north, turn in corrections.items():
        true = np.where(stated == north, (track.heading_deg + turn) % 360.0, true)
    return true


def corrections_deg(track: Track) -> dict[North, Floats]:
    """(n,) what is added to a heading from each north to have it from true north.

    True before grid: on degrees they are the same, and there is no grid to speak of.
    """
    return {
        "true": np.zeros(len(track)),
        "grid": track.convergence_deg,
        "magnetic": track.declination_deg,
    }


def _stated_north(track: Track) -> North:
    stated = [image.pose.north for image in track.images if image.pose]
    norths: tuple[North, ...] = ("grid", "true", "magnetic")
    return max(norths, key=stated.count)


def _common_offset_deg(offsets_deg: Sequence[float]) -> float | None:
    """By how much a whole rig is turned, None if its shape does not tell.

    Rigs look to equal parts of a circle that begin ahead, or as far to the left as to the right.
    """
    offsets = np.array(offsets_deg)
    for fold in _FOLDS:
        common = circular_mean(offsets * fold) / fold
        if np.abs(wrapped((offsets - common) * fold)).max() / fold <= _RIG_AGREES_DEG:
            return common
    ahead = float(offsets[np.argmin(np.abs(offsets))])
    left_to_right = np.sort(wrapped(offsets - ahead))
    if len(offsets) >= 3 and np.abs(left_to_right + left_to_right[::-1]).max() <= _MIRRORS_DEG:
        return ahead + float(left_to_right.mean())
    return None


def _standard_error_deg(steady: Sequence[Mounting]) -> float:
    n_images = sum(len(mounting.images) for mounting in steady)
    spread = float(np.mean([mounting.spread_deg for mounting in steady]))
    return spread / float(np.sqrt(max(1.0, n_images / _INDEPENDENT_EVERY)))


def _other_north(
    off: float, error: float, stated: North, usable: dict[North, float], n_cameras: int
) -> Iterator[Finding]:
    if not usable:
        return
    best = min(usable, key=lambda name: abs(off + usable[name]))
    left = off + usable[best]
    if abs(off) > max(_TELLING_DEG, 4.0 * error) and abs(left) < _EXPLAINED * abs(off):
        rig = n_cameras >= 3
        yield Finding(
            "north",
            "warning" if rig else "note",
            f"{'all cameras are' if rig else 'the camera is'} turned by {off:+.1f}° (± "
            f"{2.0 * error:.1f}°) from the direction of travel; headings are read from {stated} "
            f"north, and counted from {best} north {left:+.1f}° would remain"
            + ("" if rig else "; a camera mounted askew would look the same"),
            mend=f"--north {best}",
        )
        return
    widest = max(usable.values(), key=abs)
    if abs(off) > max(_TELLING_DEG, 4.0 * error):
        yield Finding(
            "north",
            "note",
            f"{'all cameras are' if n_cameras > 1 else 'the camera is'} turned by {off:+.1f}° (± "
            f"{2.0 * error:.1f}°) from the direction of travel, which no other north explains (by "
            f"{abs(widest):.1f}° at most): mounted so, or the headings have an offset",
        )
    elif abs(widest) < max(_TELLING_DEG, 4.0 * error):
        yield Finding(
            "north",
            "note",
            f"which north headings count from ({stated} here) cannot be told from the track: the "
            f"others differ by {abs(widest):.1f}° at most",
        )
