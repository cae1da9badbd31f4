"""Pitch and roll: where they count from, and whether they were measured at all."""

from collections.abc import Iterator

import numpy as np

from survey.doctor.findings import Finding, share
from survey.doctor.track import Floats, Track

_STEEP_DEG = 60.0
_MIN_IMAGES = 5
_ROUND_DEG = 1e-6


def check_angles(track: Track) -> Iterator[Finding]:
    """Pitch of the horizon, constant pitch and roll, images upside down."""
    pitch = track.pitch_deg[np.isfinite(track.pitch_deg)]
    roll = track.roll_deg[np.isfinite(track.roll_deg)]
    if not len(pitch):
        yield Finding("pitch", "note", "no image has a pitch: cameras are taken as level")
        return
    if len(pitch) >= _MIN_IMAGES:
        yield from _steep(track)
        if np.ptp(pitch) < _ROUND_DEG and (not len(roll) or np.ptp(roll) < _ROUND_DEG):
            yield Finding(
                "pitch",
                "note",
                f"pitch is {pitch[0]:g}° for all {len(pitch):,} images: it was hardly measured",
            )
    if len(roll) >= _MIN_IMAGES and (turned := int((np.abs(roll) > 135.0).sum())) > len(roll) / 2:
        yield Finding(
            "roll",
            "warning",
            f"{share(turned, len(roll))} images stand on their head (roll beyond 135°): cameras "
            "mounted so, or roll counted from elsewhere",
            mend="--mapping with [angles] roll_sense, if roll is not right side down",
        )


def _steep(track: Track) -> Iterator[Finding]:
    """One camera may look at the sky; that all do is a matter of where pitch begins."""
    medians = [
        float(np.median(known))
        for camera in range(len(track.cameras))
        if len(known := _known(track, camera))
    ]
    if min(medians) > _STEEP_DEG:
        yield Finding(
            "pitch-zero",
            "error",
            f"every camera looks steeply up (pitch {min(medians):.0f}° to {max(medians):.0f}°, "
            "median of each): pitch seems to count from straight down, with the horizon at 90°",
            mend='--mapping with [angles] pitch_zero = "nadir"',
        )
    elif max(medians) < -_STEEP_DEG:
        yield Finding(
            "pitch-zero",
            "warning",
            f"every camera looks steeply down (pitch {min(medians):.0f}° to {max(medians):.0f}°, "
            "median of each): an aerial survey, or pitch does not count from the horizon",
            mend="--mapping with [angles] pitch_zero, unless cameras do look down",
        )


def _known(track: Track, camera: int) -> Floats:
    pitch = track.pitch_deg[track.camera == camera]
    return np.asarray(pitch[np.isfinite(pitch)])
