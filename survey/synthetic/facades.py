"""A house front from its template: what copies share, and the small things that differ."""

from dataclasses import dataclass

import cv2
import numpy as np

from survey.synthetic import materials
from survey.synthetic.canvas import PX_PER_M, Canvas, Rgb, px, shaded
from survey.synthetic.details import (
    IRON,
    draw_bars,
    draw_board,
    draw_extras,
    draw_frieze,
    draw_ivy,
)
from survey.synthetic.openings import GRANITE, draw_door, draw_shop, draw_window
from survey.synthetic.templates import Template

# How often a copy has what its sisters have not; more of it makes houses easier to tell apart.
FRIEZE_SHARE = 0.7
BOARD_SHARE = 0.6
IVY_SHARE = 0.3
BLIND_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class Relief:
    """Something in front of the wall: a balcony, an awning.

    left_m, bottom_m : its place on the wall. depth_m : how far out it hangs.
    rgba : (h, w, 4) uint8 at `canvas.PX_PER_M`.
    """

    left_m: float
    bottom_m: float
    depth_m: float
    rgba: Rgb


@dataclass(frozen=True, slots=True)
class FacadeSkin:
    """A painted facade. wall : (H, W, 3) uint8 RGB at `canvas.PX_PER_M`."""

    wall: Rgb
    reliefs: tuple[Relief, ...]


def paint_facade(make: Template, width_m: float, seed: int) -> FacadeSkin:
    """Paint one copy of a template.

    The layout comes from the template alone; the seed decides tint, stains, curtains, shutters,
    blind windows, the door's place, ironwork, frieze, boards, signs, awnings, pipe and plants.
    """
    rng = np.random.default_rng(seed)
    tint = rng.uniform(0.93, 1.07) * rng.uniform(0.985, 1.015, 3)
    canvas = Canvas(_wall(make, width_m, rng))
    lights = [make.ground_m + floor * make.floor_m for floor in range(make.floors)]
    bay = (width_m - 0.8) / make.bays
    centres = [0.4 + bay * (index + 0.5) for index in range(make.bays)]
    _draw_mouldings(canvas, make, lights)
    if rng.random() < FRIEZE_SHARE:
        draw_frieze(canvas, make, lights[int(rng.integers(make.floors))], rng)
    blind = rng.random((make.floors, make.bays)) < BLIND_SHARE
    ironwork = int(rng.integers(4))
    for floor, level in enumerate(lights):
        sill = level + min(0.75, make.floor_m - make.window.height_m - 0.45)
        for index, centre in enumerate(centres):
            if blind[floor, index] and make.window.width_m < 2:
                _draw_blind(canvas, centre, sill, make)
            else:
                draw_window(canvas, centre, sill, make, rng)
    awning = _draw_ground(canvas, make, centres, rng)
    _draw_roof(canvas, make, centres, rng)
    if rng.random() < BOARD_SHARE:
        draw_board(canvas, make, lights[int(rng.integers(min(2, make.floors)))], rng)
    if rng.random() < IVY_SHARE:
        draw_ivy(canvas, make, rng)
    draw_extras(canvas, make, rng)
    _weather(canvas, tint, rng)
    reliefs = [_balcony(make, width_m, lights[floor - 1], ironwork) for floor in make.balconies]
    for floor in make.railed:
        reliefs += [_railing(make, centre, lights[floor - 1], ironwork, rng) for centre in centres]
    return FacadeSkin(canvas.pixels, tuple(reliefs + awning))


def _wall(make: Template, width_m: float, rng: np.random.Generator) -> Rgb:
    shape = (px(make.height_m), px(width_m))
    tone = materials.grain(shape, rng)
    if make.wall == "ashlar":
        tone = tone + materials.courses(shape, (0.9, 0.36), (0.02, -0.22), 0.035, rng)
    elif make.wall == "brick":
        tone = tone + materials.courses(shape, (0.24, 0.075), (0.012, 0.2), 0.1, rng)
    elif make.wall == "tiles":
        tone = tone + materials.courses(shape, (0.3, 0.3), (0.015, -0.3), 0.1, rng)
    elif make.wall == "rubble":
        tone = tone + materials.rubble(shape, 0.34, rng)
    pixels = materials.coloured(tone, make.colour)
    if make.wall == "stucco":
        materials.cracks(pixels, 5, shaded(make.colour, 0.66), rng)
    if make.wall == "timber":
        _draw_beams(Canvas(pixels), make)
    return pixels


