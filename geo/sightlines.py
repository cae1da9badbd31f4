"""What the photographer looked at: where the matches' lines of sight meet.

RECONSTRUCTION: the paper's Fig. 4 shows seven of ten marks around the Pantheon; what they share is
not where they stand but what they see.

1. A match with a measured heading gives a ray from its camera. What the camera saw may stand
   anywhere in its field of view, not only in the middle: a place that is theta off the axis is
   seen with the biweight (1 - (theta / (hfov / 2))^2)^2, up to `MOST_RANGE_M` away, and nothing
   is seen behind the camera.
2. Rays from one standpoint in one direction are one voice, that of the heaviest: side by side they
   see the same for the same reason, a street's whole side of it, and their crossing is noise.
3. The seed is the crossing of two axes that is seen with most weight, among those that enough
   voices share; all are tried, a RANSAC (Fischler & Bolles, CACM 24(6), 1981) without chance. A
   match weighs as in the estimate.
4. The target is refined by iteratively reweighted least squares of theta with the same weights
   (Beaton & Tukey, Technometrics 16(2), 1974); what one camera says across its axis is uncertain
   by hfov / sqrt(12), as of a thing that may be anywhere in its view.
5. It is given where three voices or more see it, from two places or more, and more than half of
   them all, and where they cross well enough to know how far away it is.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geo.estimate import match_weights
from geo.frames import LocalMetres

MOST_RANGE_M = 300.0
"""Farther things are landmarks on the horizon; a street hides them."""
ASSUMED_HFOV_DEG = 60.0
"""Of a camera whose field of view is not known: an ordinary wide lens."""
MOST_HFOV_DEG = 150.0
"""A wider view looks everywhere, and its axis says nothing."""
LEAST_VOICES = 3
"""Two rays always cross somewhere."""
SAME_REACH_M, SAME_TURN_DEG = 25.0, 30.0
"""Rays that start and point closer than this are one voice."""
LEAST_BASE_M = 3.0
"""Two cameras that are closer stand in one place."""
MOST_RADIUS_M = 60.0
_LEAST_RANGE_M = 1.0
_RADIUS_68 = 1.5096
"""Radius of 68 % of a round two-dimensional normal distribution: sqrt(-2 ln 0.32)."""
_MAX_STEPS = 50
_STEP_TOLERANCE_M = 1e-4


@dataclass(frozen=True, slots=True)
class Rays:
    """Lines of sight in a flat frame of metres.

    origin : (n, 2) x east, y north. heading_rad, half_view_rad : (n,) clockwise from y; half the
    field of view. weight : (n,) positive.
    """

    origin: NDArray[np.float64]
    heading_rad: NDArray[np.float64]
    half_view_rad: NDArray[np.float64]
    weight: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Target:
    """What the rays share, in their frame. radius_m : it lies within, with 68 %. support : rays."""

    x_m: float
    y_m: float
    radius_m: float
    support: int


@dataclass(frozen=True, slots=True)
class LonLatTarget:
    """The same in WGS 84 degrees; see `Target`."""

    lon_deg: float
    lat_deg: float
    radius_m: float
    support: int


def target_lon_lat(
    lon_deg: ArrayLike,
    lat_deg: ArrayLike,
    heading_deg: ArrayLike,
    hfov_deg: ArrayLike,
    scores: ArrayLike,
) -> LonLatTarget | None:
    """What the matches of a ranking look at, whatever their order.

    Parameters
    ----------
    lon_deg, lat_deg : (n,) float64 degrees in WGS 84; not finite: a match without pose.
    heading_deg : (n,) float64 degrees clockwise from true north, of the optical axis; not finite:
        not measured, and so no ray.
    hfov_deg : (n,) float64 degrees; not finite: not known, taken as `ASSUMED_HFOV_DEG`.
    scores : (n,) float64, higher = better.

    Returns
    -------
    LonLatTarget, or None when the rays share nothing or do not tell how far away it is.

    Raises
    ------
    ValueError : the lengths differ, or a score is not finite.
    """
    columns = [
        np.asarray(each, np.float64) for each in (lon_deg, lat_deg, heading_deg, hfov_deg, scores)
    ]
    lon, lat, heading, hfov, score = columns
    if len({each.shape for each in columns}) > 1 or not np.isfinite(score).all():
        raise ValueError(
            "a target takes longitude, latitude, heading, field of view and a finite score of "
            f"each match; got {', '.join(str(each.shape) for each in columns)}"
        )
    view = np.where(np.isfinite(hfov), hfov, ASSUMED_HFOV_DEG)
    weight = match_weights(score)
    seen = np.isfinite(lon) & np.isfinite(lat) & np.isfinite(heading)
    seen &= (weight > 0.0) & (view > 0.0) & (view <= MOST_HFOV_DEG)
    if np.count_nonzero(seen) < LEAST_VOICES:
        return None
    # One order for all: the sums are then the same for every order of the matches.
    at = np.flatnonzero(seen)
    at = at[np.lexsort((view[at], heading[at], lat[at], lon[at], -weight[at]))]
    frame = LocalMetres(float(lon[at[0]]), float(lat[at[0]]))
    origin = np.column_stack(frame.from_lon_lat(lon[at], lat[at]))
    heading_rad = np.radians(heading[at]) + _north_rad(frame, lon[at], lat[at])
    found = target(Rays(origin, heading_rad, np.radians(view[at]) / 2.0, weight[at]))
    if found is None:
        return None
    lon_found, lat_found = frame.to_lon_lat([found.x_m], [found.y_m])
    return LonLatTarget(float(lon_found[0]), float(lat_found[0]), found.radius_m, found.support)


def target(rays: Rays) -> Target | None:
    """Where rays meet that share what they see; None when they do not, or not well enough.

    rays : heaviest first.
    """
    voices = _voices(rays)
    seed = _best_crossing(voices)
    if seed is None:
        return None
    place = _refined(voices, seed)
    if not _shared(voices, _sight(voices, place) > 0.0):
        return None
    radius_m = _radius_m(voices, place)
    if radius_m > MOST_RADIUS_M:
        return None
    support = int(np.count_nonzero(_sight(rays, place)))
    return Target(float(place[0]), float(place[1]), radius_m, support)


def _voices(rays: Rays) -> Rays:
    """Without the rays that start and point like a heavier one."""
    kept: list[int] = []
    for at, (origin, heading) in enumerate(zip(rays.origin, rays.heading_rad, strict=True)):
        apart = rays.origin[kept] - origin
        turned = _wrapped_rad(rays.heading_rad[kept] - heading)
        near = np.hypot(apart[:, 0], apart[:, 1]) < SAME_REACH_M
        if not (near & (np.abs(turned) < math.radians(SAME_TURN_DEG))).any():
            kept.append(at)
    return Rays(
        rays.origin[kept], rays.heading_rad[kept], rays.half_view_rad[kept], rays.weight[kept]
    )


def _north_rad(
    frame: LocalMetres, lon_deg: NDArray[np.float64], lat_deg: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n,) how true north at some points is turned in the frame, clockwise: much near a pole."""
    # Towards the equator there is always a point to look at.
    step_deg = -np.copysign(1e-4, lat_deg)
    x, y = frame.from_lon_lat(lon_deg, lat_deg)
    other_x, other_y = frame.from_lon_lat(lon_deg, lat_deg + step_deg)
    away = np.sign(step_deg)
    return np.asarray(np.arctan2(away * (other_x - x), away * (other_y - y)))


