"""Place: the matches of a photo become GeoJSON features, with an estimate where one can be had."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contracts.records import Match
from geo.crs import ToWgs84
from geo.estimate import consensus_lon_lat
from geo.geojson import Feature, PlacedEstimate, PlacedMatch, estimate_feature, match_feature
from geo.headings import true_heading_deg
from index.catalogue import CatalogueRow
from index.opened import OpenedIndex
from workers.stages.retrieve import Chosen

ESTIMATE_FROM = 10
"""Matches that the estimate looks at, however many are asked for."""


@dataclass(frozen=True, slots=True)
class _Spot:
    """Where an image stands in WGS 84; NaN and None: not known."""

    lon_deg: float
    lat_deg: float
    heading_deg: float | None


def place(
    index: OpenedIndex, query: str, chosen: Chosen, matches: Sequence[Match], top: int
) -> list[Feature]:
    """The first `top` matches as features, and the estimate from the first few."""
    rows = index.catalogue.rows([match.image_id for match in matches])
    spots = _spots(rows, index.generation.crs)
    features = [
        match_feature(
            PlacedMatch(
                query=query,
                rank=match.rank,
                score=match.score,
                image=row.uri,
                uri=row.path,
                image_id=row.image_id,
                lon_deg=spot.lon_deg,
                lat_deg=spot.lat_deg,
                heading_deg=spot.heading_deg,
                pitch_deg=row.pitch_deg,
                roll_deg=row.roll_deg,
                hfov_deg=row.hfov_deg,
                captured_at=row.captured_at,
                detectors=chosen.detectors,
                k=chosen.k,
                predicted_map=chosen.predicted_map,
                choice=chosen.choice,
                generation=index.generation.number,
            )
        )
        for match, row, spot in zip(matches[:top], rows, spots, strict=False)
    ]
    found = consensus_lon_lat(
        [spot.lon_deg for spot in spots[:ESTIMATE_FROM]],
        [spot.lat_deg for spot in spots[:ESTIMATE_FROM]],
        [match.score for match in matches[:ESTIMATE_FROM]],
    )
    if found is None:
        return features
    estimate = PlacedEstimate(
        query=query,
        lon_deg=found.lon_deg,
        lat_deg=found.lat_deg,
        radius_m=found.radius_m,
        support=found.support,
        detectors=chosen.detectors,
        k=chosen.k,
        choice=chosen.choice,
    )
    return [*features, estimate_feature(estimate)]


def _spots(rows: Sequence[CatalogueRow], crs: str | None) -> list[_Spot]:
    unknown = _Spot(np.nan, np.nan, None)
    posed = [n for n, row in enumerate(rows) if row.easting is not None]
    spots = [unknown] * len(rows)
    if crs is None or not posed:
        return spots
    converter = ToWgs84(crs)
    easting = np.array([rows[n].easting for n in posed], dtype=np.float64)
    northing = np.array([rows[n].northing for n in posed], dtype=np.float64)
    lon, lat = converter.lon_lat(easting, northing)
    convergence = converter.convergence_deg(easting, northing)
    for at, n in enumerate(posed):
        north = rows[n].north
        heading = (
            true_heading_deg(rows[n].heading_deg, north, float(convergence[at])) if north else None
        )
        spots[n] = _Spot(float(lon[at]), float(lat[at]), heading)
    return spots
