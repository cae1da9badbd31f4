"""Columns of numbers, with what is wrong with each cell that is none."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from survey.tables.table import Faults, Table

_UNKNOWN = frozenset({"", "null", "none", "na", "n/a", "\\n", "-"})


@dataclass(frozen=True, slots=True)
class Numbers:
    """(n,) float64, NaN where a number is not known, and the rows where it is wrong."""

    values: NDArray[np.float64]
    faults: Faults


def read_numbers(
    table: Table, column: int | None, quantity: str, unknown: Sequence[float] = ()
) -> Numbers:
    """One column as numbers.

    Parameters
    ----------
    column : None: the table has none, nothing is known. quantity : what a person calls it.
    unknown : numbers that stand for "not known".
    """
    if column is None:
        return Numbers(np.full(len(table), np.nan), {})
    cells = table.columns[column]
    faults: Faults = {}
    if isinstance(cells, np.ndarray):
        values = cells.copy()
        for at in np.flatnonzero(np.isinf(values)):
            faults[int(at)] = _expected(table, int(at), column, quantity, f"{values[at]:g}")
            values[at] = np.nan
    else:
        values, wrong = _parsed(cells, table.decimal_comma)
        faults = {at: _expected(table, at, column, quantity, cells[at].strip()) for at in wrong}
    if unknown:
        values[np.isin(values, unknown)] = np.nan
    return Numbers(values, faults)


def _expected(table: Table, at: int, column: int, quantity: str, found: str) -> str:
    shown = found if len(found) <= 40 else found[:37] + "..."
    hint = "; write it without thousands separators" if _has_thousands(found) else ""
    return (
        f"{table.cell(at, column)}: {quantity} is {shown!r}, expected a finite number such as "
        f"1234.5{hint}"
    )


def _has_thousands(text: str) -> bool:
    digits = text.replace("\u202f", " ").replace("\xa0", " ").lstrip("+-")
    return bool(digits) and set(digits) <= set("0123456789.,' ") and not digits.isdigit()


def _parsed(cells: Sequence[str], decimal_comma: bool) -> tuple[NDArray[np.float64], list[int]]:
    """Numbers, and the positions of cells that are none. A clean column is read in one go."""
    try:
        values = np.array([_plain(cell) for cell in cells], np.float64)
    except ValueError:
        values = np.array([_number(cell.strip(), decimal_comma) for cell in cells], np.float64)
    wrong = [
        at
        for at in np.flatnonzero(~np.isfinite(values)).tolist()
        if cells[at].strip().lower() not in _UNKNOWN
    ]
    values[~np.isfinite(values)] = np.nan
    return values, wrong


def _plain(text: str) -> float:
    if "_" in text:  # Python's own thousands separator, nobody else's
        raise ValueError
    return float(text)


def _number(text: str, decimal_comma: bool) -> float:
    """A cell's number, NaN if it is none. `17700/100` is how EXIF writes a direction."""
    if decimal_comma and "." not in text:
        text = text.replace(",", ".")
    above, slash, below = text.partition("/")
    try:
        return _plain(above) / _plain(below) if slash else _plain(above)
    except (ValueError, ZeroDivisionError):
        return float("nan")
