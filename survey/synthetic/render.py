"""Draw the town as a camera sees it: far to near, each panel by its homography."""

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from survey.synthetic import sprites
from survey.synthetic.camera import NEAR_M, Floats, Lens, Panel, View, fill_mask
from survey.synthetic.canvas import PX_PER_M, Rgb
from survey.synthetic.facades import paint_facade
from survey.synthetic.sprites import ROAD_SECTION_M, SIZES_M
from survey.synthetic.street import UP, Facade, Furniture, Sort, StreetPlan, furnish, lay_out

SUPERSAMPLE = 1.5
"""Pictures are drawn this much larger and reduced: it smooths all edges."""
_STRIP_M = 4.0
"""Panels are drawn in strips of this width, each from the texture level that fits its distance."""
_SUN = np.array([0.55, -0.8, 0.0])
_HAZE = (186, 190, 194)
_ASPHALT = (108, 108, 110)


@dataclass(frozen=True, slots=True)
class Decal:
    """A panel and its texture levels, RGB, or RGBA premultiplied."""

    panel: Panel
    levels: tuple[Rgb, ...]


@dataclass(frozen=True, slots=True)
class House:
    """A facade ready to be drawn: wall and what hangs on it."""

    facade: Facade
    wall: Decal
    reliefs: tuple[Decal, ...]


@dataclass(frozen=True, slots=True)
class Town:
    """All that can be seen."""

    plan: StreetPlan
    houses: tuple[House, ...]
    road: tuple[Decal, ...]
    furniture: tuple[Furniture, ...]
    sprites: dict[tuple[Sort, int], tuple[Rgb, ...]]
    skies: tuple[Rgb, ...]


def build_town(plan: StreetPlan, seed: int) -> Town:
    """Lay out the streets and paint every texture; the same seed gives the same town."""
    rng = np.random.default_rng([seed, 3])
    houses = tuple(_build_house(facade) for facade in lay_out(plan, seed))
    tile = sprites.shrink(sprites.paint_road(plan.width_m, rng))
    road = tuple(Decal(panel, tile) for panel in _road_panels(plan))
    sorts: tuple[Sort, ...] = ("tree", "lamp", "car")
    looks = {
        (sort, variant): sprites.shrink(
            sprites.premultiplied(sprites.paint_sprite(sort, variant, rng))
        )
        for sort in sorts
        for variant in range(4)
    }
    skies = tuple(sprites.paint_sky(rng, cover) for cover in (0.35, 0.75))
    return Town(plan, houses, road, furnish(plan, seed), looks, skies)


def _build_house(facade: Facade) -> House:
    panel = facade.panel
    skin = paint_facade(facade.template, panel.width_m, facade.seed)
    light = 0.94 + 0.14 * float(facade.outward @ _SUN)
    wall = cv2.convertScaleAbs(skin.wall, alpha=light)
    reliefs = []
    for relief in skin.reliefs:
        height, width = (side / PX_PER_M for side in relief.rgba.shape[:2])
        corner = panel.point(relief.left_m, relief.bottom_m) + relief.depth_m * facade.outward
        place = Panel(corner, panel.along, UP, width, height)
        reliefs.append(Decal(place, sprites.shrink(sprites.premultiplied(relief.rgba))))
    levels = sprites.shrink(np.asarray(wall, dtype=np.uint8))
    return House(facade, Decal(panel, levels), tuple(reliefs))


def _road_panels(plan: StreetPlan) -> list[Panel]:
    panels = []
    for start, end in plan.edges(plan.width_m / 2):
        length = float(np.linalg.norm(end - start))
        ahead = np.array([*((end - start) / length), 0.0])
        left = np.array([-ahead[1], ahead[0], 0.0])
        count = int(np.ceil(length / ROAD_SECTION_M))
        step = length / count
        for index in range(count):
            origin = np.array([*start, plan.ground_m]) + index * step * ahead
            panels.append(Panel(origin, ahead, left, step, plan.width_m))
    return panels


