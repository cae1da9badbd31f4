"""Tables of results, as Markdown to read and CSV to compute with."""

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from contracts.errors import WrongInput
from coordinator.export.files import write_whole
from retrieval.resampling import Interval

Cell = str | int | float | Interval | None
"""None, or a number that is not finite: there is none."""

_NOTHING = "–"
_NAME = re.compile(r"[a-z0-9-]+")
# An underscore within a word marks nothing up, and names are full of them.
_MARKUP = re.compile(r"[\\`*<\[\]|&~]|(?<![^\W_])_|_(?![^\W_])")
_FORMULA_STARTS = ("=", "+", "-", "@")


@dataclass(frozen=True, slots=True)
class Table:
    """One table.

    name : stem of its file, of a-z, 0-9 and `-`. note : Markdown, shown below it.

    Raises
    ------
    WrongInput : the name is no such stem, or a row has more or fewer cells than there are columns.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise WrongInput(f"table {self.name!r} cannot name a file; use a-z, 0-9 and - only")
        for number, row in enumerate(self.rows, 1):
            if len(row) != len(self.columns):
                raise WrongInput(
                    f"row {number} of table {self.name} has {len(row)} cells for "
                    f"{len(self.columns)} columns; give one each, None where there is nothing"
                )


def markdown(table: Table) -> str:
    """Write the rows as a GitHub table, numbers to 3 decimals and at the right; no title, no note.

    An interval is `0.612 [0.570, 0.655]`.
    """
    lines = [[_escaped(name) for name in table.columns]]
    lines += [[cell_text(cell, _escaped) for cell in row] for row in table.rows]
    widths = [max(3, *map(len, column)) for column in zip(*lines, strict=True)]
    at_right = [_is_numeric([row[at] for row in table.rows]) for at in range(len(widths))]
    rules = [
        "-" * (width - 1) + (":" if right else "-")
        for width, right in zip(widths, at_right, strict=True)
    ]
    padded = [
        [
            text.rjust(width) if right else text.ljust(width)
            for text, width, right in zip(line, widths, at_right, strict=True)
        ]
        for line in lines
    ]
    return "\n".join(f"| {' | '.join(line)} |" for line in [padded[0], rules, *padded[1:]])


def csv_text(table: Table) -> str:
    """Write the table as RFC 4180 has it, numbers in full.

    A column `x` of intervals becomes `x`, `x low` and `x high`. What is not finite is left empty.
    A text that a spreadsheet would take for a formula gets an apostrophe in front.
    """
    has_interval = [
        any(isinstance(row[at], Interval) for row in table.rows) for at in range(len(table.columns))
    ]
    header = [
        _harmless(title)
        for name, three in zip(table.columns, has_interval, strict=True)
        for title in ((name, f"{name} low", f"{name} high") if three else (name,))
    ]
    stream = io.StringIO(newline="")
    writer = csv.writer(stream)
    writer.writerow(header)
    for row in table.rows:
        writer.writerow(
            value
            for cell, three in zip(row, has_interval, strict=True)
            for value in _csv_cells(cell, three)
        )
    return stream.getvalue()


def write_tables(folder: Path, title: str, tables: Sequence[Table], intro: str = "") -> None:
    """Write `tables.md` with all tables, and a `<name>.csv` for each; every file is whole.

    intro : Markdown, shown above the tables.

    Raises
    ------
    WrongInput : two tables have one name, or a file cannot be written.
    """
    twice = [name for name, n in Counter(table.name for table in tables).items() if n > 1]
    if twice:
        raise WrongInput(f"several tables are called {twice[0]}; each needs a name of its own")
    blocks = [f"# {_escaped(title)}", intro]
    for table in tables:
        blocks += [f"## {_escaped(table.title)}", markdown(table), table.note]
        write_whole(folder / f"{table.name}.csv", _utf_8(csv_text(table)))
    text = "\n\n".join(block for block in blocks if block)
    write_whole(folder / "tables.md", _utf_8(text + "\n"))


def cell_text(cell: Cell, text: Callable[[str], str] = str) -> str:
    """Show a cell to a person; `text` is what is done with one that is no number."""
    match cell:
        case str():
            return text(cell)
        case Interval(mean, low, high):
            if not math.isfinite(mean):
                return _NOTHING
            return f"{cell_text(mean)} [{cell_text(low)}, {cell_text(high)}]"
        case float():
            return f"{cell:z.3f}" if math.isfinite(cell) else _NOTHING
        case None:
            return _NOTHING
    return str(cell)


def _csv_cells(cell: Cell, three: bool) -> list[str | int | float]:
    if not three:
        return [_csv_cell(cell)]
    if isinstance(cell, Interval):
        return [_csv_cell(cell.mean), _csv_cell(cell.low), _csv_cell(cell.high)]
    return [_csv_cell(cell), "", ""]


def _csv_cell(cell: Cell) -> str | int | float:
    match cell:
        case str():
            return _harmless(cell)
        case int():
            return cell
        case float() if math.isfinite(cell):
            return float(cell)
    return ""


def _harmless(text: str) -> str:
    return f"'{text}" if text.lstrip().startswith(_FORMULA_STARTS) else text


def _is_numeric(cells: Sequence[Cell]) -> bool:
    return any(cell is not None for cell in cells) and not any(
        isinstance(cell, str) for cell in cells
    )


def _escaped(text: str) -> str:
    """On one line, and nothing in it is Markdown."""
    return _MARKUP.sub(r"\\\g<0>", " ".join(text.splitlines()))


def _utf_8(text: str) -> bytes:
    """A byte of a name that is not UTF-8 as its escape."""
    return text.encode("utf-8", "backslashreplace")
