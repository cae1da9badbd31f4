"""The posed images of a survey as arrays, ready for all checks of positions, headings and times."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray

from contracts.records import Pose, PosedImage
from geo.crs import ToWgs84
from geo.frames import LocalMetres
from geo.magnetic import decimal_years, declination_deg
from survey.track import natural_key, sequences, travel_direction_deg

_NUMBERS = re.compile(r"([0-9]+)")
_MOST_PATTERNS = 16

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Track:
    """Posed images as columns of length n, in order of their uris; NaN: not known.

    x_m, y_m : east and north of the survey's middle. heading_deg : as stated, clockwise from the
    `north` of each pose. travel_deg : direction of travel, clockwise from true north.
    convergence_deg, declination_deg : bearing of grid and of magnetic north from true north.
    place : the survey's system, for where it lies. time_s : seconds since 1970, UTC.
    camera : (n,) int64 into `cameras`. order : (n,) int64, by camera, then time, then name;
    previous : (n,) int64, who came before in that order, -1 for a camera's first.
    sequences : which images follow each other without a gap (survey/track.py).
    """

    images: tuple[PosedImage, ...]
    place: ToWgs84
    lon_deg: Floats
    lat_deg: Floats
    x_m: Floats
    y_m: Floats
    altitude_m: Floats
    heading_deg: Floats
    pitch_deg: Floats
    roll_deg: Floats
    travel_deg: Floats
    convergence_deg: Floats
    declination_deg: Floats
    time_s: Floats
    camera: Indices
    cameras: tuple[str, ...]
    order: Indices
    previous: Indices
    sequences: tuple[Indices, ...]

    def __len__(self) -> int:
        return len(self.images)


def track_of(images: Sequence[PosedImage], crs: str, allow_ballpark: bool = False) -> Track:
    """The columns of images that all have a pose within reach of `crs`.

    allow_ballpark : see `geo.crs.ToWgs84`.

    Raises
    ------
    UnknownCrs : a position has no place on the Earth.
    """
    posed = tuple(images)
    columns = np.array([_numbers(image.pose) for image in posed], np.float64).reshape(-1, 6)
    easting, northing, altitude, heading, pitch, roll = columns.T
    place = ToWgs84.over(crs, easting, northing, allow_ballpark)
    lon, lat = place.lon_lat(easting, northing)
    middle = LocalMetres(_middle_lon(lon), float(np.median(lat)))
    x, y = middle.from_lon_lat(lon, lat)
    times = np.array([seconds(image) for image in posed])
    labels = camera_labels(posed)
    cameras = tuple(sorted(set(labels)))
    number = {label: at for at, label in enumerate(cameras)}
    camera = np.array([number[label] for label in labels], np.int64)
    by_name = sorted(range(len(posed)), key=lambda at: natural_key(posed[at].uri))
    order = np.lexsort((np.argsort(by_name), times, camera)).astype(np.int64)
    runs = tuple(sequences(posed))
    return Track(
        images=posed,
        place=place,
        lon_deg=lon,
        lat_deg=lat,
        x_m=x,
        y_m=y,
        altitude_m=altitude,
        heading_deg=heading,
        pitch_deg=pitch,
        roll_deg=roll,
        travel_deg=(_travel(runs, x, y) + _frame_convergence(lon, lat, middle)) % 360.0,
        convergence_deg=place.convergence_deg(easting, northing),
        declination_deg=declination_deg(
            lon, lat, altitude, decimal_years([image.captured_at for image in posed])
        ),
        time_s=times,
        camera=camera,
        cameras=cameras,
        order=order,
        previous=_previous(order, camera),
        sequences=runs,
    )


def seconds(image: PosedImage) -> float:
    """Seconds since 1970 of an image's capture, NaN if it is not known."""
    if image.captured_at is None:
        return float("nan")
    return datetime.fromisoformat(image.captured_at).timestamp()


def camera_labels(images: Sequence[PosedImage]) -> list[str]:
    """What tells the cameras of a survey apart, an image each: what is mounted in one way.

    The camera's name; without one the folder, and where file names differ in few ways once their
    numbers are taken out (`000123-left.jpg`, `000123-front.jpg`), also in which of these.
    """
    patterns = [_NUMBERS.sub("#", image.uri) for image in images]
    few = 1 < len(set(patterns)) <= min(_MOST_PATTERNS, len(images) // 2)
    return [
        image.camera.name or (pattern if few else image.uri.rpartition("/")[0])
        for image, pattern in zip(images, patterns, strict=True)
    ]


def _numbers(pose: Pose | None) -> tuple[float | None, ...]:
    """None becomes NaN in an array of floats."""
    if pose is None:
        return (None,) * 6
    return (
        pose.easting,
        pose.northing,
        pose.altitude_m,
        pose.heading_deg,
        pose.pitch_deg,
        pose.roll_deg,
    )


def _middle_lon(lon_deg: Floats) -> float:
    """Median longitude, on whichever side of 180 degrees the survey lies."""
    if np.ptp(lon_deg) <= 180.0:
        return float(np.median(lon_deg))
    return (float(np.median(lon_deg % 360.0)) + 180.0) % 360.0 - 180.0


def _travel(runs: Sequence[Indices], x_m: Floats, y_m: Floats) -> Floats:
    travel = np.full(len(x_m), np.nan)
    for run in runs:
        travel[run] = travel_direction_deg(x_m[run], y_m[run])
    return travel


def _frame_convergence(lon_deg: Floats, lat_deg: Floats, middle: LocalMetres) -> Floats:
    """Bearing of the local frame's y axis from true north: d lon sin(mean lat)."""
    east = (lon_deg - middle.lon_deg + 180.0) % 360.0 - 180.0
    return np.asarray(east * np.sin(np.radians((lat_deg + middle.lat_deg) / 2.0)))


def _previous(order: Indices, camera: Indices) -> Indices:
    previous = np.full(len(order), -1, np.int64)
    same = camera[order[1:]] == camera[order[:-1]]
    previous[order[1:][same]] = order[:-1][same]
    return previous
