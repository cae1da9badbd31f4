"""IIIF Presentation 2 and 3: what a manifest shows, and what a collection lists.

https://iiif.io/api/presentation/
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

Json = dict[str, Any]

_MANIFESTS = frozenset({"Manifest", "sc:Manifest"})
_COLLECTIONS = frozenset({"Collection", "sc:Collection"})


@dataclass(frozen=True, slots=True)
class Picture:
    """An image painted on a canvas. url : of the image itself.

    service : of the Image API that has it, as the manifest describes it. width_px, height_px : of
    all of it; 0: not told.
    """

    url: str
    service: Json | None
    width_px: int
    height_px: int


@dataclass(frozen=True, slots=True)
class Canvas:
    """A page or photo of a manifest. id : its URI. label : "": it has none."""

    id: str
    label: str
    picture: Picture | None


def kind_of(document: object) -> Literal["manifest", "collection"] | None:
    """What a document is; None: neither."""
    kind = _type(document) if isinstance(document, dict) else ""
    if kind in _MANIFESTS:
        return "manifest"
    return "collection" if kind in _COLLECTIONS else None


def canvases_of(manifest: Json) -> Iterator[Canvas]:
    """The canvases of a manifest, in its order: of version 3, or of the first sequence of 2."""
    if "sequences" in manifest:
        sequences = objects(manifest["sequences"])
        for canvas in objects(sequences[0].get("canvases")) if sequences else ():
            bodies = [each.get("resource") for each in objects(canvas.get("images"))]
            yield _canvas(canvas, bodies)
        return
    for canvas in objects(manifest.get("items")):
        notes = [note for page in objects(canvas.get("items")) for note in _items(page)]
        painted = [
            note for note in notes if "painting" in _list(note.get("motivation", "painting"))
        ]
        yield _canvas(canvas, [body for note in painted for body in _list(note.get("body"))])


def listed_in(collection: Json) -> Iterator[Json]:
    """What a collection lists, whole or by its id, and the page that comes next, if there is."""
    yield from _items(collection)
    for name in ("manifests", "collections", "members"):
        yield from objects(collection.get(name))
    following = collection.get("next", collection.get("first"))
    if isinstance(following, str):
        yield {"id": following, "type": "Collection"}
    elif isinstance(following, dict):
        yield following


def id_of(document: Json) -> str:
    """Its URI; "": it has none."""
    found = document.get("id", document.get("@id"))
    return found if isinstance(found, str) else ""


def label_of(document: Json) -> str:
    """The first value of its label, in English where there is, on one line; "": it has none."""
    return " ".join(_text(document.get("label")).split())


def _text(label: object) -> str:
    if isinstance(label, str):
        return label
    if isinstance(label, list):
        return next(filter(None, map(_text, label)), "")
    if not isinstance(label, dict):
        return ""
    if "@value" in label:
        return _text(label["@value"])
    ordered = [label.get("en"), *label.values()]
    return next(filter(None, map(_text, ordered)), "")


def _canvas(canvas: Json, bodies: list[object]) -> Canvas:
    pictures = (picture for body in bodies if (picture := _picture(body)) is not None)
    return Canvas(id_of(canvas), label_of(canvas), next(pictures, None))


def _picture(body: object) -> Picture | None:
    """The image of a body: itself, the default of a choice, or what a part was taken of."""
    while isinstance(body, dict):
        kind = _type(body)
        if kind in {"Choice", "oa:Choice"}:
            body = body.get("default", next(iter(_items(body)), None))
        elif kind in {"SpecificResource", "oa:SpecificResource"}:
            source = body.get("source", body.get("full"))
            body = {"id": source, "type": "Image"} if isinstance(source, str) else source
        elif kind in {"Image", "dctypes:Image", "oa:Image"}:
            services = [each for each in objects(body.get("service")) if id_of(each)]
            size = (pixels(body.get("width")), pixels(body.get("height")))
            return Picture(id_of(body), next(filter(_is_image_service, services), None), *size)
        else:
            return None
    return None


def _is_image_service(service: Json) -> bool:
    """Not one of search or authentication."""
    said = f"{_type(service)} {service.get('@context', '')} {service.get('profile', '')}".lower()
    return "image" in said


def _type(document: Json) -> str:
    found = document.get("type", document.get("@type"))
    return found if isinstance(found, str) else ""


def pixels(value: object) -> int:
    """A length in pixels; 0: it is none."""
    return value if isinstance(value, int) and not isinstance(value, bool) and value > 0 else 0


def _items(document: Json) -> list[Json]:
    return objects(document.get("items", document.get("item")))


def objects(value: object) -> list[Json]:
    """The objects of a list, or the one that stands for a list of one."""
    return [each for each in _list(value) if isinstance(each, dict)]


def _list(value: object) -> list[Any]:
    if value is None:
        return []
    return value if isinstance(value, list) else [value]
