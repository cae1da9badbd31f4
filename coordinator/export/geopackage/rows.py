"""Answers as rows of the layers, a batch at a time."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np
import pyarrow as pa
import pyproj

from coordinator.export.columns import Row, table
from coordinator.export.geopackage.layers import (
    ESTIMATE_AREAS,
    ESTIMATES,
    LINKS,
    MATCHES,
    QUERIES,
    TARGETS,
    VIEWS,
    Layer,
)
from coordinator.export.geopackage.places import camera_points, feature_points, lon_lat
from coordinator.export.geopackage.thumbnails import Thumbnails
from coordinator.querying import Located
from geo.antimeridian import Shapes, placed_lines
from geo.crs import ToWgs84
from geo.geojson import Feature
from geo.views import ASSUMED_HFOV_DEG, circles, view_wedges
from index.catalogue import CatalogueRow
from index.opened import OpenedIndex

VIEW_RANGE_M = 30.0
"""How far views are drawn: to the facades across a street, short enough to tell them apart."""
_GEOD = pyproj.Geod(ellps="WGS84")


@dataclass(frozen=True, slots=True)
class _Sorted:
    """The features of one answer by kind."""

    answer: Located
    matches: list[Feature]
    estimate: Feature | None
    targets: list[Feature]

    @classmethod
    def of(cls, answer: Located) -> "_Sorted":
        estimate = next(iter(answer.of_kind("estimate")), None)
        return cls(answer, answer.of_kind("match"), estimate, answer.of_kind("target"))


def layer_tables(
    answers: Sequence[Located], index: OpenedIndex, system: ToWgs84, thumbnails: Thumbnails
) -> Iterator[tuple[Layer, pa.Table]]:
    """A table of every layer, in the order of `LAYERS`, with no row where there is nothing.

    Raises
    ------
    UnknownCrs : a place lies where the survey's system has no coordinates.
    """
    batch = [_Sorted.of(answer) for answer in answers]
    estimates = [each.estimate for each in batch if each.estimate is not None]
    targets = [target for each in batch for target in each.targets]
    matches = [match for each in batch for match in each.matches]
    yield QUERIES, _queries(batch, system, thumbnails)
    yield MATCHES, _matches(matches, index, thumbnails)
    yield ESTIMATES, _points(ESTIMATES, estimates, system)
    yield TARGETS, _points(TARGETS, targets, system)
    yield LINKS, _links(batch, system)
    yield ESTIMATE_AREAS, _areas(estimates, system)
    yield VIEWS, _views(matches, system)


def _queries(batch: Sequence[_Sorted], system: ToWgs84, thumbnails: Thumbnails) -> pa.Table:
    rows = [
        {
            **(_properties(each.matches[0]) if each.matches else {}),
            **(_properties(each.estimate) if each.estimate else {}),
            **_name(each.answer.query),
            "n_matches": len(each.matches),
            "best_score": each.matches[0]["properties"]["score"] if each.matches else None,
            "best_image": each.matches[0]["properties"]["image"] if each.matches else None,
            "seconds": each.answer.seconds,
            "error": each.answer.error,
            "thumbnail": thumbnails.of_photo(each.answer.query),
        }
        for each in batch
    ]
    points = np.full(len(batch), None, dtype=object)
    placed = [n for n, each in enumerate(batch) if each.estimate is not None]
    points[placed] = feature_points(
        system, [each.estimate for each in batch if each.estimate is not None]
    )
    return _table(QUERIES, rows, points)


def _matches(matches: Sequence[Feature], index: OpenedIndex, thumbnails: Thumbnails) -> pa.Table:
    known = index.catalogue.rows([_properties(match)["image_id"] for match in matches])
    rows = [
        {
            **named(match),
            **image_properties(row),
            "thumbnail": thumbnails.of_image(row.path, row.fragment, row.quarter_turns),
        }
        for match, row in zip(matches, known, strict=True)
    ]
    return _table(MATCHES, rows, camera_points(known))


def _points(layer: Layer, features: Sequence[Feature], system: ToWgs84) -> pa.Table:
    return _table(layer, [named(each) for each in features], feature_points(system, features))


def _links(batch: Sequence[_Sorted], system: ToWgs84) -> pa.Table:
    pairs = [
        (each.estimate, match)
        for each in batch
        for match in each.matches
        if each.estimate is not None and match["geometry"] is not None
    ]
    from_lon, from_lat = lon_lat([estimate for estimate, _ in pairs])
    to_lon, to_lat = lon_lat([match for _, match in pairs])
    distance_m = _GEOD.inv(from_lon, from_lat, to_lon, to_lat)[2]
    rows = [
        {**named(match), "distance_m": round(float(metres), 2)}
        for (_, match), metres in zip(pairs, distance_m, strict=True)
    ]
    ends = (np.column_stack([from_lon, to_lon]), np.column_stack([from_lat, to_lat]))
    return _table(LINKS, rows, placed_lines(system, *ends))


def _areas(estimates: Sequence[Feature], system: ToWgs84) -> pa.Table:
    areas = [
        (estimate, {**named(estimate), "percent": percent, "radius_m": radius_m})
        for estimate in estimates
        # The wider one first: it is drawn below.
        for percent, name in ((95, "radius_95_m"), (68, "radius_m"))
        if (radius_m := _properties(estimate).get(name)) is not None
    ]
    lon, lat = lon_lat([estimate for estimate, _ in areas])
    shapes = circles(system, lon, lat, [row["radius_m"] for _, row in areas])
    return _table(ESTIMATE_AREAS, [row for _, row in areas], shapes)


def _views(matches: Sequence[Feature], system: ToWgs84) -> pa.Table:
    seen = [
        match
        for match in matches
        if match["geometry"] is not None and _properties(match)["heading_deg"] is not None
    ]
    rows = []
    for match in seen:
        hfov_deg = _properties(match)["hfov_deg"]
        assumed = hfov_deg is None or hfov_deg <= 0
        rows.append(
            {
                **named(match),
                "hfov_deg": ASSUMED_HFOV_DEG if assumed else hfov_deg,
                "assumed_hfov": assumed,
                "range_m": VIEW_RANGE_M,
            }
        )
    lon, lat = lon_lat(seen)
    shapes = view_wedges(
        system,
        *(lon, lat),
        [row["heading_deg"] for row in rows],
        [row["hfov_deg"] for row in rows],
        VIEW_RANGE_M,
    )
    return _table(VIEWS, rows, shapes)


def _table(layer: Layer, rows: Sequence[Row], shapes: Shapes) -> pa.Table:
    return table(layer.columns, rows, shapes)


def _properties(feature: Feature) -> dict[str, Any]:
    return feature["properties"]


def image_properties(row: CatalogueRow) -> dict[str, Any]:
    """What the index knows of a matched image beyond the properties of its feature."""
    return {
        "survey": row.survey,
        "camera": row.camera,
        "altitude_m": row.altitude_m,
    }


def named(feature: Feature) -> dict[str, Any]:
    """The properties of a feature, and the name of its photo."""
    return {**feature["properties"], **_name(str(feature["properties"]["query"]))}


def _name(query: str) -> dict[str, Any]:
    return {"query": query, "name": PurePath(query).name or query}
