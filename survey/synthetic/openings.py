"""Windows, doors and shop fronts, drawn on a facade."""

from itertools import pairwise

import numpy as np

from survey.synthetic.canvas import Canvas, Colour, shaded
from survey.synthetic.templates import Template, Window

SIGNS = (
    "BOULANGERIE", "PHARMACIE", "CAFE DU NORD", "LIBRAIRIE", "TABAC", "HORLOGER", "AU BON MARCHE",
    "CORDONNERIE", "EPICERIE FINE", "CHAPELIER", "LE ZINC", "FLEURISTE", "MODES", "QUINCAILLERIE",
    "VINS & LIQUEURS", "PAPETERIE", "COIFFEUR", "TAILLEUR", "BRASSERIE", "PHOTOGRAPHE",
    "CREMERIE", "LUTHIER", "OPTICIEN", "ANTIQUITES", "CHOCOLATIER", "GALERIE", "MERCERIE",
    "BOUCHERIE", "RELIEUR", "CYCLES", "LE PETIT DUC", "SALON DE THE",
)  # fmt: skip
GOODS: tuple[Colour, ...] = (
    (188, 150, 96), (150, 62, 48), (206, 196, 172), (78, 104, 76), (64, 84, 118), (120, 88, 60),
)  # fmt: skip
CLOTHS: tuple[Colour, ...] = (
    (222, 216, 200), (196, 184, 150), (160, 74, 64), (108, 126, 142), (206, 188, 120),
)  # fmt: skip
INTERIORS: tuple[Colour, ...] = ((96, 82, 62), (58, 60, 66), (112, 92, 66), (70, 58, 50))


def draw_window(
    canvas: Canvas, centre_m: float, sill_m: float, make: Template, rng: np.random.Generator
) -> None:
    """Draw one window: surround, reveal, glass, curtains, bars, sill, shutters."""
    window = make.window
    left, right = centre_m - window.width_m / 2, centre_m + window.width_m / 2
    top = sill_m + window.height_m
    _draw_surround(canvas, (left, sill_m, right, top), make)
    canvas.rect(left, sill_m, right, top, shaded(make.trim, 0.45))
    _draw_glass(canvas, (left + 0.05, sill_m + 0.04, right - 0.05, top - 0.09), window, rng)
    canvas.shade(left, top - 0.28, right, top, 0.6)
    if window.top != "flat":
        _round_top(canvas, (left, sill_m, right, top), make)
    canvas.raised(left - 0.13, sill_m - 0.14, right + 0.13, sill_m, shaded(make.trim, 1.02))
    if window.shutters is not None:
        _draw_shutters(canvas, (left, sill_m, right, top), window.shutters, rng)


def _draw_glass(
    canvas: Canvas, box: tuple[float, float, float, float], window: Window, rng: np.random.Generator
) -> None:
    left, bottom, right, top = box
    canvas.rect(left, bottom, right, top, window.frame)
    across, down = window.panes
    bar = 0.07 if across < 4 else 0.05
    wide, high = (right - left - bar) / across, (top - bottom - bar) / down
    for i in range(across):
        for j in range(down):
            colour = shaded(window.glass, 0.75 + 0.16 * j + rng.uniform(0, 0.5))
            x0, y0 = left + bar + i * wide, bottom + bar + j * high
            x1, y1 = x0 + wide - bar, y0 + high - bar
            canvas.rect(x0, y0, x1, y1, colour)
            if rng.random() < 0.35:
                glare = shaded(colour, 1.35)
                canvas.polygon(
                    [(x0, y1), (x0 + 0.45 * (x1 - x0), y1), (x0, y0 + 0.3 * (y1 - y0))], glare
                )
    _draw_household(canvas, box, rng)
    for i in range(across + 1):
        canvas.rect(left + i * wide, bottom, left + i * wide + bar, top, window.frame)
    for j in range(down + 1):
        canvas.rect(left, bottom + j * high, right, bottom + j * high + bar, window.frame)


