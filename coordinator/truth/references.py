"""Our own ground truth: one JSON object, query path -> list of relevant references."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from contracts.errors import BadTruth
from coordinator.truth.written import FORMATS, WrittenQuery

_TRUTH = TypeAdapter(dict[str, list[str]])


def read_references(path: Path, content: bytes) -> list[WrittenQuery]:
    """Read the object; the photo is the query's path as it is written.

    Raises
    ------
    BadTruth : it is no such object, or one with a query twice.
    """
    try:
        truth = _TRUTH.validate_python(json.loads(content, object_pairs_hook=_object), strict=True)
    except (ValueError, RecursionError) as error:  # pydantic's errors are ValueErrors
        raise BadTruth(
            f"{path} is not a ground truth ({_what_is_wrong(error)}). Expected {FORMATS}."
        ) from error
    return [WrittenQuery(query, query, tuple(references)) for query, references in truth.items()]


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object; of two equal keys Python would silently keep the last."""
    content = dict(pairs)
    if len(content) < len(pairs):
        twice = next(key for key, count in Counter(key for key, _ in pairs).items() if count > 1)
        raise ValueError(f"{twice!r} is there twice; put its references into one list")
    return content


def _what_is_wrong(error: Exception) -> str:
    if isinstance(error, RecursionError):
        return "it is nested too deeply"
    if isinstance(error, ValidationError):
        first = error.errors()[0]
        where = ", ".join(repr(part) for part in first["loc"])
        return f"{where}: {first['msg']}" if where else str(first["msg"])
    return str(error)
