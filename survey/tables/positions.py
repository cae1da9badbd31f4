"""Where every row's camera stood, all rows in one coordinate system."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadSurvey, UnknownCrs
from geo.crs import ToWgs84, parse_crs
from survey.poses import crs_name, is_geographic
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
    of `crs`.
    """

    easting: NDArray[np.float64]
    northing: NDArray[np.float64]
    altitude_m: NDArray[np.float64]
    grid_turn_deg: NDArray[np.float64]
    crs: str
    geographic: bool
    faults: Faults
    notes: tuple[str, ...] = ()


def read_positions(
    table: Table, found: Mapping[Role, int], profile: Profile, given: str | None
) -> Positions:
    """Positions by geometry, else by x and y, else by lon and lat; lon and lat before x and y
    unless `given` is a projected system.

    Parameters
    ----------
    found : which column is what. given : the user's `--crs`.

    Raises
    ------
    UnknownCrs : coordinates without a system, or one that is not known.
    BadSurvey : `given` contradicts the table.
    """
    chosen = given or (None if table.crs else profile.crs)
    given = None if chosen is None else crs_name(chosen)
    at = _coordinates(table, found, profile, given)
    if "crs" in found and table.crs is None and not at.in_degrees:
        return _RowSystems.read(table, found["crs"], given).joined(at, given)
    crs = _one_system(table, found, given, at.in_degrees)
    return Positions(
        at.x, at.y, at.altitude_m, np.zeros(len(table)), crs, is_geographic(crs), at.faults
    )


@dataclass(frozen=True, slots=True)
class _Coordinates:
    """(n,) float64 as written; in_degrees : x and y are columns lon and lat."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    altitude_m: NDArray[np.float64]
    in_degrees: bool
    faults: Faults


def _coordinates(
    table: Table, found: Mapping[Role, int], profile: Profile, given: str | None
) -> _Coordinates:
    """Coordinates by geometry, else by columns."""
    altitude = read_numbers(table, found.get("z"), "altitude", profile.convention.unknown)
    if table.xyz is not None:
        x, y, height = table.xyz.T
        altitude_m = np.where(np.isfinite(height), height, altitude.values)
        return _Coordinates(x, y, altitude_m, False, first_faults(table.faults, altitude.faults))
    in_degrees = _in_degrees(table, found, given)
    if in_degrees:
        across = read_numbers(table, found["lon"], "longitude")
        along = read_numbers(table, found["lat"], "latitude")
    else:
        across = read_numbers(table, found["x"], "easting")
        along = read_numbers(table, found["y"], "northing")
    empty = {
        int(at): f"{table.row(int(at))}: image without pose: its coordinates are empty"
        for at in np.flatnonzero(np.isnan(across.values) | np.isnan(along.values))
    }
    faults = first_faults(table.faults, across.faults, along.faults, altitude.faults, empty)
    return _Coordinates(across.values, along.values, altitude.values, in_degrees, faults)


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

    def joined(self, written: _Coordinates, given: str | None) -> Positions:
        """All rows in the most frequent system; those of others are converted into it."""
        counts = Counter(name for name in self.names if name)
        if not counts:
            reason = next(iter(self.faults.values()))
            raise UnknownCrs(f"pose table {self.table.path}: no row has a known system: {reason}")
        crs = min(counts, key=lambda name: (-counts[name], name))
        others = sorted(counts.keys() - {crs})
        columns = (written.x.copy(), written.y.copy(), np.zeros(len(self.table)))
        faults, notes = first_faults(self.faults, written.faults), []
        for name in others:
            rows = [at for at, other in enumerate(self.names) if other == name]
            faults |= self._convert(rows, name, crs, columns, faults)
            notes.append(f"{self.table.path.name}: {len(rows)} rows converted from {name} to {crs}")
        if not others:
            crs = _agreed(self.table, crs, given)
        return Positions(
            columns[0],
            columns[1],
            written.altitude_m,
            columns[2],
            crs,
            is_geographic(crs),
            faults,
            tuple(notes),
        )

    def _convert(
        self,
        rows: Sequence[int],
        name: str,
        crs: str,
        columns: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
        faults: Faults,
    ) -> Faults:
        """Convert rows of one system in place; the faults of those that cannot be."""
        easting, northing, turn = columns
        good = [
            at
            for at in rows
            if at not in faults and max(abs(easting[at]), abs(northing[at])) < _HUGE
        ]
        try:
            there, here = ToWgs84(name), ToWgs84(crs)
            lon, lat = there.lon_lat(easting[good], northing[good])
            turn[good] = there.convergence_deg(easting[good], northing[good])
            easting[good], northing[good] = here.from_lon_lat(lon, lat)
            turn[good] -= here.convergence_deg(easting[good], northing[good])
        except UnknownCrs as error:
            return {at: f"{self.table.row(at)}: {error}" for at in good}
        return {}


def _by_code(text: str) -> str:
    """The system of a cell: a name, or a bare code of EPSG or, as ArcGIS has them, of Esri."""
    if not text.isdecimal():
        return crs_name(text)
    try:
        return crs_name(f"EPSG:{text}")
    except UnknownCrs:
        return crs_name(f"ESRI:{text}")
