"""A survey's track as a map: positions by order of capture, headings, suspects; PNG."""

import math
from collections.abc import Collection, Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from coordinator.export.drawing import drawing, shown
from survey.doctor.norths import true_headings
from survey.doctor.track import Track

if TYPE_CHECKING:  # slow to import, and most commands draw nothing
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Mask = NDArray[np.bool_]

_WIDTH_INCHES, _MIN_HEIGHT, _MAX_HEIGHT = 9.0, 5.5, 11.0
_LINE_RGB, _TICK_RGB, _SUSPECT_RGB, _INK_RGB = "#c9c5bb", "#3b4248", "#d1001c", "#22272b"
_COLOURS = "viridis"
_CELLS = 36
"""Headings are drawn for one image a camera and cell, of so many cells along the longer side."""
_TICK_SHARE = 0.02
_STEEP_DEG = 60.0
_MARGIN = 0.06
_MIN_SIDE_M = 20.0
_USUAL, _USUAL_OF_FEW, _MANY = 0.95, 0.75, 40
_BEYOND = 4.0
_NAMED_STRAYS = 6
_LINE_CHARS = 115


def draw_track(
    title: str, track: Track, suspects: Collection[str], notes: Sequence[str] = ()
) -> bytes:
    """Draw a survey, north up, metres equal in x and y.

    Parameters
    ----------
    suspects : uris marked red. notes : lines at the bottom.
    """
    red = np.isin(np.array([image.uri for image in track.images]), list(suspects))
    in_view = _in_view(track)
    west, east, south, north = _window(track.x_m[in_view], track.y_m[in_view])
    height = _WIDTH_INCHES * (north - south) / (east - west)
    height = min(max(height, _MIN_HEIGHT), _MAX_HEIGHT) + 1.1
    with drawing(title, _WIDTH_INCHES, height) as (figure, stream):
        axes = figure.add_subplot()
        axes.set_aspect("equal", adjustable="box", anchor="W")
        axes.set_xlim(west, east)
        axes.set_ylim(south, north)
        axes.set_axis_off()
        lines = "\n".join(shown(line, _LINE_CHARS) for line in notes)
        figure.supxlabel(lines, x=0.01, ha="left", fontsize=9)
        _lines(axes, track)
        _positions(figure, axes, track, red)
        _headings(axes, track, in_view, max(east - west, north - south))
        _strays(axes, track, ~in_view)
        _scale_bar(axes)
        _north_arrow(axes)
        if red.any():
            axes.legend(
                loc="lower right",
                bbox_to_anchor=(1.0, 0.0),
                frameon=False,
                fontsize=9,
                handletextpad=0.3,
            )
    return stream.getvalue()


def _in_view(track: Track) -> _Mask:
    """All but strays, which would shrink the rest to a dot."""
    usual = _USUAL if len(track) >= _MANY else _USUAL_OF_FEW
    metres = np.hypot(track.x_m - np.median(track.x_m), track.y_m - np.median(track.y_m))
    return np.asarray(metres <= _BEYOND * max(float(np.quantile(metres, usual)), _MIN_SIDE_M))


def _window(
    x_m: NDArray[np.float64], y_m: NDArray[np.float64]
) -> tuple[float, float, float, float]:
    middle = (x_m.min() + x_m.max()) / 2.0, (y_m.min() + y_m.max()) / 2.0
    longest = max(float(np.ptp(x_m)), float(np.ptp(y_m)), _MIN_SIDE_M)
    half = [
        (max(float(np.ptp(values)), longest / 3.0) / 2.0) + _MARGIN * longest
        for values in (x_m, y_m)
    ]
    return middle[0] - half[0], middle[0] + half[0], middle[1] - half[1], middle[1] + half[1]


def _lines(axes: "Axes", track: Track) -> None:
    from matplotlib.collections import LineCollection

    paths = [np.column_stack([track.x_m[run], track.y_m[run]]) for run in track.sequences]
    axes.add_collection(
        LineCollection(paths, colors=_LINE_RGB, linewidths=1.0, zorder=1), autolim=False
    )


