"""The attitude of one body or camera; `geo.rotations` has the frames, and whole surveys."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geo.rotations import FRD_FROM_RDF, are_rotations, hpr_from_rotations, rotations_from_hpr


@dataclass(frozen=True, slots=True)
class Attitude:
    """How a body or camera is turned, in degrees.

    heading_deg : [0, 360), clockwise from north, of the forward (optical) axis.
    pitch_deg : [-90, 90], up positive. roll_deg : (-180, 180], right side down positive.
    """

    heading_deg: float
    pitch_deg: float
    roll_deg: float


def enu_from_frd(attitude: Attitude) -> NDArray[np.float64]:
    """(3, 3) float64 rotation of a body with this attitude; columns forward, right, down."""
    return np.asarray(enu_from_rdf(attitude) @ FRD_FROM_RDF.T, np.float64)


def enu_from_rdf(attitude: Attitude) -> NDArray[np.float64]:
    """(3, 3) float64 rotation of a camera with this attitude; columns right, down, optical axis."""
    angles = ([attitude.heading_deg], [attitude.pitch_deg], [attitude.roll_deg])
    return np.asarray(rotations_from_hpr(*angles)[0], np.float64)


def camera_attitude(enu_from_camera: NDArray[np.float64]) -> Attitude:
    """Heading, pitch and roll of a camera from its rotation; the inverse of `enu_from_rdf`.

    Parameters
    ----------
    enu_from_camera : (3, 3) rotation, columns right, down, optical axis in ENU.

    Raises
    ------
    ValueError : not a rotation.
    """
    if not is_rotation(enu_from_camera):
        raise ValueError(f"expected a (3, 3) rotation matrix; got {enu_from_camera.tolist()}")
    heading, pitch, roll = hpr_from_rotations(enu_from_camera[None])
    return Attitude(float(heading[0]), float(pitch[0]), float(roll[0]))


def is_rotation(matrix: NDArray[np.float64], tolerance: float = 1e-3) -> bool:
    """Whether `matrix` is (3, 3), orthonormal within `tolerance` and keeps handedness."""
    return matrix.shape == (3, 3) and bool(are_rotations(matrix[None], tolerance)[0])
