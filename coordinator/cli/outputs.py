"""How results are written, and where: looked at before the work, so that none is lost."""

from collections.abc import Iterable
from pathlib import Path

from contracts.errors import WrongInput
from contracts.places import Place


def utf_8(text: str) -> bytes:
    """UTF-8 in every locale; a byte of a name that is not UTF-8 as its (JSON) escape."""
    return text.encode("utf-8", "backslashreplace")


def result_file(out: Path, inputs: Iterable[Place] = ()) -> Path:
    """Where `out` is written: the file itself, for a symbolic link what it leads to.

    Raises
    ------
    WrongInput : it is a folder or a device, lies under a file, or is one of `inputs`.
    """
    file = out.resolve()
    if out.exists() and not file.is_file():
        raise WrongInput(
            f"--out {out} is {'a folder' if file.is_dir() else 'no regular file'}; name a file."
        )
    for each in inputs:
        if isinstance(each, Path) and each.resolve() == file:
            raise WrongInput(f"--out {out} is one of the inputs; it would be lost. Name another.")
    _refuse_under_a_file(out, file)
    return file


def result_folder(out: Path) -> Path:
    """Where a report of several files goes.

    Raises
    ------
    WrongInput : it is a file, or lies under one.
    """
    folder = out.resolve()
    if folder.exists() and not folder.is_dir():
        raise WrongInput(f"--out {out} is a file; name a folder for the report.")
    _refuse_under_a_file(out, folder)
    return folder


def refuse_inside(survey: Place, out: Path, option: str) -> None:
    """A picture in a survey's folder would be an image of the survey the next time.

    Raises
    ------
    WrongInput : `out` lies in the folder of `survey`, which may be a pose table in it.
    """
    if not isinstance(survey, Path):
        return
    recording = survey.suffix.lower() == ".mcap"
    folder = survey.parent if survey.is_file() and not recording else survey
    if out.resolve().is_relative_to(folder.resolve()):
        raise WrongInput(
            f"{option} {out} lies in the survey's own folder {folder}, where its picture would be "
            "taken for an image of the survey; name a place outside it."
        )


def _refuse_under_a_file(out: Path, path: Path) -> None:
    above = next(parent for parent in path.parents if parent.exists())
    if not above.is_dir():
        raise WrongInput(f"--out {out}: {above} is a file, not a folder; name another place.")
