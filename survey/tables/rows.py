"""The rows of a table as poses and cameras, every column read once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.config import North
from contracts.records import Camera, Pose, PosedImage
from geo.headings import wrapped_360
from survey.options import ReadOptions
from survey.poses import PoseProblem, Quantity, find_problem
from survey.tables.attitudes import Attitudes, read_attitudes
from survey.tables.moments import read_moments
from survey.tables.positions import Positions, read_positions
from survey.tables.profile import Profile, plain_name
from survey.tables.profiles import GENERIC
from survey.tables.quantities import Numbers, read_numbers
from survey.tables.table import Faults, Table, first_faults

_QUATERNION = {"qw", "qx", "qy", "qz"}


@dataclass(frozen=True, slots=True)
class Rows:
    """What n rows say; lists of n, None: not known.

    columns : which column says what. files, cameras : as written. north : from which all headings
    count. faults : rows that are left out, and why. notes : what a person should know.
    """

    table: Table
    columns: Mapping[Quantity, int]
    files: Sequence[str]
    cameras: Sequence[str]
    positions: Positions
    headings_deg: list[float | None]
    pitches_deg: list[float | None]
    rolls_deg: list[float | None]
    altitudes_m: list[float | None]
    errors_m: list[float | None]
    hfovs_deg: list[float | None]
    captured_at: list[str | None]
    north: North
    faults: Faults
    notes: tuple[str, ...]

    def image(self, at: int, uri: str, path: str) -> PosedImage | str:
        """The image of one row without a fault, or why its pose cannot be."""
        pose = Pose(
            easting=float(self.positions.easting[at]),
            northing=float(self.positions.northing[at]),
            crs=self.positions.crs,
            altitude_m=self.altitudes_m[at],
            heading_deg=self.headings_deg[at],
            pitch_deg=self.pitches_deg[at],
            roll_deg=self.rolls_deg[at],
            north=self.north,
            position_error_m=self.errors_m[at],
        )
        problem = find_problem(pose, self.positions.geographic)
        if problem is not None:
            return f"{self._place(at, problem)}: {problem.reason}"
        camera = Camera(name=self.cameras[at], hfov_deg=self.hfovs_deg[at])
        return PosedImage(
            uri=uri, path=path, pose=pose, camera=camera, captured_at=self.captured_at[at]
        )

    def _place(self, at: int, problem: PoseProblem) -> str:
        """The cell of an impossible number, or the row where no one column says it."""
        column = self.columns.get(problem.quantity)
        return self.table.row(at) if column is None else self.table.cell(at, column)


def read_rows(table: Table, profile: Profile, options: ReadOptions) -> Rows:
    """All rows of a table of a known kind.

    Raises
    ------
    BadSurvey : columns that contradict each other or the options.
    UnknownCrs : coordinates without a system, or one that is not known.
    """
    found = profile.find(table.names, table.width, str(table.path))
    convention = profile.convention
    positions = read_positions(table, found, profile, options)
    attitudes = read_attitudes(table, found, convention)
    moments = read_moments(table, found.get("time"), convention)
    hfov = read_numbers(table, found.get("hfov"), "hfov", convention.unknown)
    error = read_numbers(table, found.get("error"), "position error", convention.unknown)
    north = options.north or profile.north or ("true" if positions.geographic else "grid")
    headings = attitudes.heading_deg
    if north == "grid":
        headings = wrapped_360(headings + positions.grid_turn_deg)
    return Rows(
        table=table,
        columns={**positions.columns, **attitudes.columns},
        files=table.texts(found.get("file")),
        cameras=table.texts(found.get("camera")),
        positions=positions,
        headings_deg=_known(headings),
        pitches_deg=_known(attitudes.pitch_deg),
        rolls_deg=_known(attitudes.roll_deg),
        altitudes_m=_known(positions.altitude_m),
        errors_m=_known(error.values),
        hfovs_deg=_known(hfov.values),
        captured_at=moments.captured_at,
        north=north,
        faults=_faults(table, positions, attitudes, hfov, error),
        notes=positions.notes + attitudes.notes + moments.notes + _unused(table, profile),
    )


def _faults(
    table: Table, positions: Positions, attitudes: Attitudes, hfov: Numbers, error: Numbers
) -> Faults:
    wide = np.flatnonzero((hfov.values <= 0.0) | (hfov.values > 360.0))
    impossible = {
        int(at): f"{table.row(int(at))}: hfov is {hfov.values[at]:g} degrees, expected 0 to 360"
        for at in wide
    }
    return first_faults(
        table.faults, positions.faults, attitudes.faults, hfov.faults, impossible, error.faults
    )


def _known(values: NDArray[np.float64]) -> list[float | None]:
    return [None if number != number else number for number in values.tolist()]


def _unused(table: Table, profile: Profile) -> tuple[str, ...]:
    """A note on attitudes that a table has but does not explain."""
    names = {plain_name(name) for name in table.names}
    if profile is not GENERIC or not names >= _QUATERNION:
        return ()
    note = (
        f"{table.path.name}: qw, qx, qy, qz are not used, since nothing says which way the "
        "camera's axes point; a mapping (--mapping) can"
    )
    return (note,)
