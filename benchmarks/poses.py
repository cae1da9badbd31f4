"""How fast poses are placed: longitude, latitude, height, convergence, declination, true heading.

Poses are spread at random over a town and a year, and placed all at once in one thread. What is
kept from call to call, operations and declinations, is found by the first to need it.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from benchmarks.table import print_table
from geo import magnetic
from geo.crs import ToWgs84
from geo.headings import true_headings_deg
from geo.rotations import hpr_from_rotations, rotations_from_hpr

_POSES = 100_000
_TOWNS = {
    "EPSG:2154 (Lambert-93, Paris)": (652_000.0, 6_861_000.0, 10_000.0),
    "EPSG:32631 (UTM, Paris)": (452_000.0, 5_411_000.0, 10_000.0),
    "EPSG:27700 (British grid, seven parameters, London)": (530_000.0, 180_000.0, 10_000.0),
    "EPSG:27572 (NTF from the meridian of Paris, Paris)": (600_000.0, 2_428_000.0, 10_000.0),
    "EPSG:2056 (LV95, Zurich)": (2_683_000.0, 1_247_000.0, 10_000.0),
    "EPSG:4979 (degrees and heights, Paris)": (2.35, 48.85, 0.1),
}
"""South-west corner and side of each town, in the unit of its system."""

Result = TypeVar("Result")


def run(data: Path) -> None:
    """Print the seconds of each step, and poses a second of all together."""
    del data
    rng = np.random.default_rng(0)
    print_table(
        (f"{_POSES:,} poses", "positions", "convergence", "declination", "heading", "poses/s"),
        [_placed(name, *town, rng) for name, town in _TOWNS.items()],
    )
    print()
    angles = [rng.uniform(-80.0, 80.0, _POSES) for _ in range(3)]
    matrices, there_s = _timed(lambda: rotations_from_hpr(*angles))
    _, back_s = _timed(lambda: hpr_from_rotations(matrices))
    print_table(
        (f"{_POSES:,} attitudes", "to matrices", "back"),
        [("heading, pitch, roll", _seconds(there_s), _seconds(back_s))],
    )


def _placed(
    name: str, east: float, north: float, side: float, rng: np.random.Generator
) -> tuple[str, ...]:
    x, y = east + rng.uniform(0.0, side, _POSES), north + rng.uniform(0.0, side, _POSES)
    altitude, year = rng.uniform(20.0, 120.0, _POSES), rng.uniform(2021.0, 2022.0, _POSES)
    heading = rng.uniform(0.0, 360.0, _POSES)
    crs = name.split()[0]
    place, over_s = _timed(lambda: ToWgs84.over(crs, x, y))
    (lon, lat, height), positions_s = _timed(lambda: place.positions(x, y, altitude))
    convergence, convergence_s = _timed(lambda: place.convergence_deg(x, y))
    declination, declination_s = _timed(lambda: magnetic.declination_deg(lon, lat, height, year))
    _, heading_s = _timed(lambda: true_headings_deg(heading, "magnetic", convergence, declination))
    steps = (over_s + positions_s, convergence_s, declination_s, heading_s)
    return (name, *map(_seconds, steps), f"{_POSES / sum(steps):,.0f}")


def _timed(work: Callable[[], Result]) -> tuple[Result, float]:
    started = time.perf_counter()
    found = work()
    return found, time.perf_counter() - started


def _seconds(duration_s: float) -> str:
    return f"{duration_s:.3f} s"
