"""How each camera looks against the direction of travel, and how steadily it does."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from survey.doctor.circular import deviation, main_direction, wrapped
from survey.doctor.track import Floats, Indices, Track

MIN_IMAGES = 10
"""Fewer images on the move say nothing of a camera."""

_STEEP_DEG = 60.0
"""A camera that looks so far up or down has no heading worth comparing."""


@dataclass(frozen=True, slots=True)
class Mounting:
    """One camera on the move.

    images : (m,) int64, those with a measured heading and a direction of travel.
    offset_deg : heading from true north less travel, most common, [-180, 180].
    spread_deg : robust standard deviation about it.
    """

    camera: str
    images: Indices
    offset_deg: float
    spread_deg: float


def mountings(track: Track, true_heading_deg: Floats) -> tuple[Mounting, ...]:
    """The cameras with enough images on the move, in order of their names."""
    found: list[Mounting] = []
    difference = true_heading_deg - track.travel_deg
    for camera, images in moving_images(track):
        known = images[np.isfinite(difference[images])]
        if len(known) >= MIN_IMAGES:
            offset = main_direction(difference[known])
            spread = deviation(difference[known], offset)
            found.append(Mounting(track.cameras[camera], known, offset, spread))
    return tuple(found)


def moving_images(track: Track) -> Iterator[tuple[int, Indices]]:
    """Of each camera that does not look steeply up or down: images with heading and travel."""
    measured = np.array(
        [image.pose is not None and not image.pose.heading_derived for image in track.images]
    )
    known = measured & np.isfinite(track.heading_deg) & np.isfinite(track.travel_deg)
    for camera in range(len(track.cameras)):
        images = np.flatnonzero(known & (track.camera == camera)).astype(np.int64)
        if len(images) and looks_level(track.pitch_deg[images]):
            yield camera, images


def difference_deg(track: Track, mounting: Mounting, true_heading_deg: Floats) -> Floats:
    """(m,) heading less travel less the camera's offset, [-180, 180)."""
    images = mounting.images
    return wrapped(true_heading_deg[images] - track.travel_deg[images] - mounting.offset_deg)


def looks_level(pitch_deg: NDArray[np.float64]) -> bool:
    """Whether a camera's pitches, NaN where not known, are those of one that sees the street."""
    known = pitch_deg[np.isfinite(pitch_deg)]
    return not len(known) or abs(float(np.median(known))) < _STEEP_DEG
