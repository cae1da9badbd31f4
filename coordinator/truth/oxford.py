"""The ground truth of the Oxford and Paris buildings (Philbin et al., CVPR 2007 and 2008).

A query is four files. `NAME_query.txt` is one line, an image and the box of the query in it;
`NAME_good.txt`, `NAME_ok.txt` and `NAME_junk.txt` name an image a line, and may be empty. Images
are named without suffix; Oxford's query files write `oxc1_` before the name.
"""

import math
from pathlib import Path

from contracts.errors import BadTruth
from coordinator.truth.written import FORMATS, Box, WrittenQuery, decoded_text, filled_lines

_LISTS = ("good", "ok", "junk")
_PREFIX = "oxc1_"


def read_oxford(folder: Path) -> list[WrittenQuery]:
    """Read every query of a folder, in the order of their names; other files are not looked at.

    Relevant is what is good or ok.

    Raises
    ------
    BadTruth : no query, a query without one of its lists, a list without its query, or a file
        that does not hold.
    """
    try:
        names = sorted(each.name for each in folder.iterdir() if not each.name.startswith("."))
    except OSError as error:
        raise BadTruth(f"{folder} cannot be listed: {error.strerror}.") from error
    queries = _stems(names, "query")
    if not queries:
        raise BadTruth(
            f"{folder} is not a ground truth (no file *_query.txt in it). Expected {FORMATS}."
        )
    for kind in _LISTS:
        _check_complete(folder, kind, queries, _stems(names, kind))
    return [_read_query(folder, query) for query in queries]


def _stems(names: list[str], kind: str) -> list[str]:
    ending = f"_{kind}.txt"
    return [name.removesuffix(ending) for name in names if name.endswith(ending)]


def _check_complete(folder: Path, kind: str, queries: list[str], lists: list[str]) -> None:
    for query in queries:
        if query not in lists:
            raise BadTruth(
                f"{folder / query}_query.txt has no {query}_{kind}.txt beside it. Restore it, or "
                "write an empty file if there is no such image."
            )
    for name in lists:
        if name not in queries:
            raise BadTruth(
                f"{folder / name}_{kind}.txt belongs to no query: there is no {name}_query.txt. "
                "Restore the query or remove the list."
            )


def _read_query(folder: Path, query: str) -> WrittenQuery:
    photo, box = _photo_and_box(folder / f"{query}_query.txt")
    good, ok, junk = (_images(folder / f"{query}_{kind}.txt") for kind in _LISTS)
    both = (set(good) | set(ok)) & set(junk)
    if both:
        raise BadTruth(
            f"{folder / query}_junk.txt names {min(both)}, which is good or ok too. "
            "Remove it from one of the lists."
        )
    return WrittenQuery(query, photo, relevant=good + ok, junk=junk, box=box)


def _photo_and_box(path: Path) -> tuple[str, Box]:
    lines = _lines(path)
    fields = lines[0].rsplit(maxsplit=4) if len(lines) == 1 else []
    try:
        name, x1, y1, x2, y2 = fields[0], *map(float, fields[1:])
    except (IndexError, ValueError) as error:
        found = repr(lines[0]) if len(lines) == 1 else f"{len(lines)} lines"
        raise BadTruth(
            f"{path} holds {found}; expected one line: an image without suffix, then the box "
            "x1 y1 x2 y2 in pixels, such as 'oxc1_all_souls_000013 136.5 34.1 648.5 955.7'."
        ) from error
    if not (all(map(math.isfinite, (x1, y1, x2, y2))) and x1 < x2 and y1 < y2):
        raise BadTruth(
            f"{path} gives the box {x1:g} {y1:g} {x2:g} {y2:g}, which is empty; "
            "expected x1 y1 x2 y2 with x1 < x2 and y1 < y2."
        )
    return name.removeprefix(_PREFIX), (x1, y1, x2, y2)


def _images(path: Path) -> tuple[str, ...]:
    return tuple(_lines(path))


def _lines(path: Path) -> list[str]:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BadTruth(f"{path} cannot be read: {error.strerror}.") from error
    return [line for _, line in filled_lines(decoded_text(path, content))]
