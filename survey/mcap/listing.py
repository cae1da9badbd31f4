"""The MCAP files of a survey: found within its root and nowhere else."""

import os
from pathlib import Path

from contracts.errors import BadSurvey
from contracts.records import Skipped
from survey.files import printable_uri
from survey.mcap.framing import MAGIC


def mcap_files(path: Path) -> tuple[dict[str, Path], list[Skipped]]:
    """Local name -> file: the file itself, or every `.mcap` file of a folder, in order of names.

    Hidden files and folders are not looked at, and symbolic links are not followed, so that
    nothing outside the survey is read.

    Raises
    ------
    BadSurvey : the folder cannot be listed.
    """
    if path.is_file():
        return ({printable_uri(path.name): path} if is_mcap(path) else {}), []
    found: dict[str, Path] = {}
    skipped: list[Skipped] = []

    def refuse(error: OSError) -> None:
        raise BadSurvey(f"survey {path}: {error.filename} cannot be listed: {error.strerror}")

    for folder, folders, names in os.walk(path, onerror=refuse):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(names):
            file = Path(folder, name)
            if name.startswith(".") or file.suffix.lower() != ".mcap":
                continue
            uri = printable_uri(file.relative_to(path).as_posix())
            reason = _problem(file, uri in found)
            if reason is None:
                found[uri] = file
            else:
                skipped.append(Skipped(uri, reason))
    return dict(sorted(found.items())), skipped


def is_mcap(path: Path) -> bool:
    """Whether a regular file begins as MCAP files do."""
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def _problem(file: Path, named_already: bool) -> str | None:
    if file.is_symlink():
        return "symbolic link; give the folder that holds the file itself"
    if not file.is_file():
        return "not a regular file"
    if not is_mcap(file):
        return "does not begin as an MCAP file does"
    if named_already:
        return "another file's name is the same once written in Unicode NFC; rename one of them"
    return None
