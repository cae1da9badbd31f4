"""A survey in a few numbers, and what an index of it will cost."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contracts.records import PosedImage
from survey.doctor.positions import station_steps_m
from survey.doctor.times import day
from survey.doctor.track import Track, camera_labels, seconds

CORE_SECONDS_AN_IMAGE = 2.1
BYTES_AN_IMAGE = 54_000
BYTES_OF_CODEBOOKS = 62_000_000
COST_MEASURED_ON = (
    "0.95 images/s with two processes (135 Stereopolis images), 54 kB an image and 62 MB of "
    "codebooks (503 images), all detectors and descriptors, 1,000 frames, 20,000 words"
)


@dataclass(frozen=True, slots=True)
class Figures:
    """What there is. None: not known.

    images, skipped, posed : counts. cameras : names, or what tells file names apart.
    first_day, last_day : UTC. days : on which images were taken. extent_m : east and north.
    bounds_deg : west, south, east, north in WGS 84; west is above east across longitude 180.
    track_m : along the sequences. spacing_m : median between places.
    core_hours, index_bytes : by `COST_MEASURED_ON`.
    """

    images: int
    skipped: int
    posed: int
    cameras: tuple[str, ...]
    first_day: str | None
    last_day: str | None
    days: int
    extent_m: tuple[float, float] | None
    bounds_deg: tuple[float, float, float, float] | None
    track_m: float | None
    spacing_m: float | None
    core_hours: float
    index_bytes: int


def figures_of(images: Sequence[PosedImage], n_skipped: int, track: Track | None) -> Figures:
    """Count and measure."""
    times = np.array([seconds(image) for image in images])
    days = sorted({day(time_s) for time_s in times[np.isfinite(times)]})
    steps = None if track is None else station_steps_m(track)
    return Figures(
        images=len(images),
        skipped=n_skipped,
        posed=0 if track is None else len(track),
        cameras=tuple(sorted(set(camera_labels(images)))),
        first_day=days[0] if days else None,
        last_day=days[-1] if days else None,
        days=len(days),
        extent_m=None if track is None else (_range(track.x_m), _range(track.y_m)),
        bounds_deg=None if track is None else _bounds(track),
        track_m=None if steps is None else float(steps.sum()),
        spacing_m=float(np.median(steps)) if steps is not None and len(steps) else None,
        core_hours=len(images) * CORE_SECONDS_AN_IMAGE / 3600.0,
        index_bytes=len(images) * BYTES_AN_IMAGE + BYTES_OF_CODEBOOKS if images else 0,
    )


def _range(values: np.ndarray) -> float:
    return float(np.ptp(values))


def _bounds(track: Track) -> tuple[float, float, float, float]:
    lon, lat = track.lon_deg, track.lat_deg
    if np.ptp(lon) > 180.0:
        west, east = lon[lon > 0.0].min(), lon[lon <= 0.0].max()
    else:
        west, east = lon.min(), lon.max()
    return float(west), float(lat.min()), float(east), float(lat.max())