def _shared(voices: Rays, sees: NDArray[np.bool_]) -> bool:
    """Whether those who see it are enough, most of all, and not all of one place."""
    if np.count_nonzero(sees) < LEAST_VOICES or sees.mean() <= 0.5:
        return False
    apart = voices.origin[sees] - voices.origin[sees][0]
    return bool((np.hypot(apart[:, 0], apart[:, 1]) >= LEAST_BASE_M).any())


def _best_crossing(rays: Rays) -> NDArray[np.float64] | None:
    """(2,) the crossing of two axes, before both cameras, that is shared with most weight."""
    ahead = np.column_stack([np.sin(rays.heading_rad), np.cos(rays.heading_rad)])
    best, most = None, 0.0
    for one, other in itertools.combinations(range(len(ahead)), 2):
        sine = ahead[one, 0] * ahead[other, 1] - ahead[one, 1] * ahead[other, 0]
        if abs(sine) < 1e-6:
            continue
        base = rays.origin[other] - rays.origin[one]
        along = (base[0] * ahead[other, 1] - base[1] * ahead[other, 0]) / sine
        back = (base[0] * ahead[one, 1] - base[1] * ahead[one, 0]) / sine
        if min(along, back) < _LEAST_RANGE_M or max(along, back) > MOST_RANGE_M:
            continue
        crossing = rays.origin[one] + along * ahead[one]
        sight = _sight(rays, crossing)
        seen = float((rays.weight * sight).sum())
        if seen > most and _shared(rays, sight > 0.0):
            best, most = crossing, seen
    return best


