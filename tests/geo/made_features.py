"""One feature of every kind, and the text of their collection."""

import math
from dataclasses import replace

from geo.geojson import (
    Feature,
    PlacedEstimate,
    PlacedMatch,
    PlacedTarget,
    collection_text,
    error_feature,
    estimate_feature,
    match_feature,
    target_feature,
)

MATCH = PlacedMatch(
    query="cartes/été 1910.jpg",
    rank=1,
    score=0.75,
    image="run1/a.jpg",
    uri="file:///survey/run1/a.jpg",
    image_id=7,
    lon_deg=2.33655573123,
    lat_deg=44.99997468456,
    heading_deg=359.99999999,
    pitch_deg=-1.5,
    roll_deg=0.25,
    hfov_deg=None,
    captured_at="2014-06-16T10:00:00+02:00",
    detectors=("hesaff", "star"),
    k=2,
    predicted_map=math.nan,
    generation=3,
)
ESTIMATE = PlacedEstimate(
    "cartes/été 1910.jpg", 2.3365, 45.0, 12.3456, 4, ("hesaff", "star"), 2, "default: no model"
)
TARGET = PlacedTarget("cartes/été 1910.jpg", 2.3364, 45.0001, 3.456, 3)


def features() -> list[Feature]:
    """One of every kind, and what may be missing missing."""
    return [
        match_feature(MATCH),
        match_feature(replace(MATCH, rank=2, lon_deg=None, lat_deg=math.nan)),
        estimate_feature(ESTIMATE),
        target_feature(TARGET),
        error_feature("broken.jpg", "no image data"),
    ]


def text(of: list[Feature], about: dict[str, object] | None = None) -> str:
    return "".join(collection_text(of, about))


ABOUT: dict[str, object] = {"version": "1.0", "crs": "EPSG:2154", "missing_grids": []}