def render(town: Town, view: View, *, sky: int = 0, cars: bool = True) -> Rgb:
    """The picture of a view, (height_px, width_px, 3) uint8 RGB.

    sky : which of the town's skies. cars : whether the parked cars are there.
    """
    lens = Lens.of(view, SUPERSAMPLE)
    picture = _draw_sky(town.skies[sky], lens, view)
    for section in _by_distance(town.road, lens):
        _draw(picture, lens, section)
    for house in facing(town, view):
        _draw(picture, lens, house.wall)
        for relief in house.reliefs:
            _draw(picture, lens, relief)
    for thing in _standing(town, lens, cars):
        _draw(picture, lens, thing)
    size = (view.width_px, view.height_px)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def facing(town: Town, view: View) -> list[House]:
    """The houses that turn their front to the camera, in the order of drawing.

    The loop's inner block is convex and lies between the camera and all other houses that it
    covers, so the outer houses come first; within a ring, fronts hide nothing of each other.
    """
    turned = [
        h for h in town.houses if (view.centre - h.facade.panel.origin) @ h.facade.outward > 0
    ]
    return sorted(
        turned,
        key=lambda h: (h.facade.inner, -float(np.linalg.norm(h.facade.middle - view.centre))),
    )


def shares_seen(town: Town, view: View) -> dict[str, tuple[float, float]]:
    """For every facade in the picture: the share of the picture it fills, and its offset.

    The offset is the distance of its visible part's centre from the picture's, in picture widths.
    """
    lens = Lens.of(view, 0.25)
    labels = np.zeros((lens.height_px, lens.width_px), dtype=np.int32)
    order = facing(town, view)
    for label, house in enumerate(order, start=1):
        panel = house.facade.panel
        homography = lens.from_panel(panel)
        outline = lens.outline(homography, (0, 0, panel.width_m, panel.height_m))
        if len(outline):
            labels[fill_mask(outline, labels.shape) > 0] = label
    seen = {}
    middle = np.array([lens.width_px - 1, lens.height_px - 1]) / 2
    for label in np.unique(labels[labels > 0]):
        rows, cols = np.nonzero(labels == label)
        offset = np.hypot(cols.mean() - middle[0], rows.mean() - middle[1]) / lens.width_px
        seen[order[label - 1].facade.name] = (len(rows) / labels.size, float(offset))
    return seen


def _by_distance(decals: tuple[Decal, ...], lens: Lens) -> list[Decal]:
    def distance(decal: Decal) -> float:
        middle = decal.panel.point(decal.panel.width_m / 2, decal.panel.height_m / 2)
        return float(np.linalg.norm(middle - lens.centre))

    return sorted(decals, key=distance, reverse=True)


def _standing(town: Town, lens: Lens, cars: bool) -> list[Decal]:
    """Furniture as panels, far to near, without what the inner block hides."""
    decals = []
    block = town.plan.edges(-town.plan.width_m / 2)
    for thing in town.furniture:
        depth = float(lens.matrix[2] @ (thing.foot - lens.centre))
        if (thing.sort == "car" and not cars) or depth < NEAR_M:
            continue
        if _hidden(block, lens.centre, thing.foot):
            continue
        width, height = SIZES_M[thing.sort]
        along = thing.along
        if thing.sort != "car":
            towards = thing.foot - lens.centre
            along = np.array([towards[1], -towards[0], 0.0])
            along /= max(float(np.linalg.norm(along)), 1e-9)
        panel = Panel(thing.foot - along * width / 2, along, UP, width, height)
        decals.append(Decal(panel, town.sprites[thing.sort, thing.variant]))
    return _by_distance(tuple(decals), lens)


def _hidden(block: list[tuple[Floats, Floats]], eye: Floats, foot: Floats) -> bool:
    """Whether a convex block, given by its sides, stands on the line from eye to foot."""
    enters, leaves = 0.0, 1.0
    for start, end in block:
        outwards = np.array([end[1] - start[1], start[0] - end[0]])
        before, after = float(outwards @ (eye[:2] - start)), float(outwards @ (foot[:2] - start))
        if before > 0 and after > 0:
            return False
        if before > 0:
            enters = max(enters, before / (before - after))
        elif after > 0:
            leaves = min(leaves, before / (before - after))
    return enters < leaves


def _draw(picture: Rgb, lens: Lens, decal: Decal) -> None:
    panel = decal.panel
    homography = lens.from_panel(panel)
    whole = lens.outline(homography, (0.0, 0.0, panel.width_m, panel.height_m))
    if not len(whole) or _window(whole, picture) is None:
        return
    wide = float(np.ptp(whole[:, 0])) > 150
    n_strips = max(1, round(panel.width_m / _STRIP_M)) if wide else 1
    edges = np.linspace(0, panel.width_m, n_strips + 1)
    for left, right in pairwise(edges):
        span = (float(left), 0.0, float(right), panel.height_m)
        _draw_strip(picture, lens, homography, span, decal)


