"""The MCAP files of a survey: found within its root and nowhere else."""

import os
from collections.abc import Iterator
from pathlib import Path

from contracts.errors import BadSurvey
from contracts.places import Place
from contracts.records import Skipped
from survey.files import printable_uri, visible_objects
from survey.mcap.framing import MAGIC
from survey.stored import is_file, open_place


def mcap_files(path: Place) -> tuple[dict[str, Place], list[Skipped]]:
    """Local name -> file: the file itself, or every `.mcap` file of a folder, in order of names.

    Hidden files and folders are not looked at, and symbolic links are not followed, so that
    nothing outside the survey is read.

    Raises
    ------
    BadSurvey : the folder cannot be listed.
    """
    if is_file(path):
        return ({printable_uri(path.name): path} if is_mcap(path) else {}), []
    found: dict[str, Place] = {}
    skipped: list[Skipped] = []
    for name, file in _named_so(path):
        uri = printable_uri(name)
        reason = _problem(file, uri in found)
        if reason is None:
            found[uri] = file
        else:
            skipped.append(Skipped(uri, reason))
    return dict(sorted(found.items())), skipped


def _named_so(path: Place) -> Iterator[tuple[str, Place]]:
    """Files in a folder or store whose names end in .mcap, by name relative to it."""
    if isinstance(path, Path):
        yield from _in_folder(path)
        return
    for name in visible_objects(path):
        if name.lower().endswith(".mcap"):
            yield name, path / name


def _in_folder(path: Path) -> Iterator[tuple[str, Path]]:
    def refuse(error: OSError) -> None:
        raise BadSurvey(f"survey {path}: {error.filename} cannot be listed: {error.strerror}")

    for folder, folders, names in os.walk(path, onerror=refuse):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(names):
            file = Path(folder, name)
            if name.startswith(".") or file.suffix.lower() != ".mcap":
                continue
            yield file.relative_to(path).as_posix(), file


def is_mcap(path: Place) -> bool:
    """Whether a regular file begins as MCAP files do."""
    try:
        with open_place(path) as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def _problem(file: Place, named_already: bool) -> str | None:
    if file.is_symlink():
        return "symbolic link; give the folder that holds the file itself"
    if not file.is_file():
        return "not a regular file"
    if not is_mcap(file):
        return "does not begin as an MCAP file does"
    if named_already:
        return "another file's name is the same once written in Unicode NFC; rename one of them"
    return None