def _draw_household(
    canvas: Canvas, box: tuple[float, float, float, float], rng: np.random.Generator
) -> None:
    """Draw what people put behind their panes: a blind, curtains, a plant, a lamp."""
    left, bottom, right, top = box
    kind, wide, high = int(rng.integers(7)), right - left, top - bottom
    cloth = shaded(CLOTHS[int(rng.integers(len(CLOTHS)))], rng.uniform(0.75, 1.1))
    if kind == 0:
        canvas.rect(left, top - rng.uniform(0.2, 0.75) * high, right, top, cloth)
    elif kind in (1, 2):
        part = rng.uniform(0.18, 0.42, 2) * wide
        tie = bottom + rng.uniform(0.2, 0.6) * high
        for edge, reach in ((left, float(part[0])), (right, -float(part[1]))):
            outline = [(edge, top), (edge + 1.4 * reach, top), (edge + 0.35 * reach, tie)]
            canvas.polygon([*outline, (edge + 0.8 * reach, bottom), (edge, bottom)], cloth)
    elif kind == 3:
        canvas.rect(left, bottom, right, bottom + rng.uniform(0.25, 0.55) * high, cloth)
    elif kind == 4:
        stem = rng.uniform(left + 0.2 * wide, right - 0.2 * wide)
        for _ in range(14):
            x, y = rng.normal(stem, 0.12 * wide), bottom + rng.uniform(0.15, 0.55) * high
            canvas.disc(
                float(np.clip(x, left + 0.06, right - 0.06)), y, (0.07, 0.05), (84, 120, 70)
            )
        canvas.rect(stem - 0.1, bottom, stem + 0.1, bottom + 0.15 * high, (170, 98, 66))


def _draw_surround(canvas: Canvas, box: tuple[float, float, float, float], make: Template) -> None:
    left, bottom, right, top = box
    kind, trim = make.window.surround, make.trim
    middle = (left + right) / 2
    if kind == "lintel":
        canvas.raised(left - 0.22, top, right + 0.22, top + 0.3, trim)
        return
    if kind == "none":
        return
    band = 0.2 if kind != "brick" else 0.26
    colour = trim if kind != "brick" else shaded(make.trim, 0.95)
    canvas.shade(left - band, bottom - 0.1, right + band + 0.06, top + band, 0.8)
    canvas.rect(left - band, bottom, right + band, top + band, colour)
    if kind == "brick":
        for step in range(int((top - bottom) / 0.3) + 1):
            y = bottom + 0.3 * step
            canvas.line((left - band, y), (left, y), 0.02, shaded(colour, 0.6))
            canvas.line((right, y), (right + band, y), 0.02, shaded(colour, 0.6))
    if kind in ("keystone", "pediment"):
        canvas.raised(left - band - 0.08, top + band, right + band + 0.08, top + band + 0.12, trim)
    if kind == "keystone":
        stone = [(middle - 0.1, top), (middle + 0.1, top)]
        stone += [(middle + 0.16, top + 0.34), (middle - 0.16, top + 0.34)]
        canvas.polygon(stone, shaded(trim, 1.1))
    if kind == "pediment":
        base, peak = top + band + 0.12, top + band + 0.6
        gable = [(left - band - 0.1, base), (right + band + 0.1, base), (middle, peak)]
        canvas.polygon(gable, shaded(trim, 0.7))
        inner = [(left - band + 0.14, base + 0.05), (right + band - 0.14, base + 0.05)]
        canvas.polygon([*inner, (middle, peak - 0.1)], shaded(trim, 1.04))


def _round_top(canvas: Canvas, box: tuple[float, float, float, float], make: Template) -> None:
    """Cover the upper corners, so that the opening ends in an arch."""
    left, _, right, top = box
    middle, half = (left + right) / 2, (right - left) / 2
    rise = half if make.window.top == "arch" else 0.45 * half
    angles = np.linspace(0, np.pi / 2, 9)
    for side in (-1, 1):
        arc = [
            (middle + side * half * float(np.cos(a)), top - rise + rise * float(np.sin(a)))
            for a in angles
        ]
        corner = (middle + side * half, top + 0.02)
        canvas.polygon([*arc, (middle, top + 0.02), corner], shaded(make.trim, 0.97))
        for start, end in pairwise(arc):
            canvas.line(start, end, 0.05, shaded(make.trim, 0.6))
    if make.window.surround == "brick":
        for angle in np.linspace(0.25, np.pi - 0.25, 9):
            cos, sin = float(np.cos(angle)), float(np.sin(angle))
            inner = (middle + half * cos, top - rise + rise * sin)
            outer = (middle + (half + 0.22) * cos, top - rise + (rise + 0.22) * sin)
            canvas.line(inner, outer, 0.02, shaded(make.trim, 0.6))


