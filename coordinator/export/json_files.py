"""Reading JSON that others wrote: results that went through other hands, manifests."""

import json
import math
from pathlib import Path
from typing import Any

from contracts.errors import WrongInput


def read_json(path: Path) -> dict[str, Any]:
    """The one object of a JSON file, UTF-8 with or without a byte order mark.

    Raises
    ------
    WrongInput : it cannot be read, or is no JSON object (NaN and infinities are no JSON).
    """
    try:
        content = json.loads(
            path.read_bytes().decode("utf-8-sig"), parse_constant=_finite, parse_float=_finite
        )
    except OSError as error:
        raise WrongInput(f"{path} cannot be read: {error.strerror}.") from error
    except UnicodeDecodeError as error:
        raise WrongInput(
            f"{path} is not UTF-8 text (byte {error.start}); save it as UTF-8."
        ) from error
    except ValueError as error:
        raise WrongInput(f"{path} is no JSON: {error}.") from error
    except RecursionError as error:
        raise WrongInput(f"{path} is nested too deeply to be what is expected.") from error
    if not isinstance(content, dict):
        raise WrongInput(f"{path} holds no JSON object, {{ … }}.")
    return content


def read_results(path: Path) -> list[dict[str, Any]]:
    """The features of a results file of `flaneur locate`.

    Raises
    ------
    WrongInput : as `read_json`, or it is of another maker; says which feature.
    """
    features = read_json(path).get("features")
    if not isinstance(features, list):
        raise WrongInput(f"{path} is no GeoJSON feature collection; give what `locate` wrote.")
    for number, feature in enumerate(features):
        fault = _fault(feature)
        if fault is not None:
            raise WrongInput(
                f"{path}, feature {number}: {fault}. Give a file that `flaneur locate` wrote."
            )
    return features


def _fault(feature: object) -> str | None:
    """What makes a feature none of ours."""
    if not isinstance(feature, dict) or not isinstance(feature.get("properties"), dict):
        return "it has no properties"
    properties = feature["properties"]
    if not isinstance(properties.get("query"), str) or not isinstance(properties.get("kind"), str):
        return "it has no query and kind"
    if properties["kind"] != "estimate":
        return None
    if not _is_number(properties.get("radius_m")):
        return f"its radius_m is {properties.get('radius_m')!r}, expected metres"
    if not _is_point(feature.get("geometry")):
        return "its geometry is no point in longitude and latitude"
    return None


def _is_point(geometry: object) -> bool:
    if not isinstance(geometry, dict) or geometry.get("type") != "Point":
        return False
    place = geometry.get("coordinates")
    return (
        isinstance(place, list)
        and len(place) in (2, 3)
        and all(map(_is_number, place))
        and abs(place[0]) <= 180.0
        and abs(place[1]) <= 90.0
    )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:20]} is no number of JSON")
    return number
