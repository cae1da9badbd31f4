"""The small things by which one copy of a house differs from the next."""

import numpy as np

from survey.synthetic.canvas import Canvas, Colour, shaded
from survey.synthetic.templates import Template

IRON: Colour = (38, 40, 42)
_BOARDS: tuple[tuple[Colour, Colour], ...] = (
    ((34, 38, 48), (230, 216, 172)), ((226, 216, 190), (122, 30, 30)),
    ((110, 32, 32), (236, 226, 204)), ((30, 70, 92), (240, 238, 230)),
    ((232, 226, 210), (36, 40, 44)), ((40, 66, 48), (222, 190, 104)),
)  # fmt: skip
_TRADES = (
    "HOTEL DES VOYAGEURS", "IMPRIMERIE", "GRAND BAZAR", "DENTISTE", "ECOLE DE DANSE", "MEUBLES",
    "BAINS", "NOTAIRE", "MACHINES A COUDRE", "PENSION", "ATELIER DE PEINTURE", "LE PROGRES",
    "CHARBONS", "PIANOS", "THEATRE", "ASSURANCES", "FOURRURES", "CHAUSSURES", "LAMPES", "JOURNAL",
)  # fmt: skip


def draw_frieze(canvas: Canvas, make: Template, level_m: float, rng: np.random.Generator) -> None:
    """Draw a band of carved or painted signs under a floor: every house has its own sequence."""
    cell, high = 0.55, 0.46
    ground = shaded(make.trim, rng.uniform(0.5, 0.75))
    figure = shaded(make.trim, rng.uniform(1.0, 1.2))
    base = level_m - 0.24 - high
    canvas.raised(0, base - 0.04, canvas.width_m, base + high, ground)
    for x in np.arange(cell / 2, canvas.width_m, cell):
        centre, shape = (float(x), base + high / 2), int(rng.integers(6))
        _draw_figure(canvas, centre, shape, 0.38 * high, (figure, ground))


def _draw_figure(
    canvas: Canvas,
    centre: tuple[float, float],
    shape: int,
    reach: float,
    colours: tuple[Colour, Colour],
) -> None:
    (x, y), (figure, ground) = centre, colours
    if shape == 0:
        canvas.disc(x, y, (reach, reach), figure)
        canvas.disc(x, y, (reach / 2, reach / 2), ground)
    elif shape == 1:
        canvas.polygon([(x - reach, y), (x, y - reach), (x + reach, y), (x, y + reach)], figure)
    elif shape == 2:
        canvas.polygon([(x - reach, y - reach), (x + reach, y - reach), (x, y + reach)], figure)
    elif shape == 3:
        canvas.rect(x - reach, y - reach / 3, x + reach, y + reach / 3, figure)
        canvas.rect(x - reach / 3, y - reach, x + reach / 3, y + reach, figure)
    elif shape == 4:
        canvas.rect(x - reach, y - reach, x + reach, y + reach, figure)


def draw_board(canvas: Canvas, make: Template, level_m: float, rng: np.random.Generator) -> None:
    """Draw a trade's long name board across part of the front, under a floor's windows."""
    wide = rng.uniform(0.45, 0.85) * canvas.width_m
    left = rng.uniform(0.3, canvas.width_m - wide - 0.3)
    board, ink = _BOARDS[int(rng.integers(len(_BOARDS)))]
    low, high = level_m - 0.34, level_m + min(0.5, 0.2 + make.floor_m - make.window.height_m - 0.5)
    canvas.raised(left, low, left + wide, high, board)
    words = _TRADES[int(rng.integers(len(_TRADES)))]
    canvas.text(words, (left + 0.2, low + 0.14, left + wide - 0.2, high - 0.12), ink)


def draw_ivy(canvas: Canvas, make: Template, rng: np.random.Generator) -> None:
    """Let a creeper climb from the pavement along random stems."""
    foot = rng.uniform(0.1, 0.9) * canvas.width_m
    tall = make.height_m - make.roof_m
    for _ in range(int(rng.integers(3, 6))):
        x, y, lean = foot, 0.4, rng.normal(0, 0.12)
        while 0 < x < canvas.width_m and y < tall - 0.5 and rng.random() > 0.02:
            lean += rng.normal(0, 0.08)
            x, y = x + lean, y + rng.uniform(0.1, 0.28)
            for _ in range(5):
                spread = rng.normal(0, 0.2, 2)
                leaf = shaded((66, 100, 50), rng.uniform(0.55, 1.35))
                canvas.disc(x + float(spread[0]), y + float(spread[1]), (0.1, 0.07), leaf)


def draw_extras(canvas: Canvas, make: Template, rng: np.random.Generator) -> None:
    """Draw a rain pipe, a plaque, a cable."""
    side = 0.25 if rng.random() < 0.5 else canvas.width_m - 0.3
    eaves = make.height_m - make.roof_m
    canvas.line((side, 0), (side, eaves), 0.11, (92, 96, 94))
    canvas.line((side - 0.03, 0), (side - 0.03, eaves), 0.03, (150, 154, 150))
    place, low = rng.uniform(1, canvas.width_m - 2), make.ground_m + rng.uniform(0.1, 0.4)
    if rng.random() < 0.5:
        canvas.raised(place, low, place + 0.9, low + 0.5, (26, 52, 118))
        number = str(int(rng.integers(1, 99)))
        canvas.text(number, (place + 0.1, low + 0.1, place + 0.8, low + 0.4), (240, 240, 240))
    if rng.random() < 0.5:
        ends = np.sort(rng.uniform(0, canvas.width_m, 2))
        high = make.ground_m - 0.15
        canvas.line((float(ends[0]), high), (float(ends[1]), high - 0.1), 0.03, IRON)


def draw_bars(canvas: Canvas, pattern: int) -> None:
    """Draw ironwork over the lower part of a canvas, in one of four patterns."""
    width, height = canvas.width_m, canvas.height_m
    canvas.rect(0, height - 0.07, width, height, IRON)
    canvas.rect(0, 0.1, width, 0.14, IRON)
    step = (0.13, 0.42, 0.36, 0.5)[pattern]
    for x in np.arange(step / 2, width, step):
        canvas.line((x, 0.1), (x, height), 0.025, IRON)
        if pattern == 0:
            canvas.disc(x, height * 0.5, (0.05, 0.1), IRON)
        elif pattern == 1:
            canvas.line((x - step / 2, 0.1), (x + step / 2, height), 0.03, IRON)
            canvas.line((x + step / 2, 0.1), (x - step / 2, height), 0.03, IRON)
        elif pattern == 2:
            for part in (-0.25, 0.0, 0.25):
                canvas.line((x + part * step, 0.1), (x + part * step, height), 0.02, IRON)
            canvas.disc(x, height * 0.72, (0.12, 0.12), IRON)
        else:
            canvas.rect(x - 0.2, 0.22, x + 0.2, height - 0.16, IRON)
