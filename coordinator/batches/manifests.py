"""Photos of IIIF manifests and collections, here or elsewhere."""

import hashlib
import json
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urljoin

from contracts.errors import WrongInput
from coordinator.batches.fetching import Fetcher, Unfetched, is_web_address
from coordinator.batches.iiif import Canvas, Json, canvases_of, id_of, kind_of, listed_in
from coordinator.batches.image_api import image_url, info_url
from coordinator.batches.photos import Photo
from coordinator.export.json_files import read_json

MAX_SIDE_PX = 2048
"""Photos are asked for at most so long: twice what an index looks at by default."""
MAX_DOCUMENTS = 20_000
"""Manifests and collections of one source: a collection that lists itself anew ends."""


def photos_of_file(path: Path, fetcher: Fetcher) -> Iterator[Photo]:
    """The photos of a manifest or a collection in a file.

    Raises
    ------
    WrongInput : it is neither, or shows nothing.
    """
    return _photos_of(read_json(path), str(path), fetcher)


def photos_at(url: str, fetcher: Fetcher) -> Iterator[Photo]:
    """The photos of a manifest or a collection at an address; what is no JSON is a photo itself.

    Raises
    ------
    WrongInput : it cannot be fetched, or is JSON and neither of them.
    """
    try:
        content = fetcher.document(url)
    except Unfetched as error:
        raise WrongInput(f"{error}. Correct the address, or try again later.") from error
    try:
        document = json.loads(content)
    except (ValueError, RecursionError):
        return iter((Photo(url, urls=(url,)),))
    return _photos_of(document, url, fetcher)


def fetched_photo(photo: Photo, fetcher: Fetcher, folder: Path) -> Path:
    """The file of a photo from elsewhere: fetched once, and kept in `folder`.

    Raises
    ------
    Unfetched : it cannot be had.
    """
    kept = kept_file(photo, folder)
    if not kept.exists():
        folder.mkdir(parents=True, exist_ok=True)
        fetcher.image(_addresses(photo, fetcher), kept)
    return kept


def kept_file(photo: Photo, folder: Path) -> Path:
    """Where a photo from elsewhere is kept, by its addresses."""
    name = hashlib.sha256(json.dumps([photo.info, photo.urls]).encode()).hexdigest()[:32]
    return folder / name


def _addresses(photo: Photo, fetcher: Fetcher) -> Iterator[str]:
    """Where a photo is, the best address first; the server is asked for that."""
    if photo.info:
        try:
            service = json.loads(fetcher.document(photo.info))
        except (Unfetched, ValueError, RecursionError):
            service = None
        if isinstance(service, dict):
            told = {"@id": photo.info.removesuffix("/info.json"), **service}
            url = image_url(told, 0, 0, MAX_SIDE_PX)
            if url is not None and is_web_address(url):
                yield url
    yield from photo.urls


def _photos_of(document: object, name: str, fetcher: Fetcher) -> Iterator[Photo]:
    if not isinstance(document, dict) or kind_of(document) is None:
        raise WrongInput(
            f"{name} is no manifest or collection of IIIF Presentation 2 or 3; expected a JSON "
            'object whose "type" or "@type" says so.'
        )
    n_photos = 0
    for each in _manifests(document, name, fetcher):
        for photo in (each,) if isinstance(each, Photo) else _photos_on(each, name):
            n_photos += 1
            yield photo
    if not n_photos:
        raise WrongInput(f"{name} shows no canvas.")


def _manifests(document: Json, name: str, fetcher: Fetcher) -> Iterator[Json | Photo]:
    """The manifests of a collection in its order; one that cannot be had as a photo's error."""
    waiting, seen = deque([document]), {id_of(document)}
    while waiting:
        found = waiting.popleft()
        if kind_of(found) == "manifest" and ("items" in found or "sequences" in found):
            yield found
            continue
        if not _is_whole(found) and found is not document:
            try:
                found = _fetched(_joined(name, id_of(found)), fetcher)
            except WrongInput as error:
                yield Photo(id_of(found) or name, error=str(error))
                continue
            waiting.appendleft(found)
            continue
        listed = [each for each in listed_in(found) if kind_of(each) is not None]
        fresh = [each for each in listed if not id_of(each) or id_of(each) not in seen]
        seen.update(map(id_of, fresh))
        if len(seen) > MAX_DOCUMENTS:
            raise WrongInput(f"{name} lists more than {MAX_DOCUMENTS:,} manifests; give parts.")
        waiting.extendleft(reversed(fresh))


def _fetched(url: str, fetcher: Fetcher) -> Json:
    if not is_web_address(url):
        raise WrongInput(f"{url} is no address of http or https")
    try:
        document = json.loads(fetcher.document(url))
    except Unfetched as error:
        raise WrongInput(str(error)) from error
    except (ValueError, RecursionError) as error:
        raise WrongInput(f"{url} is no JSON") from error
    if kind_of(document) is None or not _is_whole(document):
        raise WrongInput(f"{url} is no manifest or collection of IIIF")
    found: Json = document
    return found


_PARTS = ("items", "sequences", "manifests", "collections", "members", "first")


def _is_whole(document: Json) -> bool:
    """Not only named, by its id."""
    return any(part in document for part in _PARTS)


def _photos_on(manifest: Json, name: str) -> Iterator[Photo]:
    where = id_of(manifest) or name
    for number, canvas in enumerate(canvases_of(manifest)):
        full_name = canvas.id or f"{where}#{number}"
        yield _photo(canvas, full_name, where)


def _photo(canvas: Canvas, full_name: str, where: str) -> Photo:
    query = canvas.label or full_name
    picture = canvas.picture
    if picture is None:
        return Photo(query, error="no image is painted on its canvas", full_name=full_name)
    url = info = None
    if picture.service is not None:
        url = image_url(picture.service, picture.width_px, picture.height_px, MAX_SIDE_PX)
        info = None if url else info_url(picture.service)
    base = where if is_web_address(where) else ""
    addresses = [_joined(base, each) for each in (url, picture.url) if each]
    urls = tuple(dict.fromkeys(filter(is_web_address, addresses)))
    info = info if info and is_web_address(info) else ""
    if not (urls or info):
        return Photo(query, error="its image has no address of http or https", full_name=full_name)
    return Photo(query, urls=urls, info=info, full_name=full_name)


def _joined(base: str, reference: str) -> str:
    """A reference as an address; one that cannot be joined as it is, for whoever fetches it."""
    try:
        return urljoin(base, reference)
    except ValueError:
        return reference
