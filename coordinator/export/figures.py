"""Figures of results, as PNG: the same table gives the same bytes, whatever the user's settings."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from contracts.errors import WrongInput
from coordinator.export.drawing import QUIET_RGB, drawing, shown
from coordinator.export.tables import Cell, Table, cell_text
from retrieval.resampling import Interval

if TYPE_CHECKING:  # slow to import, and most commands draw nothing
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OURS_RGB, PAPER_RGB = "#0072b2", "#d55e00"
"""Blue and vermilion of Okabe & Ito (2008), which differ to every eye and in grey."""

_ROW_INCHES = 0.3
_WIDTH_INCHES = 9.0
_PANEL_LABEL_CHARS, _PANEL_TITLE_CHARS = 22, 30


@dataclass(frozen=True, slots=True)
class Share:
    """How often one thing was chosen, 0 to 1; paper : in the paper, None if not known."""

    label: str
    ours: float
    paper: float | None = None


@dataclass(frozen=True, slots=True)
class Panel:
    """One distribution, its bars from top to bottom."""

    title: str
    shares: tuple[Share, ...]


def draw_intervals(
    table: Table, value: str, label: str, group: str | None = None, paper: str | None = None
) -> bytes:
    """Draw a dot and a whisker for every row of a table, from top to bottom; PNG.

    A row without a value keeps its line; an end that is infinite is drawn to the edge.

    Parameters
    ----------
    value, label : the columns of what is drawn, intervals or numbers, and of what it is called.
    group : a column; where its cell differs from the row above, a heading is set.
    paper : a column with the paper's number, drawn as a hollow marker where there is one.

    Raises
    ------
    WrongInput : the table has no such column or no row.
    """
    values = [_as_interval(cell) for cell in _column(table, value)]
    labels = [cell_text(cell) for cell in _column(table, label)]
    papers = [_as_interval(cell).mean for cell in _column(table, paper)] if paper else []
    places, headings = _lines([cell_text(c) for c in _column(table, group)] if group else labels)
    if not group:
        places, headings = list(range(len(labels))), []
    n_lines = len(labels) + len(headings)
    with drawing(table.title, _WIDTH_INCHES, 1.5 + _ROW_INCHES * n_lines) as (figure, stream):
        axes = figure.add_subplot()
        axes.set_ylim(n_lines - 0.4, -0.6)
        axes.set_yticks(places, [shown(text) for text in labels])
        for place, text in headings:
            _heading(axes, place, text)
        _limit(axes, values, papers)
        _draw_ours(axes, places, values)
        if any(math.isfinite(number) for number in papers):
            axes.plot(
                papers, places, "D", fillstyle="none", color=PAPER_RGB, mew=1.6, ms=7,
                label="paper", zorder=4,
            )  # fmt: skip
        axes.set_xlabel(shown(value))
        _legend(figure, axes)
    return stream.getvalue()


def draw_shares(title: str, panels: Sequence[Panel]) -> bytes:
    """Draw the distributions side by side, two in a row, ours above the paper's; PNG.

    Raises
    ------
    WrongInput : there is nothing to draw, or a share is not within 0 and 1.
    """
    if not panels or not all(panel.shares for panel in panels):
        raise WrongInput(f"figure {title!r} has a panel without shares; give every panel one")
    for panel in panels:
        for share in panel.shares:
            if not all(0 <= number <= 1 for number in (share.ours, share.paper or 0.0)):
                raise WrongInput(
                    f"the share of {share.label} in {panel.title} is {share.ours} (paper: "
                    f"{share.paper}); expected 0 to 1"
                )
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    most = max(len(panel.shares) for panel in panels)
    has_paper = any(share.paper is not None for panel in panels for share in panel.shares)
    height = 1.0 + rows * (0.9 + _ROW_INCHES * most * (1.5 if has_paper else 1.0))
    with drawing(title, _WIDTH_INCHES, height) as (figure, stream):
        for number, panel in enumerate(panels, 1):
            _draw_panel(figure.add_subplot(rows, columns, number), panel, most)
        _legend(figure, *figure.axes)
    return stream.getvalue()


def _draw_panel(axes: "Axes", panel: Panel, most: int) -> None:
    """`most` : room for so many bars, so that those of all panels are of one height."""
    places = range(len(panel.shares))
    papers = [(at, s.paper) for at, s in enumerate(panel.shares) if s.paper is not None]
    thick, apart = (0.36, 0.19) if papers else (0.6, 0.0)
    ours = [(at - apart, share.ours) for at, share in enumerate(panel.shares)]
    for bars, colour, name, fill in (
        (ours, OURS_RGB, "ours", True),
        ([(at + apart, share) for at, share in papers], PAPER_RGB, "paper", False),
    ):
        if bars:
            heights, shares = zip(*bars, strict=True)
            axes.barh(
                heights, shares, thick, label=name, fill=fill, color=colour, edgecolor=colour,
                linewidth=1.4,
            )  # fmt: skip
        for at, share in bars:
            axes.annotate(
                f"{share:.0%}", (share, at), (4, 0), textcoords="offset points", va="center", size=9
            )
    axes.set_yticks(list(places), [shown(s.label, _PANEL_LABEL_CHARS) for s in panel.shares])
    axes.set_ylim(most - 0.4, -0.6)
    axes.set_xlim(0, 1.12)
    ticks = [0.0, 0.25, 0.5, 0.75, 1.0]
    axes.set_xticks(ticks, [f"{tick:.0%}" for tick in ticks])
    axes.set_title(shown(panel.title, _PANEL_TITLE_CHARS), loc="left", size=10.5)


def _lines(groups: Sequence[str]) -> tuple[list[int], list[tuple[int, str]]]:
    """The line of each row, and line and text of the headings between them."""
    places: list[int] = []
    headings: list[tuple[int, str]] = []
    for number, text in enumerate(groups):
        if number == 0 or text != groups[number - 1]:
            headings.append((number + len(headings), text))
        places.append(number + len(headings))
    return places, headings


def _heading(axes: "Axes", place: int, text: str) -> None:
    axes.annotate(
        shown(text), (0, place), (6, 0), xycoords=("axes fraction", "data"),
        textcoords="offset points", va="center", weight="bold", size=10,
    )  # fmt: skip


def _limit(axes: "Axes", values: Sequence[Interval], papers: Sequence[float]) -> None:
    """From 0 where all is above, and to 1 where all is below: scores keep their scale."""
    numbers = [*papers, *(n for each in values for n in (each.mean, each.low, each.high))]
    finite = [number for number in numbers if math.isfinite(number)] or [0.0, 1.0]
    low, high = min(0.0, *finite), max(finite)
    axes.set_xlim(low * 1.08, 1.0 if 0.6 < high <= 1 else (high * 1.08 or 1.0))


def _draw_ours(axes: "Axes", places: Sequence[int], values: Sequence[Interval]) -> None:
    left, right = axes.get_xlim()
    for place, each in zip(places, values, strict=True):
        axes.annotate(
            cell_text(each) if math.isfinite(each.low + each.high) else cell_text(each.mean),
            (1, place), (10, 0), xycoords=("axes fraction", "data"), textcoords="offset points",
            va="center", size=9, color=QUIET_RGB, annotation_clip=False,
        )  # fmt: skip
        if not (math.isnan(each.low) or math.isnan(each.high)):
            ends = (max(each.low, left), min(each.high, right))
            axes.plot(ends, (place, place), "-", color=OURS_RGB, lw=2, solid_capstyle="butt")
    if left < 0:
        axes.axvline(0, color=QUIET_RGB, lw=1)
    means = [each.mean for each in values]
    axes.plot(means, places, "o", color=OURS_RGB, ms=6, label="ours, 95 % interval", zorder=3)


def _legend(figure: "Figure", *axes: "Axes") -> None:
    named = {
        name: handle
        for each in axes
        for handle, name in zip(*each.get_legend_handles_labels(), strict=True)
    }
    if len(named) > 1 or "ours" not in named:
        figure.legend(
            list(named.values()), list(named), loc="outside lower left", ncols=2, frameon=False
        )


def _as_interval(cell: Cell) -> Interval:
    if isinstance(cell, Interval):
        return cell
    return Interval(float(cell) if isinstance(cell, int | float) else math.nan, math.nan, math.nan)


def _column(table: Table, name: str) -> list[Cell]:
    if name not in table.columns:
        raise WrongInput(
            f"table {table.name} has no column {name!r}; it has {', '.join(table.columns)}"
        )
    if not table.rows:
        raise WrongInput(f"table {table.name} has no row to draw")
    at = table.columns.index(name)
    return [row[at] for row in table.rows]
