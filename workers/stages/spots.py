"""Where images of an index stand and look, in WGS 84, whatever their survey's system and north."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.config import Where
from geo.crs import ToWgs84
from geo.poses import Poses, true_headings_of
from index.catalogue import CatalogueRow
from index.opened import OpenedIndex
from index.selecting import candidates

SAMPLE = 2_000
"""Cameras that stand for a survey's extent, every so manieth."""
ANYWHERE = Where()


@dataclass(frozen=True, slots=True)
class Spots:
    """Where images stand and look; NaN: not known.

    lon_deg, lat_deg : (n,) float64. height_m : (n,) float64 above the ellipsoid. heading_deg :
    (n,) float64 in [0, 360), clockwise from true north.
    """

    lon_deg: NDArray[np.float64]
    lat_deg: NDArray[np.float64]
    height_m: NDArray[np.float64]
    heading_deg: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Ground:
    """The ground that a survey covers.

    to_wgs84 : the index's conversion. lon_deg, lat_deg : (n,) float64 of at most `SAMPLE`
    of its cameras, spread evenly over the catalogue.
    """

    to_wgs84: ToWgs84
    lon_deg: NDArray[np.float64]
    lat_deg: NDArray[np.float64]


@functools.lru_cache(maxsize=4)
def ground_of(index: OpenedIndex, where: Where = ANYWHERE) -> Ground | None:
    """The ground of an index, of those of its images that are meant; None: none has a pose."""
    if index.to_wgs84 is None:
        return None
    among = candidates(index, where)
    easting = among.of(index.catalogue.numbers("easting"))
    northing = among.of(index.catalogue.numbers("northing"))
    posed = np.flatnonzero(np.isfinite(easting) & np.isfinite(northing))
    if not len(posed):
        return None
    some = posed[:: -(-len(posed) // SAMPLE)]
    return Ground(index.to_wgs84, *index.to_wgs84.lon_lat(easting[some], northing[some]))


def spots_of(rows: Sequence[CatalogueRow], ground: Ground | None) -> Spots:
    """Where some images stand and look, in the order of `rows`."""
    spots = Spots(*(np.full(len(rows), np.nan) for _ in range(4)))
    posed = [n for n, row in enumerate(rows) if row.easting is not None]
    if ground is None or not posed:
        return spots
    poses = Poses(
        easting=_known([rows[n].easting for n in posed]),
        northing=_known([rows[n].northing for n in posed]),
        altitude_m=_known([rows[n].altitude_m for n in posed]),
        heading_deg=_known([rows[n].heading_deg for n in posed]),
        norths=np.array([rows[n].north for n in posed], dtype=np.str_),
        captured_at=tuple(rows[n].captured_at for n in posed),
    )
    lon, lat, height = ground.to_wgs84.positions(poses.easting, poses.northing, poses.altitude_m)
    spots.lon_deg[posed], spots.lat_deg[posed], spots.height_m[posed] = lon, lat, height
    spots.heading_deg[posed] = true_headings_of(poses, ground.to_wgs84)
    return spots


def _known(values: Sequence[float | None]) -> NDArray[np.float64]:
    """(n,) float64, NaN for None."""
    return np.array(values, dtype=np.float64)
