"""Rotations of many cameras at once: (n, 3, 3) matrices from the angles in use, and back.

Frames, all right-handed:

- ENU, the world: x east, y north, z up; "north" is whichever the angles are counted from.
- FRD, a vehicle or camera body: x forward, y right, z down.
- RDF, a camera as OpenCV has it: x right in the upright image, y down, z the optical axis.
- a photogrammetric camera: x right, y up, z backwards, out of the picture.

A rotation named `enu_from_rdf` maps RDF vectors to ENU ones; its columns are the axes of RDF
written in ENU. A row with a NaN in it, an angle that is not known, has a rotation of NaN.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation, Slerp

from geo.headings import wrapped_180, wrapped_360

ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""(3, 3): north, east, down, of aerospace, seen as east, north, up."""
FRD_FROM_RDF = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""(3, 3): a camera's axes in the body that looks where it looks."""
PHOTOGRAMMETRIC_FROM_RDF = np.diag([1.0, -1.0, -1.0])
"""(3, 3): y down and z forward, seen as y up and z backwards."""
_GIMBAL_LOCK_SINE = 1e-9
"""Below this length the axis has no horizontal part to read a heading from."""

Angles = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


def rotations_from_hpr(
    heading_deg: ArrayLike, pitch_deg: ArrayLike, roll_deg: ArrayLike
) -> NDArray[np.float64]:
    """Rotations `enu_from_rdf` of cameras from heading, pitch and roll.

    Intrinsic z-y-x (heading, then pitch, then roll), the order of aerospace, of INS software and
    of Stereopolis.

    Parameters
    ----------
    heading_deg : (n,) clockwise from north, of the optical axis. pitch_deg : (n,) up positive.
    roll_deg : (n,) right side down positive.

    Returns
    -------
    enu_from_rdf : (n, 3, 3) float64.

    Raises
    ------
    ValueError : not (n,) alike.
    """
    angles = _columns(heading_deg, pitch_deg, roll_deg)
    ned_from_frd = _matrices(Rotation.from_euler("ZYX", angles, degrees=True))
    return np.asarray(ENU_FROM_NED @ ned_from_frd @ FRD_FROM_RDF, np.float64)


def hpr_from_rotations(enu_from_rdf: ArrayLike) -> Angles:
    """Heading, pitch and roll of cameras; the inverse of `rotations_from_hpr`.

    Parameters
    ----------
    enu_from_rdf : (n, 3, 3) rotations, columns right, down, optical axis in ENU.

    Returns
    -------
    heading_deg : (n,) float64 in [0, 360). pitch_deg : (n,) in [-90, 90]. roll_deg : (n,) in
    (-180, 180].

    Notes
    -----
    Near the zenith heading and roll change fast but stay right together. Exactly at it the roll
    is taken as 0 and the heading from the image's right side.

    Raises
    ------
    ValueError : not (n, 3, 3).
    """
    right, down, axis = np.moveaxis(_stack(enu_from_rdf), -1, 0)
    level = np.hypot(axis[:, 0], axis[:, 1])
    upright = level >= _GIMBAL_LOCK_SINE
    heading = np.where(
        upright, np.arctan2(axis[:, 0], axis[:, 1]), np.arctan2(-right[:, 1], right[:, 0])
    )
    roll = np.where(upright, np.arctan2(-right[:, 2], -down[:, 2]), 0.0)
    roll[np.isnan(heading)] = np.nan
    pitch = np.arctan2(axis[:, 2], level)
    return (
        wrapped_360(np.degrees(heading)),
        np.degrees(pitch),
        wrapped_180(np.degrees(roll)),
    )


def rotations_from_opk(
    omega_deg: ArrayLike, phi_deg: ArrayLike, kappa_deg: ArrayLike
) -> NDArray[np.float64]:
    """Rotations `enu_from_rdf` of cameras from the angles of photogrammetry.

    world_from_camera = Rx(omega) Ry(phi) Rz(kappa), of the photogrammetric camera: all zero looks
    straight down with north at the top of the picture. The world is east, north, up of the map,
    so "north" is grid north. Wolf, Dewitt and Wilkinson, Elements of Photogrammetry, 4th edition
    (2014), appendix C, whose M is the transpose of this.

    Parameters
    ----------
    omega_deg, phi_deg, kappa_deg : (n,).

    Returns
    -------
    enu_from_rdf : (n, 3, 3) float64.

    Raises
    ------
    ValueError : not (n,) alike.
    """
    angles = _columns(omega_deg, phi_deg, kappa_deg)
    world_from_camera = _matrices(Rotation.from_euler("XYZ", angles, degrees=True))
    return np.asarray(world_from_camera @ PHOTOGRAMMETRIC_FROM_RDF, np.float64)


