"""Estimates on the canvases of a IIIF manifest: the navPlace extension of Presentation 3.

https://iiif.io/api/extension/navplace/
"""

import unicodedata
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any
from urllib.parse import unquote, urlsplit

from contracts.errors import WrongInput
from contracts.records import Skipped

Json = dict[str, Any]

PRESENTATION_3 = "http://iiif.io/api/presentation/3/context.json"
NAVPLACE = "http://iiif.io/api/extension/navplace/context.json"
_IMAGE_REQUEST_PARTS = 4
"""region/size/rotation/quality.format, behind the identifier of a IIIF image."""


@dataclass(frozen=True, slots=True)
class Navigated:
    """A manifest with places. left_out : queries that are on no canvas now, and why."""

    manifest: Json
    n_placed: int
    left_out: tuple[Skipped, ...]


def with_places(manifest: Json, features: Iterable[Json], name: str) -> Navigated:
    """The manifest with the estimate of each query on the canvas that shows the query.

    A canvas shows a query if its id, its label or the name of an image painted on it is the
    query, the name of its file, or that name without its ending. Nothing but `navPlace` of these
    canvases and `@context` is changed.

    Parameters
    ----------
    manifest : as parsed; not changed. features : of a results file, of any kind.
    name : of the manifest, for messages.

    Raises
    ------
    WrongInput : not a manifest of Presentation 3, or none of the estimates is of its canvases.
    """
    items: list[Any] = list(_presentation_3(manifest, name)["items"])
    canvases = {at: each for at, each in enumerate(items) if isinstance(each, dict)}
    named: dict[str, list[int]] = defaultdict(list)
    for at, canvas in canvases.items():
        for canvas_name in _canvas_names(canvas):
            named[canvas_name].append(at)
    left_out, n_placed = [], 0
    for query, estimate, reason in _estimates(features):
        found = sorted({at for each in _query_names(query) for at in named.get(each, ())})
        if estimate is None:
            left_out.append(Skipped(query, reason))
        elif len(found) != 1:
            left_out.append(Skipped(query, _why_not_one(len(found))))
        elif "navPlace" in items[found[0]]:
            left_out.append(Skipped(query, "its canvas has a navPlace already, which is kept"))
        else:
            items[found[0]] = {**items[found[0]], "navPlace": _nav_place(estimate)}
            n_placed += 1
    if not n_placed:
        raise WrongInput(_nothing_placed(name, list(canvases.values()), left_out))
    context = _with_context(manifest["@context"])
    return Navigated({**manifest, "@context": context, "items": items}, n_placed, tuple(left_out))


def _presentation_3(manifest: Json, name: str) -> Json:
    contexts = _as_list(manifest.get("@context"))
    if "@type" in manifest or any("presentation/2" in str(each) for each in contexts):
        raise WrongInput(
            f"{name} is of IIIF Presentation 2, which has no place for navPlace. Ask its server "
            "for version 3, or convert it with a Presentation 2 to 3 upgrader."
        )
    if PRESENTATION_3 not in map(_http, contexts) or manifest.get("type") != "Manifest":
        raise WrongInput(
            f"{name} is no manifest of IIIF Presentation 3: expected type Manifest and @context "
            f"{PRESENTATION_3}, found type {manifest.get('type')!r}. Give one manifest, not a "
            "collection."
        )
    if not isinstance(manifest.get("items"), list):
        raise WrongInput(f"{name}: items is no list of canvases; get the whole manifest.")
    return manifest


def _with_context(context: object) -> list[object]:
    """The extension's context stands before that of the Presentation API (section 3.1)."""
    contexts = _as_list(context)
    if NAVPLACE in map(_http, contexts):
        return contexts
    return [NAVPLACE, *contexts]


def _estimates(features: Iterable[Json]) -> Iterator[tuple[str, Json | None, str]]:
    """Query, its estimate or None, and why it has none."""
    estimates: dict[str, tuple[Json | None, str]] = {}
    for feature in features:
        properties = feature["properties"]
        query = properties["query"]
        if properties["kind"] == "estimate" and properties.get("in_survey") is not False:
            estimates[query] = (feature, "")
        elif properties["kind"] == "estimate":
            estimates[query] = (None, "nothing in the survey stands out as its place")
        elif properties["kind"] == "error":
            estimates[query] = (None, str(properties["error"]))
        else:
            estimates.setdefault(query, (None, "there is no estimate of its place"))
    for query, (estimate, reason) in estimates.items():
        yield query, estimate, reason


def _nav_place(estimate: Json) -> Json:
    """Without ids, which would have to be URIs, and without terms no context defines."""
    radius_m = estimate["properties"]["radius_m"]
    label = f"Estimated place of the photographer, within {radius_m:.0f} m"
    return {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "properties": {"label": {"en": [label]}},
                "geometry": estimate["geometry"],
            }
        ],
    }


def _query_names(query: str) -> set[str]:
    path = PurePosixPath(query.replace("\\", "/"))
    return {_nfc(each) for each in (query, path.name, path.stem) if each}


def _canvas_names(canvas: Json) -> set[str]:
    """What a photo of this canvas may be called."""
    names = {str(canvas.get("id", ""))}
    label = canvas.get("label")
    for values in label.values() if isinstance(label, dict) else ():
        names.update(str(each) for each in _as_list(values))
    for body in _painted(canvas):
        names.update(_image_names(str(body.get("id", ""))))
        for service in _as_list(body.get("service")):
            if isinstance(service, dict):
                names.update(_image_names(str(service.get("id") or service.get("@id") or "")))
    return {_nfc(each) for each in names if each}


def _painted(canvas: Json) -> Iterator[Json]:
    """The images painted on a canvas: bodies of the annotations on its pages."""
    for page in _as_list(canvas.get("items")):
        for annotation in _as_list(page.get("items")) if isinstance(page, dict) else ():
            for body in _as_list(annotation.get("body")) if isinstance(annotation, dict) else ():
                if isinstance(body, dict):
                    yield body


def _image_names(uri: str) -> set[str]:
    """Of a file, of a IIIF image service, or of a request to one."""
    parts = [unquote(part) for part in urlsplit(uri).path.split("/") if part]
    names = {uri}
    for identifier in (parts[-1:], parts[-1 - _IMAGE_REQUEST_PARTS : -_IMAGE_REQUEST_PARTS]):
        for each in identifier:
            file = PurePosixPath(each)
            names |= {each, file.name, file.stem}
    return names - {"default.jpg", "default"}


def _why_not_one(n_found: int) -> str:
    if n_found == 0:
        return "no canvas has its name"
    return f"{n_found} canvases have its name; rename the photo as the image of its canvas"


def _nothing_placed(name: str, canvases: list[Json], left_out: list[Skipped]) -> str:
    if not left_out:
        return f"No query in the results to place on {name}."
    shown = ", ".join(repr(each)[:60] for each in sorted(_canvas_names(canvases[0]))[:4])
    canvas = f"The first of {len(canvases)} is called {shown}" if canvases else "It has none"
    first = left_out[0]
    return (
        f"None of {len(left_out)} queries was put on a canvas of {name}. The first, "
        f"{first.uri[:200]!r}: {first.reason}. {canvas}."
    )


def _as_list(value: object) -> list[Any]:
    if value is None:
        return []
    return value if isinstance(value, list) else [value]


def _http(uri: object) -> str:
    """Contexts are named with http; some servers write https."""
    return str(uri).replace("https://", "http://", 1)


def _nfc(name: str) -> str:
    return unicodedata.normalize("NFC", name)
