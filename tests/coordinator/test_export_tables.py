import csv
import io
import math
import re
from pathlib import Path

import pytest

from contracts.errors import WrongInput
from coordinator.export.tables import Cell, Table, csv_text, markdown, write_tables
from retrieval.resampling import Interval

HOSTILE = 'a|b\\|c\n<b>*x* `y` "q",é'


def table(*rows: tuple[Cell, ...], columns: tuple[str, ...] = ("what", "mAP")) -> Table:
    return Table("t-1", "A table", columns, rows)


def cells_of(line: str) -> list[str]:
    """As GitHub splits a row: a backslash keeps what follows it together, a pipe ends a cell."""
    return [cell.strip() for cell in re.findall(r"\|((?:\\.|[^|\\])+)(?=\|)", line)]


def unescaped(cell: str) -> str:
    return re.sub(r"\\([!-/:-@\[-`{-~])", r"\1", cell)


def read_csv(of: Table) -> list[list[str]]:
    return list(csv.reader(io.StringIO(csv_text(of), newline=""), strict=True))


@pytest.mark.parametrize(
    ("cell", "shown"),
    [
        (0.6124, "0.612"),
        (-0.0001, "0.000"),
        (50, "50"),
        (None, "–"),
        (math.nan, "–"),
        (-math.inf, "–"),
        (Interval(0.612, 0.57, 0.655), "0.612 [0.570, 0.655]"),
        (Interval(0.4, math.nan, math.nan), "0.400 [–, –]"),
        (Interval(0.4, -math.inf, 1.2), "0.400 [–, 1.200]"),
        (Interval(math.nan, math.nan, math.nan), "–"),
    ],
)
def test_numbers_have_three_decimals_and_what_is_none_a_dash(cell: Cell, shown: str) -> None:
    assert cells_of(markdown(table(("x", cell))).splitlines()[2]) == ["x", shown]


def test_a_name_stays_in_its_cell_and_is_no_markup() -> None:
    lines = markdown(table((HOSTILE, 0.5), ("_a_b_.jpg", 1.0))).splitlines()
    assert len(lines) == 4
    assert unescaped(cells_of(lines[2])[0]) == HOSTILE.replace("\n", " ")
    assert cells_of(lines[2])[1] == "0.500"
    assert "\\<b>\\*x\\* \\`y\\`" in lines[2]
    assert cells_of(lines[3])[0] == "\\_a_b\\_.jpg"


def test_columns_of_numbers_are_at_the_right_and_of_texts_at_the_left() -> None:
    rows = (("a", 1, 0.5, None), ("bcde", None, Interval(0.5, 0.4, 0.6), None))
    rule = markdown(table(*rows, columns=("n", "k", "mAP", "none"))).splitlines()[1]
    assert [cell.endswith(":") for cell in cells_of(rule)] == [False, True, True, False]


def test_a_table_without_rows_is_a_heading() -> None:
    assert markdown(table()) == "| what | mAP |\n| ---- | --- |"
    assert csv_text(table()) == "what,mAP\r\n"


def test_csv_holds_intervals_as_three_columns_and_numbers_in_full() -> None:
    third = 1 / 3
    rows = (
        ("a", Interval(third, -0.25, math.inf), 3, None),
        ("b", 0.5, -2, None),
        ("c", None, -0.1, math.nan),
    )
    assert read_csv(table(*rows, columns=("what", "mAP", "n", "paper"))) == [
        ["what", "mAP", "mAP low", "mAP high", "n", "paper"],
        ["a", str(third), "-0.25", "", "3", ""],
        ["b", "0.5", "", "", "-2", ""],
        ["c", "", "", "", "-0.1", ""],
    ]


@pytest.mark.parametrize(
    "name", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1+1", "\r\n=cmd|' /C calc'!A0"]
)
def test_a_text_is_no_formula_in_a_spreadsheet(name: str) -> None:
    of = table((name, -1.5), columns=(name, "x"))
    assert read_csv(of) == [["'" + name, "x"], ["'" + name, "-1.5"]]


def test_other_names_come_back_from_csv_as_they_are() -> None:
    assert read_csv(table((HOSTILE, 1)))[1] == [HOSTILE, "1"]


def test_a_row_that_does_not_fit_is_refused() -> None:
    with pytest.raises(WrongInput, match="row 2 of table t-1 has 1 cells for 2 columns"):
        table(("a", 1), ("b",))


@pytest.mark.parametrize("name", ["", "../up", "A", "a b", "a\n"])
def test_a_name_that_is_no_file_stem_is_refused(name: str) -> None:
    with pytest.raises(WrongInput, match="cannot name a file"):
        Table(name, "", ("a",), ())


def test_written_tables_are_one_page_and_a_csv_each(tmp_path: Path) -> None:
    undecodable = b"caf\xe9".decode("utf-8", "surrogateescape")
    first = Table("one", "One | two", ("q",), ((undecodable,),), note="*A note.*")
    write_tables(tmp_path / "new", "Réport", (first, table(("x", 1.0))), "Some words.")
    assert {path.name for path in (tmp_path / "new").iterdir()} == {
        "tables.md",
        "one.csv",
        "t-1.csv",
    }
    text = (tmp_path / "new" / "tables.md").read_text("utf-8")
    order = ["# Réport", "Some words.", "## One \\| two", "caf\\udce9", "*A note.*", "## A table"]
    assert [text.index(part) for part in order] == sorted(text.index(part) for part in order)
    assert (tmp_path / "new" / "t-1.csv").read_bytes() == csv_text(table(("x", 1.0))).encode()


def test_two_tables_of_one_name_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(WrongInput, match="several tables are called t-1"):
        write_tables(tmp_path / "new", "t", (table(), table()))
    assert not (tmp_path / "new").exists()
