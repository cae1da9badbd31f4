"""Where pictures are taken: the survey vehicle's stops, and the old photographers' places."""

from dataclasses import dataclass

import numpy as np

from survey.synthetic.camera import View
from survey.synthetic.street import Facade, StreetPlan
from survey.synthetic.styles import STYLES
from survey.synthetic.town import Town
from survey.synthetic.visibility import share_covered, shares_seen

SEEN_SHARE = 0.10
"""A facade counts as seen where it fills at least this share of a picture."""

MOST_COVERED = 0.15
"""No query is taken where a tree or lamp fills more of the picture."""


@dataclass(frozen=True, slots=True)
class ShotOptions:
    """How many pictures and how large. Metres, degrees, pixels."""

    width_px: int = 800
    height_px: int = 600
    stop_spacing_m: float = 8.2
    front_every: int = 6
    hfov_deg: float = 82.0
    n_queries: int = 24
    """Views of queries; each is one photo, or one a style with `every_style`."""
    every_style: bool = False
    """Restyle each query view in every style; otherwise styles are dealt evenly."""
    worn_share: float = 0.12
    """Share of survey pictures that are blurred or dark."""
    max_stops: int | None = None


@dataclass(frozen=True, slots=True)
class SurveyShot:
    """One picture of the survey. wear : nothing, "blurred" or "dark"."""

    uri: str
    view: View
    stop: int
    wear: str


@dataclass(frozen=True, slots=True)
class QueryShot:
    """One old photograph, of one facade, with the style it was made in.

    number : of its view, from 1; photos that differ in style only share it.
    """

    file: str
    number: int
    view: View
    facade: Facade
    style: str
    caption: str


def drive(plan: StreetPlan, options: ShotOptions, seed: int) -> tuple[SurveyShot, ...]:
    """The survey: stops along the right-hand lane of every street, several cameras a stop."""
    rng = np.random.default_rng([seed, 4])
    shots: list[SurveyShot] = []
    stop = 0
    for start, end in plan.edges(1.2):
        length = float(np.linalg.norm(end - start))
        ahead = (end - start) / length
        heading = float(np.degrees(np.arctan2(ahead[0], ahead[1])))
        for place in np.arange(options.stop_spacing_m / 2, length, options.stop_spacing_m):
            if options.max_stops is not None and stop >= options.max_stops:
                return tuple(shots)
            spot = start + ahead * place + rng.normal(0, 0.15, 2)
            turn, tilt = float(rng.normal(0, 2.0)), rng.normal(0, 0.6, 2)
            cameras = [("left", -80.0, 11.0), ("right", 80.0, 11.0)]
            if stop % options.front_every == 0:
                cameras.append(("front", 0.0, 4.0))
            for name, yaw, pitch in cameras:
                view = View(
                    easting=float(spot[0]),
                    northing=float(spot[1]),
                    altitude_m=plan.ground_m + 2.6,
                    heading_deg=(heading + turn + yaw) % 360,
                    pitch_deg=pitch + float(tilt[0]),
                    roll_deg=float(tilt[1]),
                    hfov_deg=options.hfov_deg,
                    width_px=options.width_px,
                    height_px=options.height_px,
                )
                worn = rng.random() < options.worn_share
                wear = ("blurred", "dark")[int(rng.integers(2))] if worn else ""
                shots.append(SurveyShot(f"images/{stop:06d}-{name}.jpg", view, stop, wear))
            stop += 1
    return tuple(shots)


def visit(town: Town, options: ShotOptions, seed: int) -> tuple[QueryShot, ...]:
    """The queries: different facades, every template's turn, styles dealt evenly or all of them.

    `every_style` takes the same views and only adds photos. Each photographer stands on the
    pavement across the street or nearer, off the survey's track, at another height, focal length
    and angle.
    """
    rng = np.random.default_rng([seed, 5])
    pool = [town.houses[index].facade for index in rng.permutation(len(town.houses))]
    used: dict[str, int] = {}
    shots: list[QueryShot] = []
    number = 1
    while number <= options.n_queries:
        rarest = min(used.get(facade.template.name, 0) for facade in pool)
        facade = next(f for f in pool if used.get(f.template.name, 0) == rarest)
        pool.remove(facade)
        view = _take_aim(town.plan, facade, options, rng)
        if not _shows(town, view, facade):
            continue
        used[facade.template.name] = rarest + 1
        dealt = STYLES[(number - 1) % len(STYLES)]
        title = facade.name.rpartition("-")[0].replace("-", " ").capitalize()
        caption = f"{number * 7 - 4}. - {title}"
        shots += [
            QueryShot(f"q{number:02d}-{style}.jpg", number, view, facade, style, caption)
            for style in (STYLES if options.every_style else (dealt,))
        ]
        number += 1
    return tuple(shots)


def _take_aim(
    plan: StreetPlan, facade: Facade, options: ShotOptions, rng: np.random.Generator
) -> View:
    """A standpoint before a facade and a direction to its lower half."""
    away = float(rng.uniform(0.62, 0.9)) * plan.width_m
    aside = float(rng.uniform(-0.32, 0.32)) * facade.panel.width_m
    spot = facade.middle + away * facade.outward + aside * facade.panel.along
    eye = plan.ground_m + float(rng.choice([1.6, 1.7, 2.6, 4.0]))
    aim = (
        facade.middle + facade.panel.along * float(rng.uniform(-0.12, 0.12)) * facade.panel.width_m
    )
    ray = aim - spot
    pitch = float(rng.uniform(7, 12)) - 1.2 * (eye - plan.ground_m - 1.6)
    return View(
        easting=float(spot[0]),
        northing=float(spot[1]),
        altitude_m=eye,
        heading_deg=float(np.degrees(np.arctan2(ray[0], ray[1]))) % 360,
        pitch_deg=pitch,
        roll_deg=float(rng.normal(0, 1.5)),
        hfov_deg=float(rng.uniform(56, 72)),
        width_px=options.width_px,
        height_px=options.height_px,
    )


def _shows(town: Town, view: View, facade: Facade) -> bool:
    """Whether the facade is what the picture is mainly of, and no tree stands in the way."""
    seen = shares_seen(town, view)
    largest = max(seen, key=lambda name: seen[name][0])
    return largest == facade.name and share_covered(town, view) < MOST_COVERED


def facades_seen(town: Town, view: View) -> tuple[str, ...]:
    """Names of the facades that fill a substantial share of a picture, most central first."""
    seen = shares_seen(town, view)
    kept = [name for name, (share, _) in seen.items() if share >= SEEN_SHARE]
    return tuple(sorted(kept, key=lambda name: (seen[name][1], name)))
