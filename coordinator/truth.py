"""Ground truth: query path -> the images of the index that show its place."""

import json
import unicodedata
from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from contracts.errors import BadTruth

_TRUTH = TypeAdapter(dict[str, list[str]])


@dataclass(frozen=True, slots=True)
class JudgedQuery:
    """One query: its name in the truth file, where it is read, and the ids that are relevant."""

    query: str
    path: Path
    relevant: tuple[int, ...]


def read_truth(path: Path, root: Path | None, uris: Sequence[str]) -> list[JudgedQuery]:
    """Read one JSON object, query path -> list of references, and resolve the references.

    A reference names the one image whose uri equals it, or where either ends with the other at
    a `/`. Queries are relative to `root`, by default the folder of the truth file.

    Raises
    ------
    BadTruth : not such an object, or a reference that names no image or several.
    """
    try:
        content = _TRUTH.validate_python(
            json.loads(path.read_bytes(), object_pairs_hook=_object), strict=True
        )
    except OSError as error:
        raise BadTruth(f"{path} cannot be read: {error.strerror}.") from error
    except (ValueError, RecursionError) as error:  # pydantic's errors are ValueErrors
        raise BadTruth(
            f"{path} is not a ground truth: expected one JSON object, query path -> list of "
            f"relevant references ({_what_is_wrong(error)})."
        ) from error
    folder = root or path.parent
    resolve = _Resolver(uris)
    return [
        JudgedQuery(
            query, folder / query, tuple(sorted({resolve.image_id(query, ref) for ref in refs}))
        )
        for query, refs in content.items()
    ]


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


class _Resolver:
    """Finds uris by suffix; candidates are looked up by their last part."""

    def __init__(self, uris: Sequence[str]) -> None:
        self._uris = uris
        self._by_name: dict[str, list[int]] = defaultdict(list)
        for image_id, uri in enumerate(uris):
            self._by_name[uri.rsplit("/", 1)[-1]].append(image_id)

    def image_id(self, query: str, reference: str) -> int:
        reference = unicodedata.normalize("NFC", reference)  # as the uris are
        candidates = self._by_name.get(reference.rsplit("/", 1)[-1], [])
        exact = [each for each in candidates if self._uris[each] == reference]
        found = exact or [each for each in candidates if _ends(self._uris[each], reference)]
        if len(found) == 1:
            return found[0]
        if not found:
            raise BadTruth(
                f"The truth of {query} names {reference}, which is no image of the index. "
                "Was it skipped, or is the path relative to another folder?"
            )
        names = ", ".join(self._uris[each] for each in found[:3])
        raise BadTruth(
            f"The truth of {query} names {reference}, which is several images ({names}). "
            "Write more of its path."
        )


def _ends(uri: str, reference: str) -> bool:
    longer, shorter = (uri, reference) if len(uri) >= len(reference) else (reference, uri)
    return longer.endswith("/" + shorter)
