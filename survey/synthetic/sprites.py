"""Pictures that are no houses: road, sky, trees, lamps, cars."""

import cv2
import numpy as np

from survey.synthetic import materials
from survey.synthetic.canvas import Canvas, Colour, Rgb, px, shaded
from survey.synthetic.street import Sort

ROAD_SECTION_M = 16.0
SIZES_M: dict[Sort, tuple[float, float]] = {
    "tree": (5.0, 7.5),
    "lamp": (1.2, 5.2),
    "car": (4.3, 1.5),
}
"""Width and height of a thing at the kerb."""
_PAINTS: tuple[Colour, ...] = ((52, 62, 84), (146, 30, 30), (196, 198, 198), (40, 42, 44))
_LEAVES: tuple[Colour, ...] = ((62, 86, 40), (78, 104, 48), (98, 122, 58), (48, 70, 36))


def paint_road(width_m: float, rng: np.random.Generator) -> Rgb:
    """A section of street seen from above: (H, W, 3), W along the street, H across it."""
    shape = (px(width_m), px(ROAD_SECTION_M))
    road = Canvas(materials.coloured(materials.grain(shape, rng) * 1.6, (104, 104, 106)))
    slab_tone = materials.courses(shape, (0.9, 0.6), (0.02, -0.25), 0.04, rng)
    slabs = materials.coloured(slab_tone + materials.grain(shape, rng), (168, 164, 156))
    for low, high in ((0.0, 2.2), (width_m - 2.2, width_m)):
        road.view(0, low, ROAD_SECTION_M, high)[:] = Canvas(slabs).view(
            0, low, ROAD_SECTION_M, high
        )
    for kerb in (2.2, width_m - 2.4):
        road.raised(0, kerb, ROAD_SECTION_M, kerb + 0.2, (188, 186, 180))
    for left in np.arange(0.5, ROAD_SECTION_M, 4.0):
        road.rect(left, width_m / 2 - 0.06, left + 2.0, width_m / 2 + 0.06, (206, 206, 200))
    for _ in range(3):
        x, y = rng.uniform(1, ROAD_SECTION_M - 1), rng.uniform(3, width_m - 3)
        road.disc(x, y, (0.35, 0.35), (72, 70, 68))
        road.shade(x + 0.8, y - 0.6, x + 3.0, y + 0.5, 0.86)
    return road.pixels


def paint_sky(rng: np.random.Generator, cover: float) -> Rgb:
    """A panorama (256, 2048, 3): top row the zenith, bottom row the horizon; wraps around.

    cover : the share of cloud, 0 to 1.
    """
    shape = (256, 2048)
    clouds = sum(
        materials.noise(shape, cell, rng) * np.float32(weight)
        for cell, weight in ((150, 1.0), (60, 0.6), (24, 0.35), (9, 0.18))
    )
    cloud = np.asarray(clouds, dtype=np.float32)
    # The seam is hidden by fading the right end into the left one.
    fade = np.linspace(0, 1, 200, dtype=np.float32)
    cloud[:, -200:] = cloud[:, -200:] * (1 - fade) + cloud[:, :200][:, ::-1] * fade
    amount = np.clip((cloud + (cover - 0.5) * 2.4) * 0.9, 0, 1)[..., None]
    depth = np.linspace(0, 1, shape[0], dtype=np.float32)[:, None, None] ** 0.8
    blue = np.array((92, 138, 196)) * (1 - depth) + np.array((196, 212, 226)) * depth
    white = np.array((238, 238, 236)) - 30 * np.clip(cloud - 0.7, 0, 1)[..., None]
    return np.asarray(blue * (1 - amount) + white * amount, dtype=np.uint8)


def paint_sprite(sort: Sort, variant: int, rng: np.random.Generator) -> Rgb:
    """A thing at the kerb, (h, w, 4) RGBA at `canvas.PX_PER_M`."""
    width, height = SIZES_M[sort]
    canvas = Canvas(np.zeros((px(height), px(width), 4), dtype=np.uint8))
    if sort == "tree":
        _draw_tree(canvas, rng)
    elif sort == "lamp":
        _draw_lamp(canvas)
    else:
        _draw_car(canvas, _PAINTS[variant % len(_PAINTS)])
    return canvas.pixels


