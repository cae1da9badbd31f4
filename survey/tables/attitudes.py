"""Heading, pitch and roll of every row, from whatever the table has to say them with."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from geo.headings import wrapped_180, wrapped_360
from geo.rotations import (
    FRD_FROM_RDF,
    PHOTOGRAMMETRIC_FROM_RDF,
    are_rotations,
    hpr_from_rotations,
    rotations_from_opk,
    rotations_from_quaternions,
)
from survey.poses import Quantity
from survey.tables.convention import Convention
from survey.tables.profile import MATRIX, Role
from survey.tables.quantities import read_numbers
from survey.tables.table import Faults, Table, first_faults

_DEGREES = {"deg": 1.0, "grad": 0.9, "rad": 180.0 / np.pi}
_ZERO_DEG = {"north": 0.0, "east": 90.0, "south": 180.0, "west": 270.0}
_AXES_FROM_RDF: dict[str, NDArray[np.float64]] = {
    "rdf": np.eye(3),
    "rub": PHOTOGRAMMETRIC_FROM_RDF,
    "frd": FRD_FROM_RDF,
    "flu": np.diag([1.0, -1.0, -1.0]) @ FRD_FROM_RDF,
}
_OPK: tuple[Role, ...] = ("omega", "phi", "kappa")
_QUATERNION: tuple[Role, ...] = ("qw", "qx", "qy", "qz")
_HPR: tuple[Literal["heading", "pitch", "roll"], ...] = ("heading", "pitch", "roll")
_MOST_TURNS_DEG = 3600.0
"""A larger angle is no angle, or not in this unit."""
_UNIT_LENGTH = 0.01
_AGREE = 2e-3
"""Largest difference of a matrix element from that of the angles beside it: 0.1 degrees."""


@dataclass(frozen=True, slots=True)
class Attitudes:
    """heading_deg [0, 360), pitch_deg, roll_deg (-180, 180] : (n,) float64, NaN: not known.

    columns : which column says what; empty if a whole attitude is said together.
    """

    heading_deg: NDArray[np.float64]
    pitch_deg: NDArray[np.float64]
    roll_deg: NDArray[np.float64]
    faults: Faults
    notes: tuple[str, ...] = ()
    columns: Mapping[Quantity, int] = field(default_factory=dict)


def read_attitudes(table: Table, found: Mapping[Role, int], convention: Convention) -> Attitudes:
    """Attitudes by omega, phi, kappa, else a matrix, else a quaternion, else the three angles.

    Parameters
    ----------
    found : which column is what.
    """
    if found.keys() >= set(_OPK):
        values, faults = _whole(table, found, _OPK, convention.unknown)
        faults = first_faults(faults, _too_large(table, found, _OPK, values, convention))
        rotations = rotations_from_opk(*(values * _DEGREES[convention.angles]))
        notes = _disagreement(table, found, convention, rotations)
        return _from_rotations(rotations, faults, notes)
    if found.keys() >= set(MATRIX):
        return _from_matrices(table, found, convention)
    if found.keys() >= set(_QUATERNION):
        return _from_quaternions(table, found, convention)
    return _from_angles(table, found, convention)


def _from_matrices(table: Table, found: Mapping[Role, int], convention: Convention) -> Attitudes:
    values, faults = _whole(table, found, MATRIX, convention.unknown)
    matrices = _matrices(values, convention)
    known = np.isfinite(matrices).all(axis=(1, 2))
    for at in np.flatnonzero(known & ~are_rotations(matrices)):
        faults.setdefault(
            int(at),
            f"{table.row(int(at))}: m11 to m33 are no rotation matrix "
            f"({np.round(matrices[at], 3).tolist()}); check which columns they are",
        )
    matrices[list(faults)] = np.nan
    return _from_rotations(_enu_from_rdf(matrices, convention), faults)


def _from_quaternions(table: Table, found: Mapping[Role, int], convention: Convention) -> Attitudes:
    values, faults = _whole(table, found, _QUATERNION, convention.unknown)
    lengths = np.linalg.norm(values, axis=0)
    for at in np.flatnonzero(np.abs(lengths - 1.0) > _UNIT_LENGTH):
        faults.setdefault(
            int(at),
            f"{table.row(int(at))}: qw, qx, qy, qz have the length {lengths[at]:.3g}, expected 1",
        )
    values[:, list(faults)] = np.nan
    rotations = rotations_from_quaternions(*values)
    return _from_rotations(_enu_from_rdf(rotations, convention), faults)


def _from_angles(table: Table, found: Mapping[Role, int], convention: Convention) -> Attitudes:
    """Heading, pitch and roll; each may be known without the others."""
    values, faults = _columns(table, found, _HPR, convention.unknown)
    faults = first_faults(faults, _too_large(table, found, _HPR, values, convention))
    heading, pitch, roll = values * _DEGREES[convention.angles]
    notes: tuple[str, ...] = ()
    known = np.isfinite(heading)
    if convention.zero_headings_unknown and known.any() and not heading[known].any():
        heading = np.full(len(table), np.nan)
        notes = (f"{table.path.name}: every heading is exactly 0 and is taken as not measured",)
    if convention.heading_turn == "counterclockwise":
        heading = -heading
    if convention.pitch_sense == "down":
        pitch = -pitch
    if convention.pitch_zero == "nadir":
        pitch = pitch - 90.0
    if convention.roll_sense == "left_down":
        roll = -roll
    heading = wrapped_360(heading + _ZERO_DEG[convention.heading_zero])
    columns: dict[Quantity, int] = {angle: found[angle] for angle in _HPR if angle in found}
    return Attitudes(heading, pitch, wrapped_180(roll), faults, notes, columns)


def _columns(
    table: Table, found: Mapping[Role, int], roles: Sequence[Role], unknown: Sequence[float]
) -> tuple[NDArray[np.float64], Faults]:
    """(len(roles), n) float64 and the faults of any of them."""
    columns = [read_numbers(table, found.get(role), role, unknown) for role in roles]
    values = np.array([column.values for column in columns])
    return values.reshape(len(roles), len(table)), first_faults(*(c.faults for c in columns))


def _whole(
    table: Table, found: Mapping[Role, int], roles: Sequence[Role], unknown: Sequence[float]
) -> tuple[NDArray[np.float64], Faults]:
    """As `_columns`; a row has all of them or none."""
    values, faults = _columns(table, found, roles, unknown)
    missing = np.isnan(values)
    for at in np.flatnonzero(missing.any(axis=0) & ~missing.all(axis=0)).tolist():
        names = ", ".join(role for role, none in zip(roles, missing[:, at], strict=True) if none)
        faults.setdefault(at, f"{table.row(at)}: {names} not given, but the rest of the attitude")
    return values, faults


def _too_large(
    table: Table,
    found: Mapping[Role, int],
    roles: Sequence[Role],
    values: NDArray[np.float64],
    convention: Convention,
) -> Faults:
    faults: Faults = {}
    limit = _MOST_TURNS_DEG / _DEGREES[convention.angles]
    for role, row in zip(roles, values, strict=True):
        for at in np.flatnonzero(np.abs(row) > limit):
            place = table.cell(int(at), found[role])
            faults.setdefault(
                int(at), f"{place}: {role} is {row[at]:g} {convention.angles}, which is no angle"
            )
            row[at] = np.nan
    return faults


def _matrices(values: NDArray[np.float64], convention: Convention) -> NDArray[np.float64]:
    """(n, 3, 3) as written, from (9, n) in the order m11, m12, m13, m21 and so on."""
    stack = values.T.reshape(-1, 3, 3)
    written = stack.transpose(0, 2, 1) if convention.matrix_order == "column" else stack
    return np.array(written, np.float64)


def _enu_from_rdf(rotations: NDArray[np.float64], convention: Convention) -> NDArray[np.float64]:
    if convention.rotation_maps == "camera_from_world":
        rotations = rotations.transpose(0, 2, 1)
    return np.asarray(rotations @ _AXES_FROM_RDF[convention.camera_axes], np.float64)


def _from_rotations(
    enu_from_rdf: NDArray[np.float64], faults: Faults, notes: tuple[str, ...] = ()
) -> Attitudes:
    heading, pitch, roll = hpr_from_rotations(enu_from_rdf)
    return Attitudes(heading, pitch, roll, faults, notes)


def _disagreement(
    table: Table,
    found: Mapping[Role, int],
    convention: Convention,
    enu_from_rdf: NDArray[np.float64],
) -> tuple[str, ...]:
    """A note if the matrix beside omega, phi, kappa says something else, either way round."""
    if not found.keys() >= set(MATRIX):
        return ()
    values, _ = _columns(table, found, MATRIX, convention.unknown)
    matrices = _matrices(values, convention)
    apart = [
        np.abs(way @ _AXES_FROM_RDF[convention.camera_axes] - enu_from_rdf).max(axis=(1, 2))
        for way in (matrices, matrices.transpose(0, 2, 1))
    ]
    count = int((np.minimum(*apart) > _AGREE).sum())
    if not count:
        return ()
    note = (
        f"{table.path.name}: m11 to m33 say another attitude than omega, phi, kappa in {count} of "
        f"{len(table)} rows; the angles were used"
    )
    return (note,)
