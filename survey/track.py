"""The track of a moving camera: its sequences, and the direction it travels in.

A sequence is what one camera took in one go. Its images are in order of time, or of name where
they have no time, and neither a minute nor 100 m apart.
"""

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

import numpy as np
import pyproj
from numpy.typing import ArrayLike, NDArray

from contracts.config import North
from contracts.records import Pose, PosedImage
from geo.crs import parse_crs
from geo.headings import wrapped_360
from survey.fragments import parse_fragment
from survey.poses import is_geographic

_MAX_GAP_S = 60.0
_MAX_JUMP_M = 100.0
_MIN_IMAGES = 3
"""Two photographs are no track."""

_MIN_LEG_M = 1.0
_NEIGHBOURS = 10
"""How many positions before and after are looked at for one a leg away: 0.1 m a frame of a film."""
_TURNED_BACK_COSINE = -0.5
_ELLIPSOID = pyproj.Geod(ellps="WGS84")
_NUMBERS = re.compile(r"([0-9]+)")


def travel_direction_deg(x_m: ArrayLike, y_m: ArrayLike) -> NDArray[np.float64]:
    """Direction of travel at each position of one sequence, in order of travel.

    Each position is joined to the last one before and the first one after it that are at least
    1 m away, so that jitter does not count; the two legs are weighted as in the central
    difference of unequal steps, which is exact on a circle to second order.

    Parameters
    ----------
    x_m, y_m : (n,) metres, x east and y north.

    Returns
    -------
    direction_deg : (n,) float64 in [0, 360), clockwise from +y. NaN where the camera stands
        still (nothing among the 10 positions before and after is a metre away) or turns back.

    Raises
    ------
    ValueError : x and y are not (n,) alike.
    """
    positions = np.stack([np.asarray(x_m, np.float64), np.asarray(y_m, np.float64)], axis=-1)
    if positions.ndim != 2:
        raise ValueError(f"x and y must be (n,) alike; got {np.shape(x_m)} and {np.shape(y_m)}")
    arriving = -_legs(positions[::-1])[::-1]
    leaving = _legs(positions)
    arriving = np.where(np.isnan(arriving), leaving, arriving)
    leaving = np.where(np.isnan(leaving), arriving, leaving)
    length_in = np.linalg.norm(arriving, axis=1, keepdims=True)
    length_out = np.linalg.norm(leaving, axis=1, keepdims=True)
    heading_in, heading_out = arriving / length_in, leaving / length_out
    turned_back = (heading_in * heading_out).sum(axis=1) < _TURNED_BACK_COSINE
    ahead = heading_in * length_out + heading_out * length_in
    direction = wrapped_360(np.degrees(np.arctan2(ahead[:, 0], ahead[:, 1])))
    return np.where(turned_back, np.nan, direction)


def sequences(images: Sequence[PosedImage]) -> list[NDArray[np.int64]]:
    """Which images follow each other: indices, in order of travel, of each sequence.

    Images belong together that one camera took into one folder (or one topic of a file). They
    are ordered by `captured_at`, those without one by their uri with numbers counted as numbers;
    a gap of more than 60 s or 100 m begins a new sequence. In none are images without a pose, and
    those without a time whose names begin with `@`: they are in order of coordinates
    (survey/utm_names.py), not of travel.
    """
    of_camera: dict[tuple[object, bool], list[int]] = defaultdict(list)
    for at, image in enumerate(images):
        if image.pose is not None and not _named_by_place(image):
            of_camera[camera_key(image), image.captured_at is None].append(at)
    found: list[NDArray[np.int64]] = []
    for members in of_camera.values():
        order = np.array(sorted(members, key=lambda at: _order_key(images[at])), np.int64)
        taken = [images[at] for at in order]
        steps = np.hypot(*_steps_m([pose for image in taken if (pose := image.pose)]))
        pause = np.diff([_seconds(image) for image in taken]) > _MAX_GAP_S
        found += np.split(order, np.flatnonzero(pause | (steps > _MAX_JUMP_M)) + 1)
    return sorted(found, key=lambda sequence: int(sequence.min()))


def camera_key(image: PosedImage) -> tuple[object, ...]:
    """What images of one camera in one folder, or in one topic of one file, have in common."""
    fragment = parse_fragment(image.fragment)
    message = fragment.message
    place = image.uri.rpartition("/")[0] if message is None else (image.path, message.topic)
    return place, image.camera.name, fragment.view


def with_track_headings(images: Sequence[PosedImage], crs: str) -> tuple[PosedImage, ...]:
    """The same images; those of a sequence that have no heading look where the track leads.

    Such a heading is marked as derived. It counts from true north where `crs`, that of every
    pose, is in degrees, else from grid north. Sequences of fewer than three images are left as
    they are, and so is an image where the camera stood still or turned back.
    """
    derived = list(images)
    north: North = "true" if is_geographic(crs) else "grid"
    for sequence in sequences(images):
        poses = [pose for at in sequence if (pose := images[at].pose)]
        if len(poses) < _MIN_IMAGES or all(pose.heading_deg is not None for pose in poses):
            continue
        x_m, y_m = (np.concatenate([[0.0], np.cumsum(step)]) for step in _steps_m(poses))
        for at, pose, direction in zip(
            sequence, poses, travel_direction_deg(x_m, y_m), strict=True
        ):
            if pose.heading_deg is None and np.isfinite(direction):
                looking = replace(
                    pose, heading_deg=float(direction), north=north, heading_derived=True
                )
                derived[at] = replace(images[at], pose=looking)
    return tuple(derived)


def _legs(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2) from each position to the first later one a leg away, NaN where there is none."""
    legs = np.full_like(positions, np.nan)
    for step in range(1, min(_NEIGHBOURS, len(positions) - 1) + 1):
        candidate = positions[step:] - positions[:-step]
        open_leg = np.isnan(legs[:-step, 0]) & (np.linalg.norm(candidate, axis=1) >= _MIN_LEG_M)
        legs[:-step][open_leg] = candidate[open_leg]
    return legs


def _steps_m(poses: Sequence[Pose]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(n - 1,) metres east and north from each pose to the next.

    On degrees each step is measured on the ellipsoid, from true north where it begins: one flat
    frame for a long track would turn its north by degrees.
    """
    x = np.array([pose.easting for pose in poses], np.float64)
    y = np.array([pose.northing for pose in poses], np.float64)
    if not is_geographic(poses[0].crs):
        unit_m = float(parse_crs(poses[0].crs).axis_info[0].unit_conversion_factor)
        return np.diff(x) * unit_m, np.diff(y) * unit_m
    azimuth_deg, _, length_m = _ELLIPSOID.inv(x[:-1], y[:-1], x[1:], y[1:])
    azimuth = np.radians(azimuth_deg)
    return np.asarray(length_m * np.sin(azimuth)), np.asarray(length_m * np.cos(azimuth))


def _named_by_place(image: PosedImage) -> bool:
    return image.captured_at is None and image.uri.rpartition("/")[2].startswith("@")


def _order_key(image: PosedImage) -> tuple[float, list[str | int], str]:
    return _seconds(image), natural_key(image.uri), image.uri


def natural_key(uri: str) -> list[str | int]:
    """By which uris sort as people number them: `9.jpg` before `10.jpg`."""
    return [int(piece) if at % 2 else piece for at, piece in enumerate(_NUMBERS.split(uri))]


def _seconds(image: PosedImage) -> float:
    """Seconds since 1970; 0 for every image without a time."""
    if image.captured_at is None:
        return 0.0
    return datetime.fromisoformat(image.captured_at).timestamp()