def _draw_tree(canvas: Canvas, rng: np.random.Generator) -> None:
    bark = (78, 66, 54)
    canvas.line((2.5, 0), (2.5, 4.5), 0.26, bark)
    for tip in ((1.3, 5.0), (3.6, 5.3), (2.2, 6.2)):
        canvas.line((2.5, 2.9), tip, 0.12, bark)
    for _ in range(620):
        angle, reach = rng.uniform(0, 2 * np.pi), np.sqrt(rng.uniform(0, 1))
        x, y = 2.5 + 2.2 * reach * np.cos(angle), 5.0 + 2.2 * reach * np.sin(angle)
        light = 0.7 + 0.09 * (y - 2.8) - 0.05 * (x - 2.5) + rng.uniform(-0.1, 0.1)
        leaf = shaded(_LEAVES[int(rng.integers(4))], float(light))
        canvas.disc(float(x), float(y), (0.16, 0.1), leaf)


def _draw_lamp(canvas: Canvas) -> None:
    iron = (36, 48, 44)
    canvas.line((0.6, 0), (0.6, 4.3), 0.1, iron)
    canvas.line((0.6, 0), (0.6, 0.9), 0.2, iron)
    canvas.polygon([(0.42, 4.35), (0.78, 4.35), (0.88, 4.95), (0.32, 4.95)], (222, 218, 196))
    canvas.polygon([(0.28, 4.95), (0.92, 4.95), (0.6, 5.2)], iron)
    for x in (0.36, 0.6, 0.84):
        canvas.line((0.6 + 0.6 * (x - 0.6), 4.35), (x, 4.95), 0.03, iron)


def _draw_car(canvas: Canvas, paint: Colour) -> None:
    body = [(0.1, 0.35), (4.2, 0.35), (4.2, 0.75), (3.9, 0.92), (0.35, 0.95), (0.1, 0.7)]
    cabin = [(0.7, 0.9), (3.4, 0.9), (2.8, 1.42), (1.2, 1.45)]
    canvas.polygon(cabin, paint)
    canvas.polygon([(0.9, 0.92), (2.0, 0.92), (2.0, 1.36), (1.25, 1.37)], (58, 66, 72))
    canvas.polygon([(2.1, 0.92), (3.2, 0.92), (2.75, 1.34), (2.1, 1.36)], (66, 76, 84))
    canvas.polygon(body, shaded(paint, 0.95))
    canvas.line((0.15, 0.8), (4.0, 0.8), 0.03, shaded(paint, 1.4))
    canvas.line((2.05, 0.4), (2.05, 0.9), 0.02, shaded(paint, 0.6))
    canvas.rect(0.1, 0.3, 4.2, 0.4, (36, 36, 36))
    for wheel in (0.9, 3.35):
        canvas.disc(wheel, 0.32, (0.32, 0.32), (26, 26, 28))
        canvas.disc(wheel, 0.32, (0.17, 0.17), (150, 152, 154))
    canvas.rect(4.08, 0.62, 4.2, 0.76, (232, 226, 200))


def shrink(texture: Rgb) -> tuple[Rgb, ...]:
    """A texture and its halvings, down to 4 pixels, for drawing far things without shimmer."""
    levels = [texture]
    while min(levels[-1].shape[:2]) >= 8:
        height, width = levels[-1].shape[:2]
        smaller = cv2.resize(levels[-1], (width // 2, height // 2), interpolation=cv2.INTER_AREA)
        levels.append(np.asarray(smaller, dtype=np.uint8))
    return tuple(levels)


def premultiplied(rgba: Rgb) -> Rgb:
    """Colours multiplied by their alpha, so that shrinking mixes them rightly."""
    alpha = rgba[..., 3:].astype(np.uint16)
    colours = (rgba[..., :3] * alpha // 255).astype(np.uint8)
    return np.dstack([colours, rgba[..., 3:]])
