"""A table as it was read, column by column, before anyone asks what a column means."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from contracts.places import Place

Column = Sequence[str] | NDArray[np.float64]
"""The cells of one column: text, or numbers where the format has them; NaN: not known."""

Faults = dict[int, str]
"""Position of a row in its table -> why the row is left out."""


@dataclass(frozen=True, slots=True)
class Table:
    """A table of n rows.

    names : of the columns as written; () without a header. numbers : (n,) what each row is called
    in the file, such as its line. row_word : "row" or "feature". decimal_comma : whether `1,5`
    may be one and a half. xyz : (n, 3) positions of the geometries, z NaN where there is none, or
    None. crs : of `xyz`. faults : rows whose geometry or record cannot be used.
    """

    path: Place
    names: tuple[str, ...]
    columns: tuple[Column, ...]
    numbers: Sequence[int]
    row_word: str = "row"
    decimal_comma: bool = False
    xyz: NDArray[np.float64] | None = None
    crs: str | None = None
    faults: Faults = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def width(self) -> int:
        """How many columns there are."""
        return len(self.columns)

    def texts(self, column: int | None) -> Sequence[str]:
        """(n,) the cells of a column as stripped text; "" where there is no column or cell."""
        if column is None:
            return [""] * len(self)
        cells = self.columns[column]
        if isinstance(cells, np.ndarray):
            return ["" if np.isnan(number) else f"{number:.17g}" for number in cells]
        return [cell.strip() for cell in cells]

    def row(self, at: int) -> str:
        """What a person calls the row, such as `poses.csv row 3`."""
        return f"{self.path.name} {self.row_word} {self.numbers[at]}"

    def cell(self, at: int, column: int) -> str:
        """What a person calls a cell, such as `poses.csv row 3 column 'x'`."""
        name = repr(self.names[column]) if self.names else str(column + 1)
        return f"{self.row(at)} column {name}"


def first_faults(*parts: Mapping[int, str]) -> Faults:
    """All faults together; of several of one row the first counts."""
    joined: Faults = {}
    for part in reversed(parts):
        joined |= part
    return joined
