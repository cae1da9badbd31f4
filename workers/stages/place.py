"""Place: the matches of a photo become GeoJSON features, and with them what they say together.

The estimate is where the photographer stood, the target what they looked at; both are had from
the first few matches, and how sure they are from the scores of all candidates.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.config import SearchConfig
from contracts.records import Match
from geo.confidence import Evidence, prominence
from geo.estimate import LonLatConsensus, consensus_lon_lat
from geo.frames import LocalMetres
from geo.geojson import (
    Feature,
    PlacedEstimate,
    PlacedMatch,
    PlacedTarget,
    estimate_feature,
    match_feature,
    target_feature,
)
from geo.sightlines import LonLatTarget, target_lon_lat
from index.catalogue import CatalogueRow
from index.models import placing_model
from index.opened import OpenedIndex
from retrieval.fusion import Scores
from retrieval.score_curves import curve_features
from survey.uris import image_uri
from workers.stages.retrieve import Chosen
from workers.stages.spots import Ground, Spots, ground_of, spots_of

ESTIMATE_FROM = 10
"""Matches that the estimate looks at, however many are asked for."""


@dataclass(frozen=True, slots=True)
class Finding:
    """What the first matches say together, and what speaks for it.

    distances_m : (n,) from the place to cameras all over the ground searched. position_error_m :
    that the survey states for the matches, 0 where it states none.
    """

    place: LonLatConsensus
    evidence: Evidence
    distances_m: NDArray[np.float64]
    position_error_m: float
    target: LonLatTarget | None


def place(
    index: OpenedIndex,
    query: str,
    chosen: Chosen,
    matches: Sequence[Match],
    search: SearchConfig,
    scores: Scores,
) -> list[Feature]:
    """The first matches as features, then the estimate and the target where there are any.

    matches : the first of the ranking, `ESTIMATE_FROM` or more; `search.top` are told. scores : of
    all candidates.
    """
    rows = index.catalogue.rows([match.image_id for match in matches])
    ground = ground_of(index, search.where)
    spots = spots_of(rows, ground)
    features = [
        match_feature(_placed(index, query, chosen, match, row, spots, at))
        for at, (match, row) in enumerate(zip(matches[: search.top], rows, strict=False))
    ]
    if ground is None:
        return features
    density = searched_density(index, chosen)
    finding = find(matches, rows, spots, ground, scores, density)
    if finding is None:
        return features
    return [*features, *finding_features(query, chosen, finding)]


def searched_density(index: OpenedIndex, chosen: Chosen) -> float:
    """Mean share of the images that a word of the chosen detectors is in, candidates or not."""
    descriptors = index.config.features.descriptors
    return index.density([f"{det}-{desc}" for det in chosen.detectors for desc in descriptors])


def find(
    matches: Sequence[Match],
    rows: Sequence[CatalogueRow],
    spots: Spots,
    ground: Ground,
    scores: Scores,
    density: float,
) -> Finding | None:
    """What the first matches say together; None where none of them has a place.

    Parameters
    ----------
    matches, rows, spots : of the first of the ranking, in one order. scores : of all candidates.
    density : mean share of the images that a word of the channels searched is in.
    """
    first = slice(0, ESTIMATE_FROM)
    lon, lat = spots.lon_deg[first], spots.lat_deg[first]
    score = [match.score for match in matches[first]]
    found = consensus_lon_lat(lon, lat, score)
    if found is None:
        return None
    n_images = len(scores.values)
    standing = prominence(curve_features(scores, n_images).z_score, n_images, density)
    measured = [not row.heading_derived for row in rows[first]]
    hfov = [np.nan if row.hfov_deg is None else row.hfov_deg for row in rows[first]]
    x_m, y_m = LocalMetres(found.lon_deg, found.lat_deg).from_lon_lat(
        ground.lon_deg, ground.lat_deg
    )
    stated = [row.position_error_m for row in rows[first] if row.position_error_m is not None]
    return Finding(
        place=found,
        evidence=Evidence(standing, found.share),
        distances_m=np.hypot(x_m, y_m),
        position_error_m=float(np.median(stated)) if stated else 0.0,
        target=target_lon_lat(
            lon, lat, np.where(measured, spots.heading_deg[first], np.nan), hfov, score
        ),
    )


def finding_features(query: str, chosen: Chosen, finding: Finding) -> list[Feature]:
    """The estimate, with how sure it is, and the target."""
    certainty = placing_model().certainty(
        finding.evidence, finding.distances_m, finding.position_error_m
    )
    estimate = estimate_feature(
        PlacedEstimate(
            query=query,
            lon_deg=finding.place.lon_deg,
            lat_deg=finding.place.lat_deg,
            radius_m=certainty.radius_68_m,
            support=finding.place.support,
            detectors=chosen.detectors,
            k=chosen.k,
            choice=chosen.choice,
            radius_95_m=certainty.radius_95_m,
            confidence=certainty.confidence,
            in_survey=certainty.in_survey,
        )
    )
    target = finding.target
    if target is None or certainty.in_survey is False:  # strangers' rays cross by chance
        return [estimate]
    placed = PlacedTarget(query, target.lon_deg, target.lat_deg, target.radius_m, target.support)
    return [estimate, target_feature(placed)]


def _placed(
    index: OpenedIndex,
    query: str,
    chosen: Chosen,
    match: Match,
    row: CatalogueRow,
    spots: Spots,
    at: int,
) -> PlacedMatch:
    return PlacedMatch(
        query=query,
        rank=match.rank,
        score=match.score,
        image=row.uri,
        uri=image_uri(row.path, row.fragment),
        image_id=row.image_id,
        lon_deg=float(spots.lon_deg[at]),
        lat_deg=float(spots.lat_deg[at]),
        heading_deg=float(spots.heading_deg[at]),
        pitch_deg=row.pitch_deg,
        roll_deg=row.roll_deg,
        hfov_deg=row.hfov_deg,
        captured_at=row.captured_at,
        detectors=chosen.detectors,
        k=chosen.k,
        predicted_map=chosen.predicted_map,
        choice=chosen.choice,
        generation=index.generation.number,
        height_m=float(spots.height_m[at]),
        heading_derived=row.heading_derived,
        position_error_m=row.position_error_m,
    )
