"""Results as GeoJSON objects (RFC 7946): features, their collection, its text.

Positions are WGS 84 longitude and latitude, 7 decimals (a centimetre), with a height only where
it is ellipsoidal and known; there is no `crs` member; a match without pose has a null geometry.
"""

import hashlib
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NotRequired, TypedDict

from geo.bounds import Bounds

DECIMALS = 7
_ANGLE_DECIMALS = 6

Kind = Literal["match", "estimate", "target", "error"]


class Point(TypedDict):
    """A GeoJSON position: longitude, latitude and perhaps an ellipsoidal height in metres."""

    type: Literal["Point"]
    coordinates: list[float]


class Feature(TypedDict):
    """A GeoJSON feature of ours; `properties` are those of its `kind`."""

    type: Literal["Feature"]
    id: str
    geometry: Point | None
    properties: dict[str, object]


class FeatureCollection(TypedDict):
    """A GeoJSON feature collection; no `bbox` when nothing has a place."""

    type: Literal["FeatureCollection"]
    bbox: NotRequired[list[float]]
    features: list[Feature]


@dataclass(frozen=True, slots=True)
class PlacedMatch:
    """One match of a query with its camera's place. None, or NaN: not known.

    `query` is the path as given, `image` the uri relative to its survey, `uri` one that can be
    resolved (`survey.uris.image_uri`). `heading_deg` is clockwise from true north, `pitch_deg` up
    positive, `roll_deg` right side down positive. `choice` says how the detectors and k came to
    be. `height_m` is ellipsoidal. `heading_derived`: the heading is the track's direction, not
    measured. `position_error_m` is the survey's own word on its position, horizontal.
    """

    query: str
    rank: int
    score: float
    image: str
    uri: str
    image_id: int
    lon_deg: float | None
    lat_deg: float | None
    heading_deg: float | None
    pitch_deg: float | None
    roll_deg: float | None
    hfov_deg: float | None
    captured_at: str | None
    detectors: Sequence[str]
    k: int
    predicted_map: float | None
    generation: int
    choice: str | None = None
    height_m: float | None = None
    heading_derived: bool = False
    position_error_m: float | None = None


@dataclass(frozen=True, slots=True)
class PlacedEstimate:
    """Where a query was probably taken; `support` matches agree within `radius_m` metres.

    The truth lies inside `radius_m` with a probability of 68 %, inside `radius_95_m` of 95 %.
    `confidence`, 0 to 1, is that the place is in the survey at all; `in_survey` is its verdict.
    None: not known.
    """

    query: str
    lon_deg: float
    lat_deg: float
    radius_m: float
    support: int
    detectors: Sequence[str]
    k: int
    choice: str | None = None
    radius_95_m: float | None = None
    confidence: float | None = None
    in_survey: bool | None = None


@dataclass(frozen=True, slots=True)
class PlacedTarget:
    """What a query shows: the lines of sight of `support` matches meet within `radius_m` metres."""

    query: str
    lon_deg: float
    lat_deg: float
    radius_m: float
    support: int


def match_feature(match: PlacedMatch) -> Feature:
    """The feature of one match.

    Raises
    ------
    ValueError : the position lies outside longitude [-180, 180] or latitude [-90, 90].
    """
    properties: dict[str, object] = {
        "kind": "match",
        "query": match.query,
        "rank": int(match.rank),
        "score": float(match.score),
        "image": match.image,
        "uri": match.uri,
        "image_id": int(match.image_id),
        "heading_deg": _heading(match.heading_deg),
        "heading_derived": match.heading_derived,
        "pitch_deg": _angle(match.pitch_deg),
        "roll_deg": _angle(match.roll_deg),
        "hfov_deg": _angle(match.hfov_deg),
        "position_error_m": _metres(match.position_error_m),
        "captured_at": match.captured_at,
        "detectors": list(match.detectors),
        "k": int(match.k),
        "predicted_map": _known(match.predicted_map),
        "choice": match.choice,
        "generation": int(match.generation),
    }
    geometry = _point(match.lon_deg, match.lat_deg, match.height_m)
    return _feature(match.query, "match", int(match.rank), geometry, properties)


def estimate_feature(estimate: PlacedEstimate) -> Feature:
    """The feature of one query's estimated place.

    Raises
    ------
    ValueError : there is no position, or one outside longitude [-180, 180] or latitude [-90, 90].
    """
    properties: dict[str, object] = {
        "kind": "estimate",
        "query": estimate.query,
        "radius_m": round(float(estimate.radius_m), 2),
        "radius_95_m": _metres(estimate.radius_95_m),
        "support": int(estimate.support),
        "confidence": _known(estimate.confidence),
        "in_survey": estimate.in_survey,
        "detectors": list(estimate.detectors),
        "k": int(estimate.k),
        "choice": estimate.choice,
    }
    geometry = _place("estimate", estimate.query, estimate.lon_deg, estimate.lat_deg)
    return _feature(estimate.query, "estimate", 0, geometry, properties)


