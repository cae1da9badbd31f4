"""What a kind of table is: the roles of its columns, and the header it is known by."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from contracts.config import North
from contracts.errors import BadSurvey
from survey.files import IMAGE_SUFFIXES
from survey.tables.convention import OWN, Convention

Role = Literal[
    "file", "x", "y", "lon", "lat", "z", "heading", "pitch", "roll", "omega", "phi", "kappa",
    "m11", "m12", "m13", "m21", "m22", "m23", "m31", "m32", "m33", "qw", "qx", "qy", "qz",
    "time", "camera", "hfov", "error", "crs",
]  # fmt: skip
ROLES: tuple[Role, ...] = get_args(Role)
MATRIX: tuple[Role, ...] = ROLES[12:21]

_UNIT = re.compile(r"\[(deg|°|m|s)\]")
_DBF_NAME = 10
"""A Shapefile cuts its column names to so many characters."""


@dataclass(frozen=True, slots=True)
class Profile:
    """One kind of table.

    columns : role -> the names it goes by (see `plain_name`), or its number from 1 if the table
    has no header. needs : names that must be in the header. crs, north : what the format says of
    itself. loose_names : files are named by paths of another machine; the last part counts.
    template : how a file's path is made of the cells `{file}` and `{camera}`.
    repeats : names come more than once, the first counts. all_needed : every column must be there.
    n_columns : of a table without header.
    """

    name: str
    columns: Mapping[Role, tuple[str, ...] | int]
    needs: frozenset[str] = frozenset()
    convention: Convention = OWN
    crs: str | None = None
    north: North | None = None
    loose_names: bool = False
    template: str = "{file}"
    repeats: bool = False
    all_needed: bool = False
    n_columns: tuple[int, ...] = ()

    def fits(self, header: Sequence[str], has_position: bool = False) -> bool:
        """Whether a header is of this kind; has_position : geometries give the positions."""
        names = [plain_name(name) for name in header]
        if self.n_columns or not all(_positions(names, (need,)) for need in self.needs):
            return False
        roles = {
            role
            for role, called in self.columns.items()
            if isinstance(called, int) or _positions(names, called)
        }
        position = has_position or {"x", "y"} <= roles or {"lon", "lat"} <= roles
        return "file" in roles and position

    def fits_cells(self, cells: Sequence[str]) -> bool:
        """Whether the first line of a table without a header is of this kind."""
        return len(cells) in self.n_columns and _names_image(cells[0])

    def find(self, header: Sequence[str], n_columns: int, table: str) -> dict[Role, int]:
        """Which column is what.

        Parameters
        ----------
        header : () without one. n_columns : how many columns there are. table : its name.

        Raises
        ------
        BadSurvey : two columns for the same thing, one that must be there and is not, or fewer
            columns than are numbered.
        """
        found: dict[Role, int] = {}
        plain = [plain_name(name) for name in header]
        for role, called in self.columns.items():
            if isinstance(called, int):
                if called > n_columns:
                    raise BadSurvey(
                        f"pose table {table}: {role} is to be in column {called}, but there are "
                        f"{n_columns}; check the separator and the mapping"
                    )
                found[role] = called - 1
                continue
            at = _positions(plain, called)
            if len(at) > 1 and not self.repeats:
                raise BadSurvey(
                    f"pose table {table}: columns {header[at[0]]!r} and {header[at[1]]!r} both "
                    f"say {role}; remove or rename one of them, or give a mapping (--mapping)"
                )
            if at:
                found[role] = at[0]
            elif self.all_needed:
                raise BadSurvey(
                    f"pose table {table}: columns {list(header)}, but no column {called[0]!r}, "
                    f"which the mapping says is the {role}"
                )
        return found


def plain_name(name: str) -> str:
    """A column's name without its case, blanks, leading `#` and a unit that changes nothing."""
    plain = _UNIT.sub("", name.strip().lower().removeprefix("#"))
    return "_".join(plain.replace("-", "_").split())


def _positions(header: Sequence[str], called: Sequence[str]) -> list[int]:
    """Where in a header of plain names any of some names is; a Shapefile's may be cut."""
    cut = {name[:_DBF_NAME] for name in called}
    return [
        at
        for at, name in enumerate(header)
        if name in called or (len(name) == _DBF_NAME and name in cut)
    ]


def _names_image(cell: str) -> bool:
    return cell.strip().lower().endswith(tuple(IMAGE_SUFFIXES))