def _draw_shutters(
    canvas: Canvas,
    box: tuple[float, float, float, float],
    colour: Colour,
    rng: np.random.Generator,
) -> None:
    left, bottom, right, top = box
    half = (right - left) / 2
    shut = rng.random() < 0.14
    places = (left, left + half) if shut else (left - half - 0.06, right + 0.06)
    for place in places:
        canvas.shade(place, bottom - 0.1, place + half + 0.09, top, 0.7)
        canvas.rect(place, bottom, place + half, top, colour)
        for slat in np.arange(bottom + 0.12, top - 0.1, 0.11):
            canvas.line(
                (place + 0.07, slat), (place + half - 0.07, slat), 0.03, shaded(colour, 0.68)
            )
        canvas.rect(place, (bottom + top) / 2, place + half, (bottom + top) / 2 + 0.09, colour)


def draw_door(
    canvas: Canvas, centre_m: float, height_m: float, make: Template, rng: np.random.Generator
) -> None:
    """Draw a panelled double door with a fanlight and a step."""
    left, right = centre_m - 0.75, centre_m + 0.75
    colour = shaded(make.accent, rng.uniform(0.85, 1.25))
    canvas.raised(left - 0.25, 0.0, right + 0.25, height_m + 0.3, make.trim)
    canvas.rect(left, 0.1, right, height_m, shaded(colour, 0.55))
    canvas.rect(left + 0.08, height_m - 0.62, right - 0.08, height_m - 0.08, (58, 66, 70))
    for spoke in np.linspace(left + 0.3, right - 0.3, 4):
        canvas.line((spoke, height_m - 0.62), (centre_m, height_m - 0.08), 0.03, (24, 24, 24))
    for side in (left + 0.06, centre_m + 0.03):
        canvas.rect(side, 0.12, side + 0.66, height_m - 0.7, colour)
        for low, high in ((0.25, 0.85), (0.98, height_m - 0.85)):
            canvas.rect(side + 0.1, low, side + 0.56, high, shaded(colour, 0.74))
            canvas.rect(side + 0.14, low + 0.05, side + 0.56, high, shaded(colour, 1.12))
    canvas.disc(centre_m + 0.1, 1.15, (0.035, 0.035), (206, 172, 88))
    canvas.rect(left - 0.2, 0.0, right + 0.2, 0.12, GRANITE)


GRANITE: Colour = (150, 148, 142)


def draw_shop(
    canvas: Canvas,
    span: tuple[float, float],
    height_m: float,
    make: Template,
    rng: np.random.Generator,
) -> None:
    """Draw a wooden shop front with its window, goods and sign board."""
    left, right = span
    colour = shaded(make.accent, rng.uniform(0.75, 1.5))
    board = height_m - 0.75
    canvas.rect(left, 0.0, right, height_m - 0.1, colour)
    canvas.rect(left + 0.12, 0.75, right - 0.12, board - 0.12, (38, 40, 42))
    inside = INTERIORS[int(rng.integers(len(INTERIORS)))]
    canvas.rect(left + 0.2, 0.83, right - 0.2, board - 0.2, inside)
    _draw_goods(canvas, (left + 0.25, right - 0.25), board - 0.3, rng)
    n_panes = max(2, round((right - left) / 1.3))
    for x in np.linspace(left + 0.16, right - 0.16, n_panes + 1):
        canvas.rect(x - 0.05, 0.75, x + 0.05, board - 0.1, shaded(colour, 0.8))
    for x in np.linspace(left + 0.16, right - 0.16, n_panes + 1)[:-1]:
        wide = (right - left - 0.32) / n_panes
        canvas.rect(x + 0.15, 0.14, x + wide - 0.1, 0.62, shaded(colour, 0.75))
    canvas.raised(left - 0.05, board, right + 0.05, height_m - 0.05, shaded(colour, 0.9))
    word = SIGNS[int(rng.integers(len(SIGNS)))]
    ink = [(236, 222, 176), (240, 240, 236), (222, 186, 92)][int(rng.integers(3))]
    canvas.text(word, (left + 0.3, board + 0.16, right - 0.3, height_m - 0.2), ink)


def _draw_goods(
    canvas: Canvas, span: tuple[float, float], top_m: float, rng: np.random.Generator
) -> None:
    for shelf in (0.9, 1.5, 2.1):
        if shelf + 0.5 > top_m:
            break
        canvas.rect(span[0], shelf, span[1], shelf + 0.04, (128, 104, 76))
        place = span[0] + 0.1
        while place < span[1] - 0.4:
            wide, high = rng.uniform(0.12, 0.4), rng.uniform(0.12, 0.45)
            colour = shaded(GOODS[int(rng.integers(len(GOODS)))], rng.uniform(0.6, 1.2))
            canvas.rect(place, shelf + 0.04, place + wide, shelf + high, colour)
            place += wide + rng.uniform(0.02, 0.3)
