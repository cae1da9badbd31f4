"""Draw the town as a camera sees it: far to near, each panel by its homography."""

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from survey.synthetic.camera import Floats, Lens, Panel, View, fill_mask
from survey.synthetic.canvas import Rgb
from survey.synthetic.town import Decal, Town
from survey.synthetic.visibility import by_distance, facing, standing

SUPERSAMPLE = 1.5
"""Pictures are drawn this much larger and reduced: it smooths all edges."""
_STRIP_M = 4.0
"""Panels are drawn in strips of this width, each from the texture level that fits its distance."""
_HAZE = (186, 190, 194)
_ASPHALT = (108, 108, 110)


def render(town: Town, view: View, *, sky: int = 0, cars: bool = True) -> Rgb:
    """The picture of a view, (height_px, width_px, 3) uint8 RGB.

    sky : which of the town's skies. cars : whether the parked cars are there.
    """
    lens = Lens.of(view, SUPERSAMPLE)
    picture = _draw_sky(town.skies[sky], lens, view)
    for section in by_distance(town.road, lens):
        _draw(picture, lens, section)
    for house in facing(town, view):
        _draw(picture, lens, house.wall)
        for relief in house.reliefs:
            _draw(picture, lens, relief)
    for thing in standing(town, lens, cars):
        _draw(picture, lens, thing)
    size = (view.width_px, view.height_px)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


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
