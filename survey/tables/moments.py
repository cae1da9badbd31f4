"""When each row's image was taken."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, tzinfo
from zoneinfo import ZoneInfo

from survey.tables.convention import Convention
from survey.tables.table import Table
from survey.times import zoned_time

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_UNIX_UNITS = {"unix_s": 1.0, "unix_ms": 1e-3, "unix_us": 1e-6, "unix_ns": 1e-9}


@dataclass(frozen=True, slots=True)
class Moments:
    """captured_at : (n,) ISO 8601 with a zone, or None; notes : what is missing, and why."""

    captured_at: list[str | None]
    notes: tuple[str, ...]


def read_moments(table: Table, column: int | None, convention: Convention) -> Moments:
    """Times of a column. One that cannot be read, or that has no zone, is not known: an image is
    as useful without it, but a note says so.
    """
    parse = _parser(convention)
    zone = None if convention.time_zone is None else ZoneInfo(convention.time_zone)
    found: list[str | None] = []
    naive, wrong = [], []
    for at, text in enumerate(table.texts(column)):
        moment = parse(text) if text else None
        if text and moment is None:
            wrong.append(at)
        elif moment is not None and moment.tzinfo is None:
            moment = _in_zone(moment, zone)
            if moment is None:
                naive.append(at)
        found.append(None if moment is None else zoned_time(moment.isoformat()))
    return Moments(found, tuple(_notes(table, column, wrong, naive)))


def _parser(convention: Convention) -> Callable[[str], datetime | None]:
    pattern = convention.time_format
    if pattern in _UNIX_UNITS:
        return lambda text: _unix(text, _UNIX_UNITS[pattern])
    if pattern == "iso":
        return _iso
    return lambda text: _by_pattern(text, pattern)


def _iso(text: str) -> datetime | None:
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        return None


def _by_pattern(text: str, pattern: str) -> datetime | None:
    try:
        return datetime.strptime(text, pattern)
    except ValueError:
        return _iso(text)


def _unix(text: str, unit_s: float) -> datetime | None:
    try:
        return _EPOCH + timedelta(seconds=float(text) * unit_s)
    except (OverflowError, ValueError):
        return _iso(text)


def _in_zone(moment: datetime, zone: tzinfo | None) -> datetime | None:
    return None if zone is None else moment.replace(tzinfo=zone)


def _notes(table: Table, column: int | None, wrong: list[int], naive: list[int]) -> list[str]:
    if column is None:
        return []
    cells = table.texts(column)
    notes = []
    if wrong:
        notes.append(
            f"{table.path.name}: {len(wrong)} of {len(table)} times cannot be read and are left "
            f"out; the first is {cells[wrong[0]]!r} ({table.cell(wrong[0], column)}); a mapping "
            "(--mapping) can say how they are written"
        )
    if naive:
        notes.append(
            f"{table.path.name}: {len(naive)} of {len(table)} times have no zone and are left "
            f"out; the first is {cells[naive[0]]!r} ({table.cell(naive[0], column)}); a mapping "
            "(--mapping) can name the zone"
        )
    return notes
