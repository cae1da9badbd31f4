"""Where every row's camera stood, all rows in one coordinate system."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadSurvey, UnknownCrs
from contracts.records import Pose
from geo.crs import grid_of, parse_crs
from geo.reprojection import Reprojected, reproject
from survey.options import ReadOptions
from survey.poses import Quantity, crs_name, is_geographic
from survey.tables.profile import Profile, Role
from survey.tables.quantities import read_numbers
from survey.tables.table import Faults, Table, first_faults

_HUGE = 1e9
"""No coordinate system reaches so far in its unit."""

_MOST_SYSTEMS = 32
"""To look a system up takes a while, and a survey crosses few UTM zones."""


@dataclass(frozen=True, slots=True)
class Positions:
    """(n,) float64 each, NaN where not known, all in `crs`.

    grid_turn_deg : to be added to a heading from the row's own grid north to count it from that
    of `crs`. columns : which column says what, of easting, northing and altitude.
    """

    easting: NDArray[np.float64]
    northing: NDArray[np.float64]
    altitude_m: NDArray[np.float64]
    grid_turn_deg: NDArray[np.float64]
    crs: str
    geographic: bool
    faults: Faults
    columns: Mapping[Quantity, int]
    notes: tuple[str, ...] = ()


def read_positions(
    table: Table, found: Mapping[Role, int], profile: Profile, options: ReadOptions
) -> Positions:
    """Positions by geometry, else by x and y, else by lon and lat; lon and lat before x and y
    unless `options.crs` is a projected system.

    Parameters
    ----------
    found : which column is what.

    Raises
    ------
    UnknownCrs : coordinates without a system, or one that is not known.
    BadSurvey : `options.crs` contradicts the table.
    """
    chosen = options.crs or (None if table.crs else profile.crs)
    given = None if chosen is None else crs_name(chosen)
    at = _coordinates(table, found, profile, given)
    if "crs" in found and table.crs is None and not at.in_degrees:
        systems = _RowSystems.read(table, found["crs"], given)
        return systems.joined(at, given, options.allow_ballpark)
    crs = _one_system(table, found, given, at.in_degrees)
    turn_deg = np.zeros(len(table))
    return Positions(
        at.x, at.y, at.altitude_m, turn_deg, crs, is_geographic(crs), at.faults, at.columns
    )


@dataclass(frozen=True, slots=True)
class _Coordinates:
    """(n,) float64 as written; in_degrees : x and y are columns lon and lat."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    altitude_m: NDArray[np.float64]
    in_degrees: bool
    faults: Faults
    columns: Mapping[Quantity, int]


def _coordinates(
    table: Table, found: Mapping[Role, int], profile: Profile, given: str | None
) -> _Coordinates:
    """Coordinates by geometry, else by columns."""
    altitude = read_numbers(table, found.get("z"), "altitude", profile.convention.unknown)
    columns: dict[Quantity, int] = {}
    if table.xyz is not None:
        x, y, height = table.xyz.T
        altitude_m = np.where(np.isfinite(height), height, altitude.values)
        faults = first_faults(table.faults, altitude.faults)
        if "z" in found and not np.isfinite(height).any():
            columns["altitude"] = found["z"]
        return _Coordinates(x, y, altitude_m, False, faults, columns)
    in_degrees = _in_degrees(table, found, given)
    if in_degrees:
        columns |= {"easting": found["lon"], "northing": found["lat"]}
        across = read_numbers(table, found["lon"], "longitude")
        along = read_numbers(table, found["lat"], "latitude")
    else:
        columns |= {"easting": found["x"], "northing": found["y"]}
        across = read_numbers(table, found["x"], "easting")
        along = read_numbers(table, found["y"], "northing")
    if "z" in found:
        columns["altitude"] = found["z"]
    empty = {
        int(at): f"{table.row(int(at))}: image without pose: its coordinates are empty"
        for at in np.flatnonzero(np.isnan(across.values) | np.isnan(along.values))
    }
    faults = first_faults(table.faults, across.faults, along.faults, altitude.faults, empty)
    return _Coordinates(across.values, along.values, altitude.values, in_degrees, faults, columns)


def _in_degrees(table: Table, found: Mapping[Role, int], given: str | None) -> bool:
    metres, degrees = {"x", "y"} <= found.keys(), {"lon", "lat"} <= found.keys()
    if not (metres or degrees):
        raise BadSurvey(
            f"pose table {table.path}: no position; expected points, or columns for x and y or for "
            "lon and lat"
        )
    return degrees and (not metres or given is None or is_geographic(given))


def _one_system(
    table: Table, found: Mapping[Role, int], given: str | None, in_degrees: bool
) -> str:
    """The system of all rows: the table's own word, checked against the user's."""
    if table.crs is not None:
        return _agreed(table, table.crs, given)
    if in_degrees and given is not None and not is_geographic(given):
        raise BadSurvey(
            f"pose table {table.path}: columns lon and lat are degrees but --crs {given} is "
            "projected; leave --crs out, or name the columns x and y if they are in its units"
        )
    if given is None and not in_degrees:
        names = "its geometries are"
        if table.xyz is None:
            columns = (found["x"], found["y"])
            names = "coordinates " + ", ".join(
                repr(table.names[at]) if table.names else f"in column {at + 1}" for at in columns
            )
        raise UnknownCrs(
            f"pose table {table.path}: {names} without a coordinate system; name it with --crs "
            "(such as --crs EPSG:2154), or call the columns lon and lat if they are degrees"
        )
    return given or "EPSG:4326"


