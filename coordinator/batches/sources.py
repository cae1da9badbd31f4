"""Where photos are listed: files, folders, lists, and manifests of IIIF, here or elsewhere."""

import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from contracts.errors import BadSurvey, WrongInput
from coordinator.batches import lists
from coordinator.batches.fetching import Fetcher, is_web_address
from coordinator.batches.manifests import photos_at, photos_of_file
from coordinator.batches.photos import Photo, photo_file, told_apart
from survey.files import list_images

STDIN = "-"
MANIFESTS = (".json", ".jsonld")
_READ_FROM = "photos are read from files and from addresses of http and https"


def read_sources(sources: Sequence[str], fetcher: Fetcher) -> list[Photo]:
    """All photos of some sources in their order, each name once.

    sources : a photo, a folder (with its subfolders), a list (`lists.SUFFIXES`; `-`: a path a line
    on stdin), a manifest or collection of IIIF, or the URL of one or of an image.

    Raises
    ------
    WrongInput : a source cannot be read, or lists no photo.
    """
    photos = (photo for each in sources for photo in _photos_of(each, fetcher))
    return told_apart(photos)


def lasting(sources: Iterable[str]) -> tuple[str, ...]:
    """The sources as they can be compared later, whatever folder the command is run in."""
    return tuple(
        each if is_web_address(each) or each == STDIN else str(Path(each).absolute())
        for each in sources
    )


def _photos_of(source: str, fetcher: Fetcher) -> Iterable[Photo]:
    if source == STDIN:
        return _listed(lists.paths_in(sys.stdin.read(), "stdin"), Path())
    if is_web_address(source):
        return photos_at(source, fetcher)
    if "://" in source:
        raise WrongInput(f"{source}: {_READ_FROM}.")
    path = Path(source)
    if path.is_dir():
        return _in_folder(path)
    ending = path.suffix.lower()
    if ending in lists.SUFFIXES:
        return _listed(lists.read_list(path), path.parent)
    if ending in MANIFESTS:
        return photos_of_file(path, fetcher)
    return (photo_file(source),)


def _in_folder(folder: Path) -> list[Photo]:
    """By the bytes of their names; what looks like a photo and cannot be read is an error."""
    try:
        listing = list_images(folder)
    except BadSurvey as error:
        raise WrongInput(f"The folder of photos cannot be used: {error}.") from error
    found = {uri: photo_file(str(path)) for uri, path in listing.paths.items()}
    for skipped in listing.skipped:
        found[skipped.uri] = Photo(str(folder / skipped.uri), error=skipped.reason)
    if not found:
        raise WrongInput(f"{folder} holds no photo; name a folder of images.")
    return [found[uri] for uri in sorted(found, key=os.fsencode)]


def _listed(names: Iterable[str], folder: Path) -> Iterator[Photo]:
    """Photos of a list, relative to its folder; an address is fetched."""
    for name in names:
        if is_web_address(name):
            yield Photo(name, urls=(name,))
        elif "://" in name:
            yield Photo(name, error=_READ_FROM)
        else:
            yield photo_file(str(folder / name))
