"""A figure to draw on, as PNG: the same drawing gives the same bytes, whatever the settings."""

import io
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # slow to import, and most commands draw nothing
    from matplotlib.figure import Figure

INK_RGB, QUIET_RGB, GRID_RGB = "#22272b", "#666e75", "#e2dfd8"
LABEL_CHARS = 44
_DPI = 150
_SETTINGS: dict[Any, Any] = {  # matplotlib types each key, and differently by version
    "font.family": ["DejaVu Sans"],  # it comes with matplotlib
    "font.size": 10.0,
    "text.parse_math": False,  # a name may hold dollars
    "text.color": INK_RGB,
    "axes.edgecolor": QUIET_RGB,
    "axes.labelcolor": INK_RGB,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.spines.left": False,
    "axes.grid": True,
    "axes.grid.axis": "x",
    "axes.axisbelow": True,
    "grid.color": GRID_RGB,
    "xtick.color": INK_RGB,
    "ytick.color": INK_RGB,
    "ytick.major.size": 0.0,
}


@contextmanager
def drawing(title: str, width: float, height: float) -> Iterator[tuple["Figure", io.BytesIO]]:
    """A titled figure, in inches, that is written to the stream when the block ends."""
    with _quiet_matplotlib():
        import matplotlib as mpl
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        with mpl.rc_context():
            # The defaults first: a matplotlibrc of the user would show in the figure.
            mpl.rcdefaults()
            mpl.rcParams.update(_SETTINGS)
            figure = Figure((width, height), dpi=_DPI, layout="constrained")
            FigureCanvasAgg(figure)
            figure.suptitle(shown(title, 2 * LABEL_CHARS), x=0.01, ha="left", weight="bold")
            stream = io.BytesIO()
            yield figure, stream
            figure.savefig(stream, format="png", metadata={"Software": None})


@contextmanager
def _quiet_matplotlib() -> Iterator[None]:
    """Without its log: of a home folder that cannot be written, of a font cache being made."""
    logger = logging.getLogger("matplotlib")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(level)


def shown(text: str, most: int = LABEL_CHARS) -> str:
    """On one line, cut to a length, with a question mark for what the font lacks."""
    import matplotlib as mpl
    from matplotlib.ft2font import FT2Font

    font = FT2Font(str(Path(mpl.get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")))
    line = " ".join(text.split())
    cut = line if len(line) <= most else f"{line[: most - 1]}…"
    return "".join(char if font.get_char_index(ord(char)) else "?" for char in cut)