def _agreed(table: Table, own: str, given: str | None) -> str:
    """The table's own system, or the user's if it is the same one said more fully."""
    if given is None:
        return own
    if not _horizontally_equal(own, given):
        raise BadSurvey(
            f"pose table {table.path} is in {own} by its own word but --crs says {given}; leave "
            "--crs out, or mend the table if it is wrong"
        )
    return given


def _horizontally_equal(one: str, other: str) -> bool:
    return one == other or parse_crs(one).equals(parse_crs(other), ignore_axis_order=True)


@dataclass(frozen=True, slots=True)
class _RowSystems:
    """The coordinate system that each row names; "" where it names none that is known."""

    table: Table
    names: tuple[str, ...]
    faults: Faults

    @classmethod
    def read(cls, table: Table, column: int, given: str | None) -> "_RowSystems":
        known = {"": given or ""}
        wrong: dict[str, str] = {}
        cells = table.texts(column)
        distinct = set(cells) - {""}
        if len(distinct) > _MOST_SYSTEMS:
            raise BadSurvey(
                f"pose table {table.path}: {len(distinct)} different coordinate systems in one "
                f"column, expected {_MOST_SYSTEMS} at most; is it another column?"
            )
        for text in sorted(distinct):
            try:
                known[text] = _by_code(text)
            except UnknownCrs as error:
                known[text], wrong[text] = "", str(error)
        names = tuple(known[text] for text in cells)
        faults = {
            at: f"{table.cell(at, column)}: {wrong.get(text) or 'no coordinate system'}"
            for at, (text, name) in enumerate(zip(cells, names, strict=True))
            if not name
        }
        return cls(table, names, faults)

    def joined(self, written: _Coordinates, given: str | None, allow_ballpark: bool) -> Positions:
        """All rows in the most frequent system; those of others are converted into it."""
        counts = Counter(name for name in self.names if name)
        if not counts:
            reason = next(iter(self.faults.values()))
            raise UnknownCrs(f"pose table {self.table.path}: no row has a known system: {reason}")
        crs = min(counts, key=lambda name: (-counts[name], name))
        others = sorted(counts.keys() - {crs})
        if not others:
            crs = _agreed(self.table, crs, given)
        x, y, altitude_m = written.x.copy(), written.y.copy(), written.altitude_m.copy()
        turn_deg = np.zeros(len(self.table))
        faults = first_faults(self.faults, written.faults)
        notes: list[str] = []
        for name in others:
            rows = self._whole_rows(name, written, faults)
            poses = [_pose(written, at, name) for at in rows]
            try:
                found = reproject(poses, crs, allow_ballpark)
            except UnknownCrs as error:
                faults |= {at: f"{self.table.row(at)}: {error}" for at in rows}
                continue
            x[rows] = [pose.easting for pose in found.poses]
            y[rows] = [pose.northing for pose in found.poses]
            altitude_m[rows] = [_number(pose.altitude_m) for pose in found.poses]
            turn_deg[rows] = _turns_deg(found)
            notes += found.told(f"{self.table.path.name}, {len(rows)} rows")
        geographic = is_geographic(crs)
        return Positions(
            x, y, altitude_m, turn_deg, crs, geographic, faults, written.columns, tuple(notes)
        )

    def _whole_rows(self, name: str, written: _Coordinates, faults: Faults) -> list[int]:
        """The rows of one system that have a place that can be converted."""
        return [
            at
            for at, own in enumerate(self.names)
            if own == name
            and at not in faults
            and max(abs(written.x[at]), abs(written.y[at])) < _HUGE
        ]


def _pose(written: _Coordinates, at: int, crs: str) -> Pose:
    """The place of one row, looking to the north of its own grid."""
    altitude_m = float(written.altitude_m[at])
    return Pose(
        float(written.x[at]),
        float(written.y[at]),
        crs,
        None if np.isnan(altitude_m) else altitude_m,
        heading_deg=0.0,
        north="grid",
    )


def _turns_deg(found: Reprojected) -> NDArray[np.float64]:
    """(n,) the headings of `_pose`, true once converted, from the north of the new grid."""
    x, y, true_deg = (
        np.array([(pose.easting, pose.northing, _number(pose.heading_deg)) for pose in found.poses])
        .reshape(-1, 3)
        .T
    )
    return np.asarray(true_deg - grid_of(found.crs).convergence_deg(x, y))


def _number(value: float | None) -> float:
    return np.nan if value is None else value


def _by_code(text: str) -> str:
    """The system of a cell: a name, or a bare code of EPSG or, as ArcGIS has them, of Esri."""
    if not text.isdecimal():
        return crs_name(text)
    try:
        return crs_name(f"EPSG:{text}")
    except UnknownCrs:
        return crs_name(f"ESRI:{text}")
