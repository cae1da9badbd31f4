"""A table as text: its encoding, its separator, its rows, read a line at a time."""

import codecs
import csv
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from contracts.errors import BadSurvey
from contracts.places import Place
from survey.stored import open_place
from survey.tables.profile import Profile
from survey.tables.profiles import recognised, recognised_cells
from survey.tables.table import Faults, Table

WHITESPACE = " "
_SEPARATORS = (",", ";", "\t", "|", WHITESPACE)
_SEPARATOR_NAMES = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", " ": "blanks"}
_STATED = re.compile(r'"?sep=(.)"?', re.IGNORECASE)
_HEADER_BYTES = 65_536
_MAX_LINE = 1_000_000
"""Characters of a line; a longer one is no row of a table."""
_BINARY = {
    b"PK\x03\x04": "a ZIP archive or a spreadsheet; export it as CSV",
    b"\x1f\x8b": "compressed with gzip; decompress it",
    b"%PDF": "a PDF document",
    b"\xff\xd8\xff": "a JPEG image",
    b"\x89PNG": "a PNG image",
}


@dataclass(frozen=True, slots=True)
class Layout:
    """How a text table is written; None: found out from its first line.

    separator : one character, " " = any run of blanks. header : whether the first line names the
    columns. skip_lines : lines before the header or the first row. encoding : of Python's codecs.
    decimal_comma : whether `1,5` is one and a half; if not said, unless the comma separates.
    """

    separator: str | None = None
    header: bool | None = None
    skip_lines: int = 0
    encoding: str | None = None
    decimal_comma: bool | None = None


def read_text(path: Place, layout: Layout, profile: Profile | None) -> Table:
    """All rows of a separated-values file.

    UTF-8 with or without a byte order mark, UTF-16 or UTF-32 with one, else Latin-1, unless the
    layout says; separated by what a line `sep=;` before all others says, as Excel has it, else by
    comma, semicolon, tab, bar or blanks, whichever makes a first line that a profile knows.

    Raises
    ------
    BadSurvey : unreadable, not a table of text, or a line that cannot be taken apart.
    """
    lines = _Lines(path, layout.encoding or _encoding(path))
    first = _first_line(lines, layout.skip_lines)
    if stated := _stated_separator(first):
        first = _first_line(lines, lines.number)
    separator = layout.separator or stated or _separator(first, _knower(profile, layout))
    cells = _cells(first, separator)
    header = layout.header
    if header is None:
        header = recognised(cells) is not None or recognised_cells(cells) is None
    names = tuple(cell.strip() for cell in cells) if header else ()
    body = list(_rows(lines, separator, lines.number, skip_first=header))
    rows = [row for _, row in body]
    width = len(cells)
    if header:
        _refuse_other_separator(path, body, separator, width)
    comma = separator != "," if layout.decimal_comma is None else layout.decimal_comma
    table = Table(
        path, names, _columns(rows, width), [number for number, _ in body], decimal_comma=comma
    )
    return replace(table, faults=_ragged(table, rows, width, lines.complete))


def _first_line(lines: "_Lines", skip_lines: int) -> str:
    for line in lines.read():
        if lines.number > skip_lines and line.strip():
            return line
    raise BadSurvey(f"pose table {lines.path} is empty; expected a header and rows")


def looks_like_poses(path: Place) -> bool:
    """Whether a file begins like a pose table that a profile knows; reads its beginning only."""
    try:
        with open_place(path) as file:
            start = file.read(_HEADER_BYTES)
    except OSError:
        return False
    text = start.decode(_bom(start) or "latin-1", "replace").lstrip("\ufeff \r\n\t")
    lines = [line for line in text.splitlines() if line.strip()]
    stated = _stated_separator(lines[0]) if lines else None
    first = lines[0 if stated is None else 1 :][:1]
    separators = _SEPARATORS if stated is None else (stated,)
    return any(_known(_cells(line, separator)) for line in first for separator in separators)


def _known(cells: Sequence[str]) -> bool:
    return recognised(cells) is not None or recognised_cells(cells) is not None


def _knower(profile: Profile | None, layout: Layout) -> Callable[[Sequence[str]], bool]:
    """Whether a first line, taken apart, is of a known kind; by the mapping's if there is one."""
    if profile is None:
        return _known
    numbered = [at for at in profile.columns.values() if isinstance(at, int)]
    if layout.header is False or len(numbered) == len(profile.columns):
        return lambda cells: len(cells) >= max(numbered, default=1)
    return profile.fits


