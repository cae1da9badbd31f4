"""Read a survey as far as it can be read: what `read_survey` would refuse is examined as well."""

from dataclasses import dataclass, replace

from contracts.errors import UnknownCrs, WrongInput
from contracts.places import Place
from contracts.records import PosedImage, Skipped
from geo.crs import ToWgs84
from survey.doctor.findings import Finding
from survey.options import Reader, Reading, ReadOptions
from survey.readers import choose_reader
from survey.reading import read_wanted, why_empty

_BARE_NUMBERS = "EPSG:3857"
"""Any projected system will do to read numbers whose own system is not known."""


@dataclass(frozen=True, slots=True)
class Opened:
    """What a reader found.

    images, skipped : in order of their uris' bytes. crs : of every pose; None: poses have none,
    `bare`, or the system is known and has no conversion to WGS 84. bare : coordinates are numbers
    whose system is not known or cannot be right.
    findings : why it would be refused, and what the reader itself has to say.
    """

    path: Place
    format: str
    images: tuple[PosedImage, ...]
    skipped: tuple[Skipped, ...]
    crs: str | None
    bare: bool
    findings: tuple[Finding, ...]


def open_survey(path: Place, options: ReadOptions) -> Opened:
    """Read the survey; a refusal by its reader is a finding.

    Raises
    ------
    BadSurvey : nothing is there, or no reader knows it. BadConfig : no reader of that name.
    UnknownCrs : `options.crs` is no coordinate system.
    """
    reader = choose_reader(path, options)
    try:
        reading = read_wanted(reader, path, options)
    except WrongInput as error:
        refusal = Finding("refused", "error", str(error), mend=_mend(error))
        return _opened(path, reader, _bare(reader, path, options), (refusal,), bare=True)
    notes = tuple(Finding("reader", "note", note) for note in reading.notes)
    if not reading.images:
        refusal = Finding("refused", "error", why_empty(path, reading.skipped, options))
        bare = _bare(reader, path, options)
        # If there are images now, only the coordinate system stood in the way.
        found = bare if bare.images else reading
        return _opened(path, reader, found, (*notes, refusal), bare=True)
    refused = _refused_crs(reading, options)
    if refused:
        reading = replace(reading, crs=None)
    return _opened(path, reader, reading, notes + refused, bare=False)


def _opened(
    path: Place, reader: Reader, reading: Reading, findings: tuple[Finding, ...], bare: bool
) -> Opened:
    return Opened(
        path=path,
        format=reader.name,
        images=tuple(sorted(reading.images, key=lambda image: image.uri.encode())),
        skipped=tuple(sorted(reading.skipped, key=lambda skip: (skip.uri.encode(), skip.reason))),
        crs=None if bare else reading.crs,
        bare=bare,
        findings=findings,
    )


def _bare(reader: Reader, path: Place, options: ReadOptions) -> Reading:
    """The survey with its coordinates as mere numbers, or empty where that fails as well."""
    try:
        return read_wanted(reader, path, replace(options, crs=_BARE_NUMBERS))
    except WrongInput:
        return Reading((), (), None)


def _refused_crs(reading: Reading, options: ReadOptions) -> tuple[Finding, ...]:
    if reading.crs is None:
        return ()
    try:
        ToWgs84(reading.crs, allow_ballpark=options.allow_ballpark)
    except UnknownCrs as error:
        return (Finding("refused", "error", str(error), mend=_mend(error)),)
    return ()


def _mend(error: WrongInput) -> str:
    return "--crs, such as --crs EPSG:2154" if isinstance(error, UnknownCrs) else ""