def _window(outline: Floats, picture: Rgb) -> tuple[int, int, int, int] | None:
    """The part of the picture (x0, y0, x1, y1) that an outline touches."""
    low, high = np.floor(outline.min(axis=0)), np.ceil(outline.max(axis=0)) + 1
    x0, y0 = max(0, int(low[0])), max(0, int(low[1]))
    x1, y1 = min(picture.shape[1], int(high[0])), min(picture.shape[0], int(high[1]))
    return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None


def _draw_strip(
    picture: Rgb,
    lens: Lens,
    homography: Floats,
    span: tuple[float, float, float, float],
    decal: Decal,
) -> None:
    outline = lens.outline(homography, span)
    window = _window(outline, picture) if len(outline) else None
    if window is None:
        return
    x0, y0, x1, y1 = window
    panel = decal.panel
    texture = _level(decal.levels, homography, span, panel)
    rows, cols = texture.shape[:2]
    to_texture = np.array(
        [
            [cols / panel.width_m, 0, -0.5],
            [0, -rows / panel.height_m, rows - 0.5],
            [0, 0, 1],
        ]
    )
    shift = np.array([[1, 0, x0], [0, 1, y0], [0, 0, 1.0]])
    inverse = to_texture @ np.linalg.inv(homography) @ shift
    mode = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    drawn = cv2.warpPerspective(
        texture, inverse, (x1 - x0, y1 - y0), flags=mode, borderMode=cv2.BORDER_REPLICATE
    )
    mask = fill_mask(outline - (x0, y0), (y1 - y0, x1 - x0))
    area = picture[y0:y1, x0:x1]
    if texture.shape[2] == 3:
        cv2.copyTo(drawn, mask, area)
        return
    front = cv2.bitwise_and(drawn, drawn, mask=mask)
    through = cv2.cvtColor(255 - front[..., 3], cv2.COLOR_GRAY2BGR)
    behind = cv2.multiply(area, through, scale=1 / 255)
    area[:] = cv2.add(behind, np.ascontiguousarray(front[..., :3]))


def _level(
    levels: tuple[Rgb, ...],
    homography: Floats,
    span: tuple[float, float, float, float],
    panel: Panel,
) -> Rgb:
    """The texture level whose pixels are about the picture's, at the middle of a strip."""
    across, up = (span[0] + span[2]) / 2, (span[1] + span[3]) / 2
    ray = homography @ np.array([across, up, 1.0])
    if ray[2] <= 0.5:
        return levels[0]
    here = ray[:2] / ray[2]
    scale = [
        float(np.hypot(*(homography[:2, axis] - here * homography[2, axis]))) / ray[2]
        for axis in (0, 1)
    ]
    per_metre = levels[0].shape[1] / panel.width_m
    halvings = int(np.log2(max(1.0, per_metre / max(*scale, 1e-6))))
    return levels[min(halvings, len(levels) - 1)]


def _draw_sky(sky: Rgb, lens: Lens, view: View) -> NDArray[np.uint8]:
    """Sky above, plain asphalt below the horizon; drawn small, for it is smooth."""
    small = Lens.of(view, 0.25)
    cols, rows = np.meshgrid(np.arange(small.width_px), np.arange(small.height_px))
    pixels = np.stack([cols, rows, np.ones_like(cols)], axis=-1).astype(np.float64)
    rays = pixels @ np.linalg.inv(small.matrix).T
    slope = rays[..., 2] / np.hypot(rays[..., 0], rays[..., 1])
    turn = np.arctan2(rays[..., 0], rays[..., 1]) / (2 * np.pi) % 1.0
    elevation = np.arctan(slope) / (np.pi / 2)
    across = (turn * (sky.shape[1] - 1)).astype(np.float32)
    down = ((1 - np.clip(elevation, 0, 1)) * (sky.shape[0] - 1)).astype(np.float32)
    upper = cv2.remap(sky, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    near = np.clip(-elevation * 6, 0, 1)[..., None]
    lower = np.array(_HAZE) * (1 - near) + np.array(_ASPHALT) * near
    mixed = np.where(elevation[..., None] > 0, upper, lower).astype(np.uint8)
    size = (lens.width_px, lens.height_px)
    return np.asarray(cv2.resize(mixed, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
