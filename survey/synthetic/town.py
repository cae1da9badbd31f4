"""The town as it is drawn: every panel in its place with its texture levels."""

from dataclasses import dataclass

import cv2
import numpy as np

from survey.synthetic import sprites
from survey.synthetic.camera import Panel
from survey.synthetic.canvas import PX_PER_M, Rgb
from survey.synthetic.facades import paint_facade
from survey.synthetic.sprites import ROAD_SECTION_M
from survey.synthetic.street import UP, Facade, Furniture, Sort, StreetPlan, furnish, lay_out

_SUN = np.array([0.55, -0.8, 0.0])


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
