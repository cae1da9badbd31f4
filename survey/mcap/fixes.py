"""Positions of a satellite receiver at the moments of images."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from survey.mcap.tracks import Asked, Bracket, Floats, Samples, Track, bracket, values_at


@dataclass(frozen=True, slots=True)
class FixAt:
    """The fixes of a topic at m moments.

    position : (m, 3) float64, longitude, latitude, height; NaN: not known, as in error_m and
    heading_deg, (m,) each.
    """

    topic: str
    frame: str
    around: Bracket
    position: Floats
    error_m: Floats
    heading_deg: Floats

    def order(self, camera_frame: str) -> tuple[bool, int, float, str, str]:
        """What is least for the best source of a camera's positions."""
        error = self.error_m[np.isfinite(self.error_m)]
        return (
            not (self.frame and self.frame == camera_frame),
            -int(self.around.within.sum()),
            float(np.median(error)) if error.size else np.inf,
            self.topic,
            self.frame,
        )


def fixes_at(fixes: Mapping[tuple[str, str], Samples], asked: Asked) -> list[FixAt]:
    """Of every topic and frame, linear between messages; see `survey.mcap.recording.Recording`."""
    found = []
    for (topic, frame), samples in fixes.items():
        track = samples.track()
        around = bracket(track.times_ns, asked)
        # Across longitude 180 the short way round.
        values = track.values.copy()
        values[:, 0] = np.unwrap(values[:, 0], period=360.0)
        values = values_at(Track(track.times_ns, values), around)
        position = values[:, :3]
        position[:, 0] = (position[:, 0] + 180.0) % 360.0 - 180.0
        if not track.values[:, 2].any():  # protobuf has no other word for a height not known
            position[:, 2] = np.nan
        errors = track.values[:, 3]
        error_m = np.maximum(errors[around.before], errors[around.after])
        heading_deg = np.degrees(np.arctan2(values[:, 4], values[:, 5]))
        found.append(FixAt(topic, frame, around, position, error_m, heading_deg))
    return found