def _draw_beams(canvas: Canvas, make: Template) -> None:
    wood, width = make.trim, canvas.width_m
    for floor in range(make.floors):
        low = make.ground_m + floor * make.floor_m
        high = low + make.floor_m
        step = width / make.bays
        for index in range(make.bays + 1):
            x = index * step
            canvas.line((x, low), (x, high), 0.2, wood)
            if index < make.bays and floor != 1:
                slant = 0.42 if (index + floor) % 2 else -0.42
                canvas.line(
                    (x + step / 2 - slant, low), (x + step / 2 + slant, low + 0.8), 0.14, wood
                )
                canvas.line(
                    (x + step / 2 + slant, low), (x + step / 2 - slant, low + 0.8), 0.14, wood
                )
        canvas.line((0, low + 0.82), (width, low + 0.82), 0.14, wood)
        canvas.rect(0, high - 0.28, width, high, shaded(wood, 1.12))


def _draw_mouldings(canvas: Canvas, make: Template, lights: list[float]) -> None:
    width = canvas.width_m
    if make.wall == "timber":
        return
    for level in lights:
        canvas.raised(0, level - 0.22, width, level, make.trim)
    if make.wall in ("ashlar", "brick"):
        for step in range(int((make.height_m - make.roof_m) / 0.36)):
            wide = 0.5 if step % 2 else 0.34
            for left in (0.0, width - wide):
                low = step * 0.36
                canvas.rect(left, low + 0.02, left + wide, low + 0.34, shaded(make.trim, 0.97))


def _draw_blind(canvas: Canvas, centre: float, sill: float, make: Template) -> None:
    """A walled-up window: its shape remains."""
    half, top = make.window.width_m / 2, sill + make.window.height_m
    canvas.rect(centre - half - 0.12, sill - 0.1, centre + half + 0.12, top + 0.12, make.trim)
    canvas.rect(centre - half, sill, centre + half, top, shaded(make.colour, 0.86))
    canvas.shade(centre - half, top - 0.12, centre + half, top, 0.7)


def _draw_ground(
    canvas: Canvas, make: Template, centres: list[float], rng: np.random.Generator
) -> list[Relief]:
    """Draw the ground floor; returns the awnings over it."""
    door = int(rng.integers(make.bays))
    top = make.ground_m - 0.35
    half = (centres[1] - centres[0]) / 2
    if make.ground in ("rustic", "arcade"):
        for row in range(int(make.ground_m / 0.45)):
            canvas.shade(0, row * 0.45, canvas.width_m, row * 0.45 + 0.05, 0.62)
    if make.ground == "shop":
        draw_door(canvas, centres[door], min(top, 3.1), make, rng)
        spans = [
            (centres[0] - half, centres[door] - 1.1),
            (centres[door] + 1.1, centres[-1] + half),
        ]
        shops = [span for span in spans if span[1] - span[0] > 1.6]
        for span in shops:
            draw_shop(canvas, span, top, make, rng)
        return [_awning(span, top - 0.7, make, rng) for span in shops if rng.random() < 0.45]
    for index, centre in enumerate(centres):
        if index == door:
            draw_door(canvas, centre, 3.0, make, rng)
        elif make.ground == "arcade":
            _draw_arch(canvas, centre, min(half * 0.72, 1.25), top, make)
        elif make.ground == "garage":
            _draw_gate(canvas, centre, half * 0.8, 3.3, make)
        else:
            draw_window(canvas, centre, 1.05, make, rng)
    canvas.rect(0, 0, canvas.width_m, 0.3, shaded(GRANITE, 0.8))
    return []


def _draw_arch(canvas: Canvas, centre: float, half: float, top: float, make: Template) -> None:
    spring = top - 0.2 - half
    for grow, colour in ((0.22, make.trim), (0.0, (46, 44, 44))):
        canvas.disc(centre, spring, (half + grow, half + grow), colour, arc=True)
        canvas.rect(centre - half - grow, 0, centre + half + grow, spring, colour)
    for x in np.linspace(centre - half, centre + half, 5)[1:-1]:
        canvas.line((x, 0.1), (x, spring), 0.06, shaded(make.accent, 1.3))
    canvas.rect(centre - half, spring - 0.1, centre + half, spring, shaded(make.accent, 1.3))


def _draw_gate(canvas: Canvas, centre: float, half: float, top: float, make: Template) -> None:
    canvas.raised(centre - half - 0.15, 0, centre + half + 0.15, top + 0.25, make.trim)
    canvas.rect(centre - half, 0, centre + half, top, make.accent)
    for x in np.arange(centre - half, centre + half, 0.22):
        canvas.line((x, 0), (x, top), 0.03, shaded(make.accent, 0.6))
    canvas.rect(centre - half + 0.2, top - 0.8, centre + half - 0.2, top - 0.25, (60, 68, 72))
    canvas.rect(centre - 0.03, 0, centre + 0.03, top, shaded(make.accent, 0.4))


