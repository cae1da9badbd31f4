"""Tables on stdout: drawn by rich on a terminal, plain aligned lines elsewhere."""

from collections.abc import Sequence

import typer
from rich.cells import cell_len
from rich.table import Table
from rich.text import Text

from coordinator.cli.outputs import utf_8
from coordinator.cli.show import stdout
from coordinator.export.harmless import harmless

Rows = Sequence[Sequence[str]]


def print_table(columns: Sequence[str], rows: Rows) -> None:
    """Print rows under their headings; columns of numbers are flush right."""
    rows = [[harmless(cell) for cell in row] for row in rows]
    right = [_of_numbers([row[at] for row in rows]) for at in range(len(columns))]
    if not stdout.is_terminal:
        typer.echo(utf_8("\n".join(aligned([columns, *rows], right))))
        return
    table = Table()
    for name, is_right in zip(columns, right, strict=True):
        table.add_column(name, justify="right" if is_right else "left")
    for row in rows:
        table.add_row(*map(Text, row))
    stdout.print(table)


def print_line(line: str) -> None:
    """Print a line between tables, in UTF-8 in every locale."""
    typer.echo(utf_8(harmless(line)))


def aligned(rows: Rows, right: Sequence[bool]) -> list[str]:
    """Lines whose columns begin or end below one another, two spaces apart."""
    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = []
        for cell, width, is_right in zip(row, widths, right, strict=True):
            filling = " " * (width - cell_len(cell))
            cells.append(filling + cell if is_right else cell + filling)
        lines.append("  ".join(cells).rstrip())
    return lines


def _of_numbers(cells: Sequence[str]) -> bool:
    return all(cell in {"", "-"} or cell[0].isdigit() for cell in cells)
