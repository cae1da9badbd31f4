"""The photos of a batch: what each is called, and where its bytes come from."""

import json
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from contracts.errors import BadIndex
from index.files import open_regular, write_atomic


@dataclass(frozen=True, slots=True)
class Photo:
    """One photo to locate.

    query : what it is called in the results. path : the file, absolute; "": it is to be fetched.
    urls : from where, the best first. info : the address that tells a better one (Image API).
    error : why it cannot be had, as far as its list tells.
    full_name : what it is called where several of one batch share a query.
    """

    query: str
    path: str = ""
    urls: tuple[str, ...] = ()
    info: str = ""
    error: str = ""
    full_name: str = ""

    @property
    def is_elsewhere(self) -> bool:
        """Whether it is to be fetched."""
        return bool(self.urls or self.info)


def photo_file(name: str) -> Photo:
    """A photo by the name of its file, as it was given."""
    return Photo(name, str(Path(name).absolute()))


def told_apart(photos: Iterable[Photo]) -> list[Photo]:
    """The photos in their order, each once, no two of one query: results go by it.

    Canvases of several books are all called `1r`: those are called by their full names, and by a
    number where even these are the same. The same photo twice, as where globs overlap, is one.
    """
    listed = list(photos)
    named: dict[str, set[str]] = defaultdict(set)
    for photo in listed:
        named[photo.query].add(photo.full_name)
    distinct = (
        replace(photo, query=photo.full_name or photo.query)
        if len(named[photo.query]) > 1
        else photo
        for photo in listed
    )
    once = {(photo.query, photo.path, photo.urls, photo.info): photo for photo in distinct}
    called = Counter[str]()
    for same, photo in once.items():
        called[photo.query] += 1
        if (number := called[photo.query]) > 1:
            once[same] = replace(photo, query=f"{photo.query} ({number})")
    return list(once.values())


def write_photos(path: Path, photos: Iterable[Photo]) -> None:
    """Write the list of a batch, a JSON object a line."""
    write_atomic(path, lambda file: file.writelines(map(_line, photos)))


def read_photos(path: Path) -> Iterator[Photo]:
    """The photos of a list that `write_photos` wrote, one at a time.

    Raises
    ------
    BadIndex : it cannot be read, or is damaged.
    """
    try:
        with open_regular(path) as lines:
            for line in lines:
                content = json.loads(line)
                yield Photo(**{**content, "urls": tuple(content["urls"])})
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise BadIndex(
            f"{path} is not the list that was written ({error}). Delete the "
            "batch's folder and submit it again."
        ) from error


def _line(photo: Photo) -> bytes:
    return json.dumps(asdict(photo)).encode() + b"\n"