@dataclass(slots=True)
class _Lines:
    """The lines of a file, counted from 1, none too long, none with a NUL."""

    path: Place
    encoding: str
    number: int = 0
    complete: bool = True
    """Whether the last line that was read had an end."""

    def read(self) -> Iterator[str]:
        self.number = 0
        try:
            with self.path.open(encoding=self.encoding, newline="") as file:
                while line := file.readline(_MAX_LINE):
                    self.number += 1
                    self.complete = line.endswith(("\n", "\r"))
                    yield self._checked(line)
        except OSError as error:
            raise BadSurvey(f"pose table {self.path} cannot be read: {error.strerror}") from error
        except UnicodeError as error:
            raise BadSurvey(
                f"pose table {self.path}, line {self.number + 1}: is not {self.encoding}; save it "
                "as UTF-8"
            ) from error

    def _checked(self, line: str) -> str:
        where = f"pose table {self.path}, line {self.number}"
        if "\0" in line:
            raise BadSurvey(
                f"{where}: a NUL character; is not text, or text in UTF-16 without a byte order "
                "mark: save it as UTF-8"
            )
        if len(line) >= _MAX_LINE:
            raise BadSurvey(f"{where}: longer than {_MAX_LINE} characters; not a row of a table")
        return line


def _rows(
    lines: _Lines, separator: str, start: int, skip_first: bool
) -> Iterator[tuple[int, list[str]]]:
    """(line number, cells) of every row from line `start` on that is not empty."""
    blanks = separator == WHITESPACE
    body = (
        line.replace("\t", " ") if blanks else line
        for line in lines.read()
        if lines.number >= start
    )
    reader = csv.reader(body, delimiter=separator, skipinitialspace=blanks, strict=True)
    try:
        for at, row in enumerate(reader):
            if (at or not skip_first) and any(cell.strip() for cell in row):
                yield start + reader.line_num - 1, row
    except csv.Error as error:
        raise BadSurvey(
            f"pose table {lines.path}, line {start + reader.line_num - 1}: {error}; a quote may "
            "be missing there or in a line before"
        ) from error


def _cells(line: str, separator: str) -> list[str]:
    if separator == WHITESPACE:
        return line.split()
    try:
        return next(csv.reader([line], delimiter=separator, strict=True), [])
    except csv.Error:
        return line.split(separator)


def _columns(rows: list[list[str]], width: int) -> tuple[tuple[str, ...], ...]:
    """The cells by column; what a short row lacks is empty, what a long one has more is left."""
    even = [row if len(row) == width else (row + [""] * (width - len(row)))[:width] for row in rows]
    return tuple(zip(*even, strict=True)) if even else ((),) * width


def _ragged(table: Table, rows: list[list[str]], width: int, complete: bool) -> Faults:
    """Rows with more cells than the first line, and a last row that was cut off.

    Spreadsheets leave out empty cells at the end of a row, so a short row in itself is none.
    """
    faults = {
        at: f"{table.row(at)}: has {len(row)} cells, expected {width}; a cell with the separator "
        "in it needs quotes"
        for at, row in enumerate(rows)
        if len(row) > width and any(cell.strip() for cell in row[width:])
    }
    if rows and len(rows[-1]) < width and not complete:
        last = len(rows) - 1
        faults[last] = (
            f"{table.row(last)}: has {len(rows[last])} cells, expected {width}, and the file ends "
            "there without the end of a line; it may have been cut off"
        )
    return faults


def _separator(line: str, known: Callable[[Sequence[str]], bool]) -> str:
    for separator in _SEPARATORS:
        if known(_cells(line, separator)):
            return separator
    return max(_SEPARATORS[:-1], key=line.count)


def _stated_separator(line: str) -> str | None:
    found = _STATED.fullmatch(line.rstrip("\r\n"))
    return None if found is None else found[1]


def _refuse_other_separator(
    path: Place, body: list[tuple[int, list[str]]], separator: str, width: int
) -> None:
    """Refuse rows that all have as many cells as the header, but by another separator."""
    for other in _SEPARATORS:
        if not body or not all(_is_by_other(row, separator, other, width) for _, row in body):
            continue
        rows, header = _SEPARATOR_NAMES[other], _SEPARATOR_NAMES.get(separator, repr(separator))
        raise BadSurvey(
            f"pose table {path}, line {body[0][0]}: the rows are separated by {rows}, the header "
            f"by {header}; write both with the same separator"
        )


def _is_by_other(row: list[str], separator: str, other: str, width: int) -> bool:
    """Decimal commas may make as many cells: `a.jpg;1,5;2,5` has three either way."""
    apart = len(row) != width or (
        separator == "," and other != WHITESPACE and sum(other in cell for cell in row) > 1
    )
    return other != separator and apart and len(_cells(separator.join(row), other)) == width


def _encoding(path: Place) -> str:
    """UTF-8 if all of the file is, what its byte order mark says, else Latin-1."""
    decoder = codecs.getincrementaldecoder("utf-8")()
    try:
        with open_place(path) as file:
            start = file.read(_HEADER_BYTES)
            for magic, what in _BINARY.items():
                if start.startswith(magic):
                    raise BadSurvey(f"pose table {path} is {what}")
            if (named := _bom(start)) is not None:
                return named
            decoder.decode(start)
            while block := file.read(1 << 20):
                decoder.decode(block)
            decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        return "latin-1"
    except OSError as error:
        raise BadSurvey(f"pose table {path} cannot be read: {error.strerror}") from error
    return "utf-8"


def _bom(start: bytes) -> str | None:
    if start.startswith(codecs.BOM_UTF8):
        return "utf-8-sig"
    if start.startswith((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)):
        return "utf-32"
    if start.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    return None
