"""Attitudes: rotation matrices from heading, pitch and roll, and back.

Frames, all right-handed, all in metres:

- ENU, the world: x east, y north, z up; "north" is whichever the heading is counted from.
- FRD, a vehicle or camera body: x forward, y right, z down.
- RDF, a camera as OpenCV has it: x right in the upright image, y down, z the optical axis.

A rotation named `enu_from_frd` maps FRD vectors to ENU ones; its columns are the axes of FRD
written in ENU.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geo.headings import wrapped_360

_ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_FRD_FROM_RDF = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
_GIMBAL_LOCK_SINE = 1e-9
"""Below this length the axis has no horizontal part to read a heading from."""


@dataclass(frozen=True, slots=True)
class Attitude:
    """How a body or camera is turned, in degrees.

    heading_deg : [0, 360), clockwise from north, of the forward (optical) axis.
    pitch_deg : [-90, 90], up positive. roll_deg : (-180, 180], right side down positive.
    """

    heading_deg: float
    pitch_deg: float
    roll_deg: float


def wrapped_180(angle_deg: float) -> float:
    """The same roll within (-180, 180] degrees."""
    turned = wrapped_360(angle_deg)
    return turned - 360.0 if turned > 180.0 else turned


def enu_from_frd(attitude: Attitude) -> NDArray[np.float64]:
    """(3, 3) float64 rotation of a body with this attitude; columns forward, right, down.

    Intrinsic z-y-x (heading, then pitch, then roll), the order of aerospace, of INS software and
    of Stereopolis.
    """
    heading, pitch, roll = (
        math.radians(angle)
        for angle in (attitude.heading_deg, attitude.pitch_deg, attitude.roll_deg)
    )
    ch, sh = math.cos(heading), math.sin(heading)
    cp, sp = math.cos(pitch), math.sin(pitch)
    cr, sr = math.cos(roll), math.sin(roll)
    about_down = np.array([[ch, -sh, 0.0], [sh, ch, 0.0], [0.0, 0.0, 1.0]])
    about_right = np.array([[cp, 0.0, sp], [0.0, 1.0, 0.0], [-sp, 0.0, cp]])
    about_forward = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    rotation = _ENU_FROM_NED @ about_down @ about_right @ about_forward
    return np.asarray(rotation, np.float64)


def enu_from_rdf(attitude: Attitude) -> NDArray[np.float64]:
    """(3, 3) float64 rotation of a camera with this attitude; columns right, down, optical axis."""
    return np.asarray(enu_from_frd(attitude) @ _FRD_FROM_RDF, np.float64)


def camera_attitude(enu_from_camera: NDArray[np.float64]) -> Attitude:
    """Heading, pitch and roll of a camera from its rotation; the inverse of `enu_from_rdf`.

    Parameters
    ----------
    enu_from_camera : (3, 3) rotation, columns right, down, optical axis in ENU.

    Notes
    -----
    Near the zenith heading and roll change fast but stay right together. Exactly at it the roll
    is taken as 0 and the heading from the image's right side.

    Raises
    ------
    ValueError : not a rotation.
    """
    rotation = np.asarray(enu_from_camera, np.float64)
    if rotation.shape != (3, 3) or not is_rotation(rotation):
        raise ValueError(f"expected a (3, 3) rotation matrix; got {rotation.tolist()}")
    right, down, axis = rotation.T
    pitch = math.atan2(axis[2], math.hypot(axis[0], axis[1]))
    if math.hypot(axis[0], axis[1]) < _GIMBAL_LOCK_SINE:
        heading, roll = math.atan2(-right[1], right[0]), 0.0
    else:
        heading = math.atan2(axis[0], axis[1])
        roll = math.atan2(-right[2], -down[2])
    return Attitude(
        wrapped_360(math.degrees(heading)),
        math.degrees(pitch),
        wrapped_180(math.degrees(roll)),
    )


def is_rotation(matrix: NDArray[np.float64], tolerance: float = 1e-3) -> bool:
    """Whether a (3, 3) matrix is orthonormal within `tolerance` and keeps handedness."""
    orthonormal = np.allclose(matrix @ matrix.T, np.eye(3), atol=tolerance)
    return bool(orthonormal and np.linalg.det(matrix) > 0.0)
