"""Poses of one coordinate system, or of several, in another."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contracts.errors import UnknownCrs
from contracts.records import Pose
from geo.crs import ToWgs84, area_of, grid_of, parse_crs, parse_full_crs
from geo.headings import true_headings_deg
from geo.heights import vertical_reference
from geo.operations import Operation, best_converter, joined, missing_grids


@dataclass(frozen=True, slots=True)
class Reprojected:
    """Poses in one system.

    poses : in the order they were given. crs : theirs. operations : how each other system was
    converted, by its text. altitudes_dropped : of how many poses the altitude counts from
    something else.
    """

    poses: tuple[Pose, ...]
    crs: str
    operations: dict[str, Operation]
    altitudes_dropped: int

    def told(self, what: str) -> tuple[str, ...]:
        """What a person should know of the conversion of `what`, a sentence each."""
        sentences = [
            f"{what}: converted from {former} into {self.crs} by {operation.name} "
            f"({_accuracy(operation.accuracy_m)})"
            for former, operation in self.operations.items()
        ]
        if self.altitudes_dropped:
            sentences.append(
                f"{what}: {self.altitudes_dropped} altitudes dropped, which count from something "
                f"else than those of {self.crs}"
            )
        return tuple(sentences)


def reproject(poses: Sequence[Pose], crs: str, allow_ballpark: bool = False) -> Reprojected:
    """The same poses in the coordinate system `crs`.

    A heading from the north of its former grid is turned to true north, for the grids' norths
    differ; true and magnetic ones stay, and so do pitch and roll. An altitude stays where both
    systems count it from the same, or neither says from what; else it is dropped. Poses that are
    in `crs` already are returned as they are.

    Parameters
    ----------
    poses : each in the system its `crs` names. crs : see `geo.crs.parse_full_crs`.
    allow_ballpark : whether a conversion is taken whose error nobody knows.

    Raises
    ------
    UnknownCrs : a system is not known, has no good enough conversion, or a pose has no place in
        the new one.
    """
    found = list(poses)
    operations: dict[str, Operation] = {}
    dropped = 0
    for former in sorted({pose.crs for pose in poses} - {crs}):
        rows = [row for row, pose in enumerate(poses) if pose.crs == former]
        group = [poses[row] for row in rows]
        moved, operations[former] = _converted(group, former, crs, allow_ballpark)
        for row, pose in zip(rows, moved, strict=True):
            dropped += pose.altitude_m is None and poses[row].altitude_m is not None
            found[row] = pose
    return Reprojected(tuple(found), crs, operations, dropped)


def _accuracy(metres: float | None) -> str:
    return "of unknown accuracy" if metres is None else f"to {metres:g} m"


def _converted(
    poses: Sequence[Pose], former: str, crs: str, allow_ballpark: bool
) -> tuple[list[Pose], Operation]:
    x = np.array([pose.easting for pose in poses], np.float64)
    y = np.array([pose.northing for pose in poses], np.float64)
    easting, northing, operation = _moved(x, y, former, crs, allow_ballpark)
    headings = _true_headings(poses, grid_of(former).convergence_deg(x, y))
    same_height = _same_vertical(former, crs)
    moved = [
        replace(
            pose,
            easting=east,
            northing=north,
            crs=crs,
            altitude_m=pose.altitude_m if same_height else None,
            heading_deg=heading,
            north="true" if pose.north == "grid" else pose.north,
        )
        for pose, east, north, heading in zip(
            poses, easting.tolist(), northing.tolist(), headings, strict=True
        )
    ]
    return moved, operation


def _moved(
    x: NDArray[np.float64], y: NDArray[np.float64], former: str, crs: str, allow_ballpark: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64], Operation]:
    """Straight from one system to the other, or by way of WGS 84.

    For some pairs PROJ knows only an operation by a shift grid, which may be missing, although
    each has a less accurate one to WGS 84: the old French Lambert zones and Lambert-93.
    """
    area = area_of(former, x, y)
    try:
        straight = best_converter(parse_crs(former), parse_crs(crs), area, allow_ballpark=False)
    except UnknownCrs:
        away, back = (ToWgs84(text, area, allow_ballpark) for text in (former, crs))
        lon, lat = away.lon_lat(x, y)
        grids = missing_grids(parse_crs(former), parse_crs(crs), area)
        return *back.from_lon_lat(lon, lat), joined(away.operation, back.operation, grids)
    easting, northing = (np.asarray(v) for v in straight.transformer.transform(x, y))
    _refuse_unless(np.isfinite(easting) & np.isfinite(northing), x, y, former, crs)
    return easting, northing, straight.operation


def _true_headings(
    poses: Sequence[Pose], convergence_deg: NDArray[np.float64]
) -> list[float | None]:
    """Headings of grid north turned to true north, the others as they are."""
    given = [np.nan if pose.heading_deg is None else pose.heading_deg for pose in poses]
    true = true_headings_deg(given, "grid", convergence_deg, np.nan).tolist()
    return [
        turned if pose.north == "grid" and pose.heading_deg is not None else pose.heading_deg
        for pose, turned in zip(poses, true, strict=True)
    ]


def _same_vertical(former: str, crs: str) -> bool:
    before, after = (vertical_reference(parse_full_crs(text)) for text in (former, crs))
    if before is None or after is None:
        return before is after
    return before.equals(after)


def _refuse_unless(
    good: NDArray[np.bool_], x: NDArray[np.float64], y: NDArray[np.float64], former: str, crs: str
) -> None:
    if good.all():
        return
    first = int(np.argmin(good))
    raise UnknownCrs(
        f"{int((~good).sum())} of {good.size} poses in {former} ({parse_crs(former).name}) have no "
        f"place in {crs} ({parse_crs(crs).name}); the first has easting {x[first]:g}, northing "
        f"{y[first]:g}; check that the coordinates belong to their system, x before y"
    )
