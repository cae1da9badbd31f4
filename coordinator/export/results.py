"""Results of a search in the formats asked for, by the endings of their files' names."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

from contracts.errors import WrongInput
from coordinator.export.answers import KeptAnswers
from coordinator.export.files import write_pieces
from coordinator.export.geojson import sequence, write_geojson
from coordinator.querying import Located
from geo.geojson import Feature
from index.opened import OpenedIndex

GEOJSON = (".geojson", ".json")
SEQUENCE = (".geojsons",)
GEOPACKAGE = (".gpkg",)
VECTORS = (".fgb", ".parquet", ".kml")
FORMATS = (*GEOJSON, *SEQUENCE, *GEOPACKAGE, *VECTORS)


def refuse_unknown(outs: Sequence[Path]) -> None:
    """Look at what is to be written before there is anything to lose.

    Raises
    ------
    WrongInput : a name ends in none of `FORMATS`, or is there twice.
    """
    for at, out in enumerate(outs):
        if out.name == "-":
            raise WrongInput("--out - is no file; without --out GeoJSON is written on stdout.")
        if out.suffix.lower() not in FORMATS:
            raise WrongInput(
                f"--out {out}: {_ending(out)} is no format that is "
                f"written; end it with one of {', '.join(FORMATS)}."
            )
        if out in outs[:at]:
            raise WrongInput(f"--out names {out} twice; once is enough.")


def refuse_unwritable(outs: Iterable[Path]) -> None:
    """Try whether each can be written, before the work.

    Raises
    ------
    WrongInput : a file cannot be made in the folder of one.
    """
    for folder in dict.fromkeys(out.parent for out in outs):
        _scratch(folder).close()


def write_results(
    outs: Sequence[Path],
    answers: Iterable[Located],
    index: OpenedIndex | None,
    about: Mapping[str, object],
    tell: Callable[[str], None],
) -> None:
    """Write every answer into each of `outs`, which `refuse_unknown` has passed.

    The first, a GeoJSON if there is one, is written as the answers come, the others after it. A
    file has its name only when it is whole. If it ends early, by Ctrl-C or a failure, it is told
    which are; if no GeoJSON is, the answers there are go into `NAME.partial.geojson` beside the
    first.

    Parameters
    ----------
    outs : files, their endings of `FORMATS`. about : of the GeoJSON (`provenance`).
    index : that answered; None: it is gone, which leaves GeoJSON and its sequences.
    tell : called with a sentence that says what is whole, or where answers were kept.

    Raises
    ------
    WrongInput : a file cannot be written.
    """
    ordered = sorted(outs, key=lambda out: not _is_geojson(out))
    whole: list[Path] = []
    with _scratch(ordered[0].parent) as scratch:
        kept = KeptAnswers(scratch)
        try:
            for out in ordered:
                _write(out, kept if whole else kept.keep(answers), index, about)
                whole.append(out)
        except BaseException:
            if whole:
                tell(f"Written whole before it ended: {', '.join(map(str, whole))}")
            if len(kept) and not any(map(_is_geojson, whole)):
                tell(_keep_partial(ordered[0], kept, about))
            raise


def features_of(answers: Iterable[Located]) -> Iterable[Feature]:
    """The features of all answers, in their order."""
    return chain.from_iterable(answer.features for answer in answers)


def _is_geojson(out: Path) -> bool:
    return out.suffix.lower() in GEOJSON


def _ending(out: Path) -> str:
    return repr(out.suffix) if out.suffix else "a name without an ending"


def _scratch(folder: Path) -> IO[bytes]:
    """A file without a name, on the disk where the results go; gone when it is closed."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return TemporaryFile(dir=folder)
    except OSError as error:
        raise WrongInput(
            f"cannot write into {folder}: {error.strerror}; name a place where there is room and "
            "leave to write (--out)"
        ) from error


def _keep_partial(out: Path, kept: KeptAnswers, about: Mapping[str, object]) -> str:
    partial = out.with_name(f"{out.stem}.partial.geojson")
    try:
        write_geojson(partial, features_of(kept), {**about, "partial": True})
    except WrongInput as error:  # a full disk, say, which is why it ended early
        return f"The answers to {len(kept)} photos until then are lost: {error}"
    return f"The answers to {len(kept)} photos until then are kept: {partial}"


def _write(
    out: Path,
    answers: Iterable[Located],
    index: OpenedIndex | None,
    about: Mapping[str, object],
) -> None:
    if _is_geojson(out):
        write_geojson(out, features_of(answers), about)
    elif out.suffix.lower() in SEQUENCE:
        write_pieces(out, sequence(features_of(answers)))
    elif index is None:
        raise WrongInput(
            f"{out} tells more of the matched images than the answers do, and their generation of "
            f"the index is gone. End it with one of {', '.join((*GEOJSON, *SEQUENCE))}."
        )
    elif out.suffix.lower() in GEOPACKAGE:
        from coordinator.export.geopackage import write_geopackage

        write_geopackage(out, answers, index)
    else:
        from coordinator.export.vectors import write_vectors

        write_vectors(out, answers, index)
