"""Ground truth: which images of the index show a query's place, in any of three formats."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from contracts.config import Where
from contracts.errors import BadTruth
from contracts.places import Place
from coordinator.truth.holidays import is_holidays, read_holidays
from coordinator.truth.names import Names
from coordinator.truth.oxford import read_oxford
from coordinator.truth.photos import Photos
from coordinator.truth.references import read_references
from coordinator.truth.written import Box, WrittenQuery, decoded_text
from index.opened import OpenedIndex
from index.selecting import candidates

__all__ = ["JudgedQuery", "read_truth", "truth_of_index"]


@dataclass(frozen=True, slots=True)
class JudgedQuery:
    """One query: its name in the truth, where its photo is read, and what is right.

    relevant : ids of the images that show its place. junk : ids that are neither right nor
    wrong, among them the query's own where the format names it; junk wins over relevant.
    box : x1 y1 x2 y2, pixels of the photo from its upper left corner, upright and in its
    original size; only what lies in it is searched for. None: the whole photo.
    """

    query: str
    path: Place
    relevant: tuple[int, ...]
    junk: tuple[int, ...] = ()
    box: Box | None = None


def read_truth(
    path: Path, root: Path | None, uris: Sequence[str], paths: Sequence[str] = ()
) -> list[JudgedQuery]:
    """Read a ground truth, recognised by its content, and find the images that it names.

    JSON : one object, query path -> list of references. Queries are relative to `root`, by
    default the folder of the file.
    Oxford/Paris : a folder of `*_query.txt`, `*_good.txt`, `*_ok.txt`, `*_junk.txt`.
    INRIA Holidays : a list of numbered images, or the package's `perfect_result.dat`.

    A reference names the one image whose uri equals it, or where either ends with the other at
    a `/`; Oxford/Paris lists leave out the suffix. The queries of Oxford/Paris and Holidays are
    searched for by the same rule, under `root` if it is given, then in the index.

    Parameters
    ----------
    uris : of the indexed images, in the order of ids. paths : where each of them is read.

    Raises
    ------
    BadTruth : none of the three formats, one that does not hold, a name that is no image of the
        index or several, or a query whose photo is not found.
    """
    if path.is_dir():
        return _judged(read_oxford(path), Names(uris, suffixes=False), root, paths)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise BadTruth(f"{path} cannot be read: {error.strerror}.") from error
    if is_holidays(content):
        written = read_holidays(path, decoded_text(path, content))
        return _judged(written, Names(uris), root, paths)
    names, folder = Names(uris), root or path.parent
    return [
        JudgedQuery(each.query, folder / each.photo, names.image_ids(each.query, each.relevant))
        for each in read_references(path, content)
    ]


def truth_of_index(index: OpenedIndex, path: Path, root: Path | None) -> list[JudgedQuery]:
    """`read_truth` of the images that an index has now; removed ones are as if never indexed."""
    live = candidates(index, Where()).ids.tolist()
    uris, paths = (index.catalogue.column(name) for name in ("uri", "path"))
    queries = read_truth(path, root, [uris[n] for n in live], [paths[n] for n in live])
    return [
        replace(
            query,
            relevant=tuple(live[n] for n in query.relevant),
            junk=tuple(live[n] for n in query.junk),
        )
        for query in queries
    ]


def _judged(
    written: Sequence[WrittenQuery], names: Names, root: Path | None, paths: Sequence[str]
) -> list[JudgedQuery]:
    photos = Photos(root, names, paths)
    return [
        JudgedQuery(
            query=each.query,
            path=photos.path(each.query, each.photo),
            relevant=names.image_ids(each.query, each.relevant),
            junk=tuple(sorted({*names.image_ids(each.query, each.junk), *names.own(each.photo)})),
            box=each.box,
        )
        for each in written
    ]