def target_feature(target: PlacedTarget) -> Feature:
    """The feature of what one query shows.

    Raises
    ------
    ValueError : there is no position, or one outside longitude [-180, 180] or latitude [-90, 90].
    """
    properties: dict[str, object] = {
        "kind": "target",
        "query": target.query,
        "radius_m": round(float(target.radius_m), 2),
        "support": int(target.support),
    }
    geometry = _place("target", target.query, target.lon_deg, target.lat_deg)
    return _feature(target.query, "target", 0, geometry, properties)


def error_feature(query: str, message: str) -> Feature:
    """The feature of a query that could not be located: no place, and the reason."""
    properties: dict[str, object] = {"kind": "error", "query": query, "error": message}
    return _feature(query, "error", 0, None, properties)


def renamed_feature(feature: Feature, query: str) -> Feature:
    """The same feature of a photo that is the same under another name."""
    properties = {**feature["properties"], "query": query}
    kind, rank = properties["kind"], properties.get("rank", 0)
    return {**feature, "id": _id(query, kind, rank), "properties": properties}


def feature_collection(features: Iterable[Feature]) -> FeatureCollection:
    """All features in the order given, with the smallest `bbox` around those that have a place.

    Across longitude 180 the box's west is greater than its east (RFC 7946, section 5.2).
    """
    listed, bounds = list(features), Bounds()
    for feature in listed:
        _widen(bounds, feature)
    collection: FeatureCollection = {"type": "FeatureCollection", "features": listed}
    bbox = bounds.bbox()
    return collection if bbox is None else {**collection, "bbox": bbox}


def collection_text(
    features: Iterable[Feature], about: Mapping[str, object] | None = None
) -> Iterator[str]:
    """The text of a feature collection, piece by piece as features come; one a line, bbox last.

    It can always be written as UTF-8: a byte of a file name that is not UTF-8 (a lone surrogate
    in Python) is written as its JSON escape, from which Python reads the same name again.

    Parameters
    ----------
    about : where the results come from; the foreign member `flaneur` (RFC 7946, section 6.1).

    Raises
    ------
    ValueError : a number is NaN or infinite; RFC 8259 has no way to write it.
    """
    yield '{"type":"FeatureCollection",'
    if about:
        yield f'"flaneur":{_json(about)},'
    yield '"features":['
    bounds, between = Bounds(), "\n"
    for feature in features:
        _widen(bounds, feature)
        yield between + _json(feature)
        between = ",\n"
    bbox = bounds.bbox()
    yield "\n]" + ("" if bbox is None else f',"bbox":{_json(bbox)}') + "}\n"


def sequence_text(features: Iterable[Feature]) -> Iterator[str]:
    """The text of a GeoJSON text sequence (RFC 8142), a feature a record, as they come.

    Every record begins with a record separator (U+001E) and ends with a line feed, so that one
    that was cut off is known. Names and numbers as `collection_text`.

    Raises
    ------
    ValueError : a number is NaN or infinite.
    """
    for feature in features:
        yield f"\x1e{_json(feature)}\n"


def _json(value: object) -> str:
    text = json.dumps(value, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return re.sub(r"[\ud800-\udfff]", lambda found: f"\\u{ord(found.group()):04x}", text)


def _widen(bounds: Bounds, feature: Feature) -> None:
    if feature["geometry"] is not None:
        bounds.add(feature["geometry"]["coordinates"])


def _feature(
    query: str, kind: Kind, rank: int, geometry: Point | None, properties: dict[str, object]
) -> Feature:
    return {
        "type": "Feature",
        "id": _id(query, kind, rank),
        "geometry": geometry,
        "properties": properties,
    }


def _id(query: str, kind: object, rank: object) -> str:
    return hashlib.sha256(json.dumps([query, kind, rank]).encode()).hexdigest()[:32]


def _point(lon_deg: float | None, lat_deg: float | None, height_m: float | None) -> Point | None:
    lon, lat, height = _known(lon_deg), _known(lat_deg), _known(height_m)
    if lon is None or lat is None:
        return None
    if not (-180.0 <= lon <= 180.0 and -90.0 <= lat <= 90.0):
        raise ValueError(
            f"longitude {lon}, latitude {lat} is no place in WGS 84 degrees; "
            "convert the survey's coordinates first (geo.crs.ToWgs84)"
        )
    # Adding zero turns -0.0 into 0.0, so that equal places read the same.
    place = [round(lon, DECIMALS) + 0.0, round(lat, DECIMALS) + 0.0]
    return {"type": "Point", "coordinates": place if height is None else [*place, round(height, 3)]}


def _place(kind: Kind, query: str, lon_deg: float, lat_deg: float) -> Point:
    geometry = _point(lon_deg, lat_deg, None)
    if geometry is None:
        raise ValueError(f"the {kind} of {query!r} has no position; leave it out")
    return geometry


def _known(value: float | None) -> float | None:
    """The number, or None for the NaN by which arrays say that there is none."""
    return None if value is None or math.isnan(value) else float(value)


def _metres(length_m: float | None) -> float | None:
    known = _known(length_m)
    return None if known is None else round(known, 2)


def _angle(angle_deg: float | None) -> float | None:
    known = _known(angle_deg)
    return None if known is None else round(known, _ANGLE_DECIMALS) + 0.0


def _heading(heading_deg: float | None) -> float | None:
    rounded = _angle(heading_deg)
    # Rounding can reach the whole turn.
    return None if rounded is None else rounded % 360.0