def _refined(rays: Rays, seed: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2,) where the weighted squares of the angles off the axes are least, near the seed."""
    place = seed
    for _ in range(_MAX_STEPS):
        sight = rays.weight * _sight(rays, place)
        off, slopes = _off_axis(rays, place), _slopes(rays, place)
        normal = (slopes * sight[:, None]).T @ slopes
        # The seed's own rays cross, but the reweighted ones may all be parallel.
        step, *_ = np.linalg.lstsq(normal, -(slopes * sight[:, None]).T @ off, rcond=1e-9)
        length = float(np.hypot(step[0], step[1]))
        step *= min(1.0, 0.2 * MOST_RANGE_M / max(length, _STEP_TOLERANCE_M))
        moved = place + step
        if not (_sight(rays, moved) > 0.0).any():
            break
        place = moved
        if length < _STEP_TOLERANCE_M:
            break
    return place


def _radius_m(rays: Rays, place: NDArray[np.float64]) -> float:
    """Radius of 68 %, round the longer axis of the error's ellipse; infinite for parallel rays."""
    sight = _sight(rays, place)
    slopes = _slopes(rays, place) / (rays.half_view_rad / np.sqrt(3.0))[:, None]
    least = float(np.linalg.eigvalsh((slopes * sight[:, None]).T @ slopes)[0])
    return _RADIUS_68 / math.sqrt(least) if least > 0.0 else math.inf


def _sight(rays: Rays, place: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) in [0, 1]: how well each camera has a place in view; 0: not at all."""
    apart = place - rays.origin
    range_m = np.hypot(apart[:, 0], apart[:, 1])
    inner = np.maximum(0.0, 1.0 - (_off_axis(rays, place) / rays.half_view_rad) ** 2) ** 2
    return np.where((range_m >= _LEAST_RANGE_M) & (range_m <= MOST_RANGE_M), inner, 0.0)


def _off_axis(rays: Rays, place: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) radians from each axis to a place, clockwise, within [-pi, pi]."""
    apart = place - rays.origin
    bearing = np.arctan2(apart[:, 0], apart[:, 1])
    return _wrapped_rad(bearing - rays.heading_rad)


def _wrapped_rad(turn_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same turns within [-pi, pi]."""
    return np.asarray((turn_rad + np.pi) % (2.0 * np.pi) - np.pi)


def _slopes(rays: Rays, place: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2) how the bearing of a place turns, radians a metre, as it moves east and north."""
    apart = place - rays.origin
    squared = np.maximum((apart**2).sum(axis=1), _LEAST_RANGE_M**2)
    return np.asarray(np.column_stack([apart[:, 1], -apart[:, 0]]) / squared[:, None])