def _positions(figure: "Figure", axes: "Axes", track: Track, red: _Mask) -> None:
    size = float(np.clip(4_000.0 / len(track), 1.5, 26.0))
    known = np.isfinite(track.time_s)
    if known.any():
        place = np.argsort(np.argsort(track.time_s[known], kind="stable"), kind="stable")
        dots = axes.scatter(
            track.x_m[known], track.y_m[known], c=place / max(1, len(place) - 1), s=size,
            cmap=_COLOURS, vmin=0.0, vmax=1.0, linewidths=0, zorder=3,
        )  # fmt: skip
        bar = figure.colorbar(dots, ax=axes, orientation="horizontal", aspect=60, pad=0.02)
        bar.outline.set_visible(False)
        parts = [0.0, 0.5, 1.0]
        bar.set_ticks(parts, labels=_dates(np.quantile(track.time_s[known], parts)))
        bar.ax.tick_params(labelsize=8)
        first, _, last = bar.ax.get_xticklabels()
        first.set_horizontalalignment("left")
        last.set_horizontalalignment("right")
    axes.scatter(
        track.x_m[~known], track.y_m[~known], s=size, color="#0072b2", linewidths=0, zorder=3
    )
    if red.any():
        axes.scatter(
            track.x_m[red], track.y_m[red], s=max(16.0, 1.4 * size), facecolors="none",
            edgecolors=_SUSPECT_RGB, linewidths=1.2, zorder=5, label=f"{red.sum():,} suspect",
        )  # fmt: skip


def _dates(times_s: NDArray[np.float64]) -> list[str]:
    moments = [datetime.fromtimestamp(float(time_s), UTC) for time_s in times_s]
    return [moment.strftime("%Y-%m-%d %H:%M:%SZ") for moment in moments]


def _headings(axes: "Axes", track: Track, in_view: _Mask, side_m: float) -> None:
    """Short strokes from positions to where their cameras look."""
    from matplotlib.collections import LineCollection

    headings = np.radians(true_headings(track))
    level = ~(np.abs(track.pitch_deg) > _STEEP_DEG)
    some = _one_a_cell(track, in_view & level & np.isfinite(headings), side_m / _CELLS)
    start = np.column_stack([track.x_m[some], track.y_m[some]])
    ahead = np.column_stack([np.sin(headings[some]), np.cos(headings[some])])
    strokes = np.stack([start, start + _TICK_SHARE * side_m * ahead], axis=1)
    axes.add_collection(
        LineCollection(list(strokes), colors=_TICK_RGB, linewidths=0.9, zorder=4), autolim=False
    )


def _one_a_cell(track: Track, drawn: _Mask, cell_m: float) -> NDArray[np.int64]:
    images = np.flatnonzero(drawn)
    cells = np.column_stack(
        [track.x_m[images] // cell_m, track.y_m[images] // cell_m, track.camera[images]]
    )
    _, first = np.unique(cells, axis=0, return_index=True)
    return images[np.sort(first)]


def _strays(axes: "Axes", track: Track, strays: _Mask) -> None:
    """What lies beyond the map, as triangles at its edge, the farthest with their distance."""
    if not strays.any():
        return
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    middle = np.array([(west + east) / 2.0, (south + north) / 2.0])
    away = np.column_stack([track.x_m[strays], track.y_m[strays]]) - middle
    half = np.array([(east - west) / 2.0, (north - south) / 2.0]) * 0.96
    edge = middle + away / np.max(np.abs(away) / half, axis=1, keepdims=True)
    axes.scatter(
        edge[:, 0], edge[:, 1], marker="^", s=50, color=_SUSPECT_RGB, zorder=6,
        label=f"{strays.sum():,} beyond the map",
    )  # fmt: skip
    metres = np.hypot(away[:, 0], away[:, 1])
    for at in np.argsort(-metres)[:_NAMED_STRAYS]:
        left = bool(edge[at, 0] > middle[0])
        axes.annotate(
            _length(metres[at]), edge[at], (-8 if left else 8, 0), textcoords="offset points",
            ha="right" if left else "left", va="center", fontsize=8, color=_SUSPECT_RGB,
        )  # fmt: skip


def _scale_bar(axes: "Axes") -> None:
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    length = _round_length((east - west) / 4.0)
    x, y = west + 0.03 * (east - west), south + 0.03 * (north - south)
    axes.plot([x, x + length], [y, y], color=_INK_RGB, lw=3, solid_capstyle="butt", zorder=7)
    axes.annotate(_length(length), (x, y), (0, 5), textcoords="offset points", fontsize=9, zorder=7)


def _round_length(metres: float) -> float:
    """1, 2 or 5 times a power of ten, at most so long."""
    power = 10.0 ** math.floor(math.log10(metres))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= metres)


def _length(metres: float) -> str:
    return f"{metres / 1000.0:,.3g} km" if metres >= 1000.0 else f"{metres:.3g} m"


def _north_arrow(axes: "Axes") -> None:
    axes.annotate(
        "N", (0.03, 0.98), (0.03, 0.91), xycoords="axes fraction", textcoords="axes fraction",
        ha="center", va="center", fontsize=10, weight="bold", zorder=7,
        arrowprops={"arrowstyle": "-|>", "color": _INK_RGB, "lw": 1.4},
    )  # fmt: skip
