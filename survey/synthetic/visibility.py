"""What a camera can see of the town, and in which order it is to be drawn."""

import numpy as np

from survey.synthetic.camera import NEAR_M, Floats, Lens, Panel, View, fill_mask
from survey.synthetic.sprites import SIZES_M
from survey.synthetic.street import UP
from survey.synthetic.town import Decal, House, Town


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


def by_distance(decals: tuple[Decal, ...], lens: Lens) -> list[Decal]:
    """The same, farthest first."""

    def distance(decal: Decal) -> float:
        middle = decal.panel.point(decal.panel.width_m / 2, decal.panel.height_m / 2)
        return float(np.linalg.norm(middle - lens.centre))

    return sorted(decals, key=distance, reverse=True)


def standing(town: Town, lens: Lens, cars: bool) -> list[Decal]:
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
    return by_distance(tuple(decals), lens)


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


def share_covered(town: Town, view: View) -> float:
    """The share of the picture that the largest thing at the kerb covers, its whole rectangle."""
    lens = Lens.of(view, 0.1)
    shape = (lens.height_px, lens.width_px)
    shares = [0.0]
    for thing in standing(town, lens, cars=False):
        panel = thing.panel
        span = (0.0, 0.0, panel.width_m, panel.height_m)
        outline = lens.outline(lens.from_panel(panel), span)
        if len(outline):
            shares.append(float((fill_mask(outline, shape) > 0).mean()))
    return max(shares)
