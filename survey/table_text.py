"""A table as text: its encoding, its separator, its rows."""

import csv
import io
from dataclasses import dataclass
from pathlib import Path

from contracts.errors import BadSurvey
from survey.table_columns import has_pose_columns

_SEPARATORS = (",", ";", "\t", "|")
_HEADER_BYTES = 65_536


@dataclass(frozen=True, slots=True)
class TextTable:
    """Header and rows; a row carries the number of its line in the file, the header's is 1."""

    header: list[str]
    rows: list[tuple[int, list[str]]]
    separator: str


def read_table(path: Path) -> TextTable:
    """All rows of a separated-values file with a header.

    UTF-8 with or without a byte order mark, UTF-16 with one, else Latin-1; separated by comma,
    semicolon, tab or bar, whichever makes a header with a file and a position.

    Raises
    ------
    BadSurvey : unreadable or not a table of text.
    """
    try:
        text = _decoded(path.read_bytes())
    except OSError as error:
        raise BadSurvey(f"pose table {path} cannot be read: {error.strerror}") from error
    if "\0" in text or not text.strip():
        what = "is empty" if not text.strip("\0 \r\n\t") else "is not text"
        raise BadSurvey(f"pose table {path} {what}; expected comma-separated values")
    separator = _separator(text)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
    try:
        rows = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise BadSurvey(f"pose table {path}, line {reader.line_num}: {error}") from error
    return TextTable([cell.strip() for cell in rows[0][1]], rows[1:], separator)


def looks_like_poses(path: Path) -> bool:
    """Whether a file begins with the header of a pose table; reads its beginning only."""
    try:
        with path.open("rb") as file:
            start = _decoded(file.read(_HEADER_BYTES))
    except OSError:
        return False
    lines = start.lstrip().splitlines()
    return bool(lines) and has_pose_columns(_cells(lines[0], _separator(start)))


def _decoded(data: bytes) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _separator(text: str) -> str:
    header = text.lstrip().splitlines()[0] if text.strip() else ""
    for separator in _SEPARATORS:
        if has_pose_columns(_cells(header, separator)):
            return separator
    return max(_SEPARATORS, key=header.count)


def _cells(line: str, separator: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return []
