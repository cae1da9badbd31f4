import io
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageColor

from contracts.errors import WrongInput
from coordinator.export.figures import (
    OURS_RGB,
    PAPER_RGB,
    Panel,
    Share,
    draw_intervals,
    draw_shares,
)
from coordinator.export.tables import Cell, Table
from retrieval.resampling import Interval

REPOSITORY = Path(__file__).parents[2]


def table(*rows: tuple[Cell, ...]) -> Table:
    return Table("t", "Title é 日本 $x_1$", ("pair", "system", "mAP", "paper"), rows)


def drawn(png: bytes) -> NDArray[np.uint8]:
    return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))


def pixels_of(png: bytes, colour: str) -> NDArray[np.int64]:
    """Rows and columns of the pixels of one colour, (n, 2)."""
    at: NDArray[np.int64] = np.argwhere((drawn(png) == ImageColor.getrgb(colour)).all(axis=2))
    return at


def width_of(png: bytes, colour: str) -> int:
    columns = pixels_of(png, colour)[:, 1]
    return int(columns.max() - columns.min()) if len(columns) else 0


def plotted(png: bytes, colour: str) -> NDArray[np.int64]:
    """Without the legend, whose marker is the lowest thing in our colour."""
    at = pixels_of(png, colour)
    above: NDArray[np.int64] = at[at[:, 0] < pixels_of(png, OURS_RGB)[:, 0].max() - 40]
    return above


def intervals(*ends: tuple[float, float]) -> bytes:
    rows = [("a", str(number), Interval(0.5, *each), None) for number, each in enumerate(ends)]
    return draw_intervals(table(*rows), "mAP", "system")


def spans(png: bytes) -> list[tuple[int, int]]:
    """First and last column of what each row has in our colour."""
    at = plotted(png, OURS_RGB)
    rows = np.split(at, np.flatnonzero(np.diff(at[:, 0]) > 5) + 1)
    return [(int(row[:, 1].min()), int(row[:, 1].max())) for row in rows]


def test_a_whisker_spans_its_interval() -> None:
    wide, narrow, none = (
        last - first
        for first, last in spans(intervals((0.1, 0.9), (0.4, 0.6), (math.nan, math.nan)))
    )
    assert wide / narrow == pytest.approx(4, rel=0.05)
    assert none < narrow / 4  # the dot alone


def test_an_end_without_bound_reaches_the_edge() -> None:
    bounded, unbounded, above = spans(
        intervals((0.0, 1.0), (-math.inf, math.inf), (0.25, math.inf))
    )
    assert unbounded == bounded
    assert above[1] == bounded[1]
    assert above[0] > bounded[0] + 100


def test_the_paper_has_a_hollow_marker_only_where_it_has_a_number() -> None:
    with_paper = draw_intervals(
        table(("a", "b", 0.5, 0.9), ("a", "c", 0.5, None)), "mAP", "system", "pair", "paper"
    )
    markers = plotted(with_paper, PAPER_RGB)
    assert len(markers)
    assert markers[:, 0].max() - markers[:, 0].min() < 40  # one marker, of one row
    middle = markers.mean(axis=0).round().astype(int)
    assert (drawn(with_paper)[tuple(middle)] == 255).all()
    assert not len(pixels_of(intervals((0.4, 0.6)), PAPER_RGB))


def test_more_rows_make_a_taller_figure_of_the_same_width() -> None:
    rows = [("a", str(n), 0.5, None) for n in range(40)]
    heights, widths = zip(
        *(drawn(draw_intervals(table(*rows[:n]), "mAP", "system")).shape[:2] for n in (4, 40)),
        strict=True,
    )
    assert heights[1] > 3 * heights[0]
    assert widths[0] == widths[1]


def test_nothing_is_cut_off_at_the_edges() -> None:
    long = "a very long name of a system that goes on and on, far beyond what a label can hold"
    rows = [
        (long, long, Interval(0.5, 0.4, 0.6), 0.7),
        ("b", "<script>\udce9\n$\\frac{$", None, None),
    ]
    panel = Panel(long, (Share(long, 1.0, 1.0), Share("b", 0.0)))
    for png in (
        draw_intervals(table(*rows), "mAP", "system", "pair", "paper"),
        draw_shares(long + long, [panel, panel]),
    ):
        picture = drawn(png)
        for edge in (picture[0], picture[-1], picture[:, 0], picture[:, -1]):
            assert (edge == 255).all()


def test_bars_are_as_long_as_their_shares() -> None:
    whole, part = (
        draw_shares("t", [Panel("k", (Share("2", share), Share("5", 0.0)))]) for share in (1.0, 0.4)
    )
    assert width_of(part, OURS_RGB) / width_of(whole, OURS_RGB) == pytest.approx(0.4, abs=0.01)
    assert not len(pixels_of(whole, PAPER_RGB))
    assert len(pixels_of(draw_shares("t", [Panel("k", (Share("2", 0.5, 0.91),))]), PAPER_RGB))


def test_the_same_table_gives_the_same_bytes_and_no_date() -> None:
    panels = [Panel("k", (Share("2", 0.5, 0.9),))]
    assert intervals((0.4, 0.6)) == intervals((0.4, 0.6))
    assert draw_shares("t", panels) == draw_shares("t", panels)
    assert set(Image.open(io.BytesIO(intervals((0.4, 0.6)))).info) == {"dpi"}


def test_a_user_s_settings_change_nothing_and_are_left_alone() -> None:
    import matplotlib as mpl

    plain = intervals((0.4, 0.6))
    with mpl.rc_context({"font.size": 30, "axes.facecolor": "black", "text.parse_math": True}):
        assert intervals((0.4, 0.6)) == plain
        assert mpl.rcParams["font.size"] == 30


def test_without_a_home_that_can_be_written_nothing_is_said(tmp_path: Path) -> None:
    program = (
        "from coordinator.export.figures import Panel, Share, draw_shares\n"
        "import sys\n"
        "assert 'matplotlib' not in sys.modules\n"
        "draw_shares('日本', [Panel('k', (Share('2', 0.5),))])\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    environment = {
        **os.environ, "MPLCONFIGDIR": "/dev/null/no", "HOME": "/dev/null", "TMPDIR": str(tmp_path),
        "PYTHONPATH": str(REPOSITORY),
    }  # fmt: skip
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        capture_output=True, text=True, timeout=120, check=False, env=environment,
    )  # fmt: skip
    assert (done.returncode, done.stderr, done.stdout) == (0, "", "")


@pytest.mark.parametrize("share", [-0.1, 1.1, math.nan])
def test_a_share_that_is_none_is_refused(share: float) -> None:
    with pytest.raises(WrongInput, match="expected 0 to 1"):
        draw_shares("t", [Panel("k", (Share("2", share),))])
    with pytest.raises(WrongInput, match="expected 0 to 1"):
        draw_shares("t", [Panel("k", (Share("2", 0.5, share),))])


def test_what_cannot_be_drawn_is_refused_by_name() -> None:
    with pytest.raises(WrongInput, match="no column 'AP'; it has pair, system, mAP, paper"):
        draw_intervals(table(("a", "b", 0.5, None)), "AP", "system")
    with pytest.raises(WrongInput, match="table t has no row"):
        draw_intervals(table(), "mAP", "system")
    with pytest.raises(WrongInput, match="panel without shares"):
        draw_shares("t", [Panel("k", ())])