def _draw_roof(
    canvas: Canvas, make: Template, centres: list[float], rng: np.random.Generator
) -> None:
    base, top, width = make.height_m - make.roof_m, canvas.height_m, canvas.width_m
    cornice = base + 0.35
    if make.roof in ("mansard", "tiles"):
        area = canvas.view(0, base, width, top + 1)
        colour = (92, 98, 108) if make.roof == "mansard" else (164, 92, 66)
        area[:] = materials.slates((area.shape[0], area.shape[1]), colour, rng)
        if make.roof_m > 2.2:
            for centre in centres[:: 1 if make.roof == "mansard" else 2]:
                canvas.raised(centre - 0.62, cornice, centre + 0.62, cornice + 1.75, make.trim)
                canvas.rect(
                    centre - 0.42, cornice + 0.15, centre + 0.42, cornice + 1.5, (52, 60, 68)
                )
                canvas.rect(
                    centre - 0.03, cornice + 0.15, centre + 0.03, cornice + 1.5, (220, 218, 208)
                )
                canvas.rect(
                    centre - 0.42, cornice + 0.8, centre + 0.42, cornice + 0.85, (220, 218, 208)
                )
    if make.roof == "parapet":
        for x in np.arange(0.15, width, 0.3):
            canvas.rect(x, cornice, x + 0.15, top - 0.25, shaded(make.trim, 0.66))
        canvas.raised(0, top - 0.25, width, top, make.trim)
    canvas.raised(0, base, width, cornice, make.trim)
    for x in np.arange(0.1, width, 0.42):
        canvas.rect(x, base - 0.2, x + 0.2, base, shaded(make.trim, 0.82))


def _weather(canvas: Canvas, tint: np.ndarray, rng: np.random.Generator) -> None:
    shape = canvas.pixels.shape[:2]
    tone = materials.stains(shape, 10, rng) + materials.noise(shape, 60, rng) * 0.03
    climb = np.linspace(0, 1, shape[0], dtype=np.float32)[:, None] ** 6
    tone -= 0.16 * climb
    for channel in range(3):
        gain = np.asarray((1.0 + tone) * np.float32(tint[channel]), dtype=np.float32)
        plane = np.ascontiguousarray(canvas.pixels[..., channel])
        canvas.pixels[..., channel] = cv2.multiply(plane, gain, dtype=cv2.CV_8U)


def _bars(width_m: float, height_m: float, pattern: int) -> Canvas:
    canvas = Canvas(np.zeros((px(height_m), px(width_m), 4), dtype=np.uint8))
    canvas.pixels[..., :3] = IRON
    draw_bars(canvas, pattern)
    return canvas


def _balcony(make: Template, width_m: float, level_m: float, ironwork: int) -> Relief:
    """A balcony along the whole front: slab, consoles below, railing."""
    canvas = Canvas(np.zeros((px(1.45), px(width_m - 0.6), 4), dtype=np.uint8))
    rail = _bars(width_m - 0.6, 0.95, ironwork)
    canvas.pixels[: rail.pixels.shape[0]] = rail.pixels
    canvas.rect(0, 0.3, canvas.width_m, 0.52, make.trim)
    canvas.rect(0, 0.3, canvas.width_m, 0.36, shaded(make.trim, 0.6))
    for x in np.arange(0.3, canvas.width_m, make.bay_m / 2):
        canvas.rect(x, 0.0, x + 0.22, 0.3, shaded(make.trim, 0.75))
    return Relief(0.3, level_m - 0.42, 0.6, canvas.pixels)


def _railing(
    make: Template, centre: float, level_m: float, ironwork: int, rng: np.random.Generator
) -> Relief:
    """A guard rail of one window, sometimes with flowers."""
    width = make.window.width_m + 0.2
    canvas = _bars(width, 0.85, ironwork)
    if rng.random() < 0.2:
        for _ in range(60):
            x, y = rng.uniform(0.05, width - 0.05), rng.uniform(0.1, 0.5)
            bloom = (188, 44, 52) if rng.random() < 0.3 else (58, int(rng.integers(80, 140)), 48)
            canvas.disc(float(x), float(y), (0.06, 0.06), bloom)
    sill = level_m + min(0.75, make.floor_m - make.window.height_m - 0.45)
    return Relief(centre - width / 2, sill - 0.05, 0.22, canvas.pixels)


def _awning(
    span: tuple[float, float], top_m: float, make: Template, rng: np.random.Generator
) -> Relief:
    width = span[1] - span[0]
    colour = shaded(make.accent, rng.uniform(1.2, 2.0))
    rgba = np.full((px(0.8), px(width), 4), 255, dtype=np.uint8)
    rgba[..., :3] = materials.cloth((px(0.8), px(width)), colour, (226, 220, 204), 0.3)
    scallop = np.abs(np.sin(np.arange(rgba.shape[1]) / (0.3 * PX_PER_M) * np.pi))
    cut = np.arange(rgba.shape[0])[::-1, None] < (1 - scallop) * 0.14 * PX_PER_M
    rgba[cut, 3] = 0
    return Relief(span[0], top_m - 0.75, 0.9, rgba)
