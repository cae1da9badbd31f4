"""The survey formats, in the order in which they are tried. A new one is one more line.

A folder with image files of its own is a survey of those: an MCAP file in it, such as an export
for a viewer, is read only with `--format mcap` or by its own path.
"""

from dataclasses import replace
from pathlib import Path

from contracts.errors import BadConfig, BadSurvey
from contracts.places import Place
from survey import exif, kapture, mcap, plain, stereopolis, tables, utm_names
from survey.files import list_images
from survey.options import Reader, ReadOptions
from survey.poses import crs_name
from survey.stored import is_file, list_anew


def _recognises_mcap(path: Place) -> bool:
    """An MCAP file, or a folder with some and without image files."""
    return mcap.READER.recognises(path) and (is_file(path) or not list_images(path).paths)


_MCAP = replace(mcap.READER, recognises=_recognises_mcap)

READERS: tuple[Reader, ...] = (
    stereopolis.READER,
    _MCAP,
    kapture.READER,
    tables.READER,
    utm_names.READER,
    exif.READER,
    plain.READER,
)


def choose_reader(path: Place, options: ReadOptions) -> Reader:
    """The reader that `options.format` names, or the first that recognises the path.

    Raises
    ------
    BadConfig : no reader of that name. BadSurvey : nothing is there, or no reader knows it.
    UnknownCrs : `options.crs` is no coordinate system.
    """
    if options.crs is not None:
        crs_name(options.crs)
    list_anew(path)
    try:
        if isinstance(path, Path) and not path.exists():
            raise BadSurvey(f"survey {path} does not exist; check the path")
        return _chosen(path, options)
    except OSError as error:
        raise BadSurvey(f"survey {path} cannot be looked into: {error.strerror}") from error


def _chosen(path: Place, options: ReadOptions) -> Reader:
    names = ", ".join(reader.name for reader in READERS)
    if options.format is not None:
        for reader in READERS:
            if reader.name == options.format:
                return reader
        raise BadConfig(f"survey format {options.format!r} is unknown; expected one of {names}")
    if options.mapping is not None:
        return tables.READER
    if options.no_pose:
        return _MCAP if _MCAP.recognises(path) else plain.READER
    for reader in READERS:
        if reader.recognises(path):
            return reader
    raise BadSurvey(
        f"{path} is no survey: expected a folder of images, a pose table or an MCAP file "
        f"(formats: {names}); name the format with --format if it is one"
    )
