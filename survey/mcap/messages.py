"""What the messages of interest say, whatever they are encoded in.

Moments are nanoseconds since 1970, None where the message carries none. Quaternions are
(x, y, z, w). Positions are metres, x east, y north, z up in a world frame (ROS REP 103).
"""

import math
from dataclasses import dataclass

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class ImageMessage:
    """A picture. encoding : of the file for a compressed one, of the pixels for a raw one.

    step_bytes : from one row to the next. width_px, height_px, step_bytes : 0 for a compressed
    one.
    """

    stamp_ns: int | None
    frame: str
    encoding: str
    data: memoryview
    raw: bool = False
    width_px: int = 0
    height_px: int = 0
    step_bytes: int = 0
    big_endian: bool = False


@dataclass(frozen=True, slots=True)
class Fix:
    """A position on the WGS 84 ellipsoid, of the origin of `frame`.

    error_m : root of the sum of the variances east and north; NaN: not stated. heading_rad :
    clockwise from north; NaN: not stated. valid : whether the receiver had a fix.
    """

    stamp_ns: int | None
    frame: str
    lon_deg: float
    lat_deg: float
    alt_m: float
    error_m: float
    heading_rad: float = math.nan
    valid: bool = True


@dataclass(frozen=True, slots=True)
class BodyPose:
    """How `body` lies in `frame`; `body` is "" where the message does not say whose pose it is."""

    stamp_ns: int | None
    frame: str
    body: str
    position: Vector
    quaternion: Quaternion


@dataclass(frozen=True, slots=True)
class Transform:
    """How the frame `child` lies in its `parent`."""

    stamp_ns: int | None
    parent: str
    child: str
    translation: Vector
    quaternion: Quaternion


@dataclass(frozen=True, slots=True)
class Calibration:
    """The lens of the camera whose optical frame is `frame`; focal length in pixels."""

    frame: str
    width_px: int
    height_px: int
    focal_px: float
    model: str


Said = ImageMessage | Fix | BodyPose | Transform | Calibration


def horizontal_error_m(covariance: tuple[float, ...], known: bool) -> float:
    """From a covariance in east, north, up, row by row, in square metres; NaN: not stated."""
    if not known or len(covariance) != 9 or min(covariance[0], covariance[4]) < 0.0:
        return math.nan
    return float((covariance[0] + covariance[4]) ** 0.5)


def frame_name(text: str) -> str:
    """A frame's name; the leading slash of older ROS means nothing."""
    return text.removeprefix("/")
