"""The demo's town: a loop of streets in Lambert-93, its houses, and what stands at the kerb."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from survey.synthetic.camera import Floats, Panel
from survey.synthetic.templates import TEMPLATES, Template

UP = np.array([0.0, 0.0, 1.0])
Sort = Literal["tree", "lamp", "car"]


@dataclass(frozen=True, slots=True)
class StreetPlan:
    """A closed loop of streets: `corners` (easting, northing) of its middle, counter-clockwise.

    Street i runs from corner i to the next one. Each end of `corners` must be convex.
    """

    corners: tuple[tuple[float, float], ...] = (
        (651_480.0, 6_861_420.0),
        (651_646.0, 6_861_482.0),
        (651_602.0, 6_861_628.0),
        (651_436.0, 6_861_566.0),
    )
    names: tuple[str, ...] = ("rue-du-levant", "rue-des-tanneurs", "rue-haute", "rue-du-puits")
    width_m: float = 16.0
    ground_m: float = 35.0
    crs: str = "EPSG:2154"

    def edges(self, outwards_m: float = 0.0) -> list[tuple[Floats, Floats]]:
        """Start and end (2,) of every street's line, moved outwards (to its right) in parallel."""
        points = np.array(self.corners)
        ahead = np.roll(points, -1, axis=0) - points
        ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
        right = np.column_stack([ahead[:, 1], -ahead[:, 0]])
        starts = []
        for i in range(len(points)):
            normals = np.stack([right[i - 1], right[i]])
            reach = normals @ points[i] + outwards_m
            starts.append(np.linalg.solve(normals, reach))
        return [(starts[i], starts[(i + 1) % len(starts)]) for i in range(len(starts))]

    @property
    def length_m(self) -> float:
        """The length of all streets together."""
        return float(sum(np.linalg.norm(end - start) for start, end in self.edges()))


@dataclass(frozen=True, slots=True)
class Facade:
    """A house front in its place. `inner`: it stands on the block that the loop goes round."""

    name: str
    template: Template
    street: int
    inner: bool
    panel: Panel
    seed: int

    @property
    def outward(self) -> Floats:
        """(3,) unit vector from the wall into the street."""
        return np.array([self.panel.along[1], -self.panel.along[0], 0.0])

    @property
    def middle(self) -> Floats:
        """(3,) the middle of the wall's foot."""
        return self.panel.point(self.panel.width_m / 2, 0.0)


@dataclass(frozen=True, slots=True)
class Furniture:
    """A thing at the kerb. `along` is its street's direction (3,), `variant` its looks."""

    sort: Sort
    foot: Floats
    along: Floats
    variant: int


def _deck(rng: np.random.Generator) -> Iterator[Template]:
    """Templates for ever, each equally often, never the same twice running."""
    last: Template | None = None
    while True:
        order = [TEMPLATES[index] for index in rng.permutation(len(TEMPLATES))]
        if order[0] is last:
            order.append(order.pop(0))
        yield from order
        last = order[-1]


def lay_out(plan: StreetPlan, seed: int) -> tuple[Facade, ...]:
    """Build houses on both sides of every street, wall to wall.

    Widths are stretched by a few per cent so that a row fills its side; names are the street's
    with odd numbers on the left, even ones on the right of the direction of travel.
    """
    rng = np.random.default_rng([seed, 1])
    deck = _deck(rng)
    facades: list[Facade] = []
    for inner in (True, False):
        shift = -plan.width_m / 2 if inner else plan.width_m / 2
        for street, (start, end) in enumerate(plan.edges(shift)):
            facades += _build_row(plan, street, inner, (start, end), deck, rng)
    return tuple(facades)


def _build_row(
    plan: StreetPlan,
    street: int,
    inner: bool,
    line: tuple[Floats, Floats],
    deck: Iterator[Template],
    rng: np.random.Generator,
) -> list[Facade]:
    start, end = line
    length = float(np.linalg.norm(end - start))
    chosen: list[Template] = []
    while (missing := length - sum(make.width_m for make in chosen)) > 5.0:
        chosen.append(next(deck))
    # The last one is left out where the row fits better without it.
    if len(chosen) > 1 and -missing > chosen[-1].width_m / 2:
        chosen.pop()
    stretch = length / sum(make.width_m for make in chosen)
    ahead = (end - start) / length
    along = np.array([*(ahead if inner else -ahead), 0.0])
    row, place = [], 0.0
    for index, make in enumerate(chosen):
        width = make.width_m * stretch
        corner = place if inner else place + width
        origin = np.array([*(start + ahead * corner), plan.ground_m])
        number = 2 * index + (1 if inner else 2)
        panel = Panel(origin, along, UP, width, make.height_m)
        name = f"{plan.names[street]}-{number}"
        row.append(Facade(name, make, street, inner, panel, int(rng.integers(2**31))))
        place += width
    return row


def furnish(plan: StreetPlan, seed: int) -> tuple[Furniture, ...]:
    """Set up lamps everywhere, trees in every other street, and the day's parked cars."""
    rng = np.random.default_rng([seed, 2])
    things: list[Furniture] = []
    for street, (start, end) in enumerate(plan.edges()):
        length = float(np.linalg.norm(end - start))
        spots: list[tuple[Sort, float, float, float]] = [
            ("lamp", 24.0, 5.3, 1.0),
            ("car", 6.0, 4.2, 0.4),
        ]
        if street % 2:
            spots.append(("tree", 17.0, 5.4, 0.7))
        for sort, step_m, side_m, share in spots:
            for place in np.arange(step_m / 2 + 6, length - 10, step_m):
                for side in (-side_m, side_m):
                    if rng.random() < share:
                        spot = (float(place + rng.uniform(-0.6, 0.6)), side)
                        things.append(_stand(plan, (start, end), sort, spot, rng))
    return tuple(things)


def _stand(
    plan: StreetPlan,
    line: tuple[Floats, Floats],
    sort: Sort,
    spot: tuple[float, float],
    rng: np.random.Generator,
) -> Furniture:
    """A thing `spot` = (along, to the right of the middle) metres from the street's start."""
    ahead = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
    right = np.array([ahead[1], -ahead[0]])
    foot = np.array([*(line[0] + spot[0] * ahead + spot[1] * right), plan.ground_m])
    return Furniture(sort, foot, np.array([*ahead, 0.0]), int(rng.integers(4)))