def rotations_from_quaternions(
    w: ArrayLike, x: ArrayLike, y: ArrayLike, z: ArrayLike
) -> NDArray[np.float64]:
    """Rotations of Hamilton quaternions w + xi + yj + zk, as ROS, Eigen and COLMAP write them.

    Parameters
    ----------
    w, x, y, z : (n,), w the scalar; of any length, which is divided out.

    Returns
    -------
    rotations : (n, 3, 3) float64; NaN where the length is 0, which is no rotation.

    Raises
    ------
    ValueError : not (n,) alike.
    """
    quaternions = _columns(x, y, z, w)
    lengths = np.linalg.norm(quaternions, axis=1)
    unknown = ~((lengths > 0.0) & (lengths < np.inf))
    quaternions[unknown] = (0.0, 0.0, 0.0, 1.0)  # scipy refuses all for the sake of one
    rotations = _matrices(Rotation.from_quat(quaternions))
    rotations[unknown] = np.nan
    return rotations


def interpolated(times: ArrayLike, rotations: ArrayLike, at: ArrayLike) -> NDArray[np.float64]:
    """Rotations between those of given times, turning steadily about one axis (slerp).

    Shoemake, Animating rotation with quaternion curves, SIGGRAPH 1985.

    Parameters
    ----------
    times : (n,) ascending without repetition, float seconds or integer nanoseconds.
    rotations : (n, 3, 3). at : (m,) in the unit of `times`.

    Returns
    -------
    rotations : (m, 3, 3) float64; NaN before the first and after the last time, and beside a
    rotation that is NaN: nothing is extrapolated.

    Raises
    ------
    ValueError : other shapes, or times that do not ascend.
    """
    known, given, asked = np.asarray(times), _stack(rotations), np.asarray(at)
    if known.ndim != 1 or asked.ndim != 1 or len(known) != len(given):
        raise ValueError(
            f"times (n,), rotations (n, 3, 3) and at (m,) are expected; got {known.shape}, "
            f"{given.shape} and {asked.shape}"
        )
    if not (np.diff(known) > 0).all():
        raise ValueError("times must ascend without repetition")
    found = np.full((len(asked), 3, 3), np.nan)
    if len(known) == 0:
        return found
    # Counted from the first: nanoseconds of this century have more digits than a float.
    origin = known[0]
    before = np.clip(np.searchsorted(known, asked, side="right") - 1, 0, len(known) - 1)
    after = np.minimum(before + (asked > known[before]), len(known) - 1)
    fit = np.asarray(np.isfinite(given).all(axis=(1, 2)), np.bool_)
    inside = (asked >= origin) & (asked <= known[-1]) & fit[before] & fit[after]
    if not inside.any():
        return found
    if fit.sum() == 1:
        found[inside] = given[fit]
        return found
    slerp = Slerp((known[fit] - origin).astype(np.float64), Rotation.from_matrix(given[fit]))
    found[inside] = slerp((asked[inside] - origin).astype(np.float64)).as_matrix()
    return found


def are_rotations(matrices: ArrayLike, tolerance: float = 1e-3) -> NDArray[np.bool_]:
    """(n,) bool: which (n, 3, 3) matrices are orthonormal within `tolerance` and no mirror."""
    stack = _stack(matrices)
    known = np.where(np.isfinite(stack), stack, 0.0)  # no rotation either, and no warning
    products = known @ known.transpose(0, 2, 1)
    orthonormal = np.all(np.abs(products - np.eye(3)) <= tolerance, axis=(1, 2))
    return np.asarray(orthonormal & (np.linalg.det(known) > 0.0))


def _columns(*columns: ArrayLike) -> NDArray[np.float64]:
    vectors = [np.asarray(column, np.float64) for column in columns]
    if any(vector.ndim != 1 or vector.shape != vectors[0].shape for vector in vectors):
        shapes = " and ".join(str(vector.shape) for vector in vectors)
        raise ValueError(f"angles or parts of quaternions must be (n,) alike; got {shapes}")
    return np.column_stack(vectors)


def _stack(matrices: ArrayLike) -> NDArray[np.float64]:
    stack = np.asarray(matrices, np.float64)
    if stack.ndim != 3 or stack.shape[1:] != (3, 3):
        raise ValueError(f"expected (n, 3, 3) rotations; got {stack.shape}")
    return stack


def _matrices(rotation: Rotation) -> NDArray[np.float64]:
    return np.asarray(rotation.as_matrix(), np.float64)
