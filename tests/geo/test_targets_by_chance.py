"""How often cameras around a square give what they look at, and cameras at random give anything."""

from collections.abc import Callable

import numpy as np

from geo.frames import LocalMetres
from geo.sightlines import LonLatTarget, target_lon_lat

SQUARE = LocalMetres(2.3461, 48.8462)
SCORES = np.linspace(1.0, 0.6, 10)

Cameras = tuple[np.ndarray, np.ndarray, np.ndarray]
"""x east, y north in metres from the middle of the square, heading in degrees; (10,) each."""


def at_random(rng: np.random.Generator) -> Cameras:
    return rng.uniform(-150, 150, 10), rng.uniform(-150, 150, 10), rng.uniform(0, 360, 10)


def seven_look_at_it(rng: np.random.Generator) -> Cameras:
    """From 40 to 120 m away, up to 20 degrees past the middle; the other three at random."""
    x, y, heading = at_random(rng)
    members = rng.permutation(10)[:7]
    bearing, away_m = rng.uniform(0, 360, 7), rng.uniform(40, 120, 7)
    x[members] = away_m * np.sin(np.radians(bearing))
    y[members] = away_m * np.cos(np.radians(bearing))
    heading[members] = (bearing + 180.0 + rng.uniform(-20, 20, 7)) % 360.0
    return x, y, heading


def targets(draw: Callable[[np.random.Generator], Cameras], n: int) -> list[LonLatTarget]:
    rng = np.random.default_rng(0)
    found = []
    for _ in range(n):
        x, y, heading = draw(rng)
        found.append(target_lon_lat(*SQUARE.to_lon_lat(x, y), heading, np.full(10, 60.0), SCORES))
    return [target for target in found if target is not None]


def test_of_ten_cameras_around_a_square_seven_that_look_at_it_nearly_always_give_it() -> None:
    found = targets(seven_look_at_it, 100)
    assert len(found) >= 85
    x, y = SQUARE.from_lon_lat([t.lon_deg for t in found], [t.lat_deg for t in found])
    off_m = np.hypot(x, y)
    assert np.median(off_m) < 25.0
    assert np.mean(off_m <= [target.radius_m for target in found]) >= 0.65


def test_ten_cameras_that_have_nothing_in_common_hardly_ever_give_a_target() -> None:
    assert len(targets(at_random, 150)) <= 8
