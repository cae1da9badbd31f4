"""The indices, the photos that are asked of them, and the truth about each.

Fitted on: three synthetic towns, every view restyled in every style, each indexed as `flaneur
index` does by default; photos of the indexed town, and of the other two. Tested on: Stereopolis,
the second pass against an index of the first, and photos of other cities against the same index;
and the real sets of `benchmarks.sets`, with and without the photo's place.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.sets.collections import SEEDS, rehearsed_sets
from benchmarks.sets.run import OUT as SETS
from benchmarks.stereopolis import FIRST_PASS, index_first_pass, second_pass
from contracts.config import IndexConfig
from coordinator.demo import CONFIG as DEMO_CONFIG
from coordinator.engine.running import Engine
from geo.crs import ToWgs84
from index.opened import OpenedIndex
from survey import ReadOptions
from survey.synthetic import ShotOptions, render_survey
from survey.synthetic.street import StreetPlan, lay_out

OTHER_CITIES = ("kth-buildings", "wxbs", "budaors")
THIRD_STOPS = tuple(f"*_{stop:07d}.jpg" for stop in range(482, 509, 3))
_CRS = StreetPlan().crs


@dataclass(frozen=True, slots=True)
class Shot:
    """One photo and what is true of it.

    group : photos of one group are not independent. place : where it was taken, lon and lat in
    degrees; None: not in this survey. looks_at : the same of what it shows; None: not known.
    """

    set: str
    group: str
    path: Path
    place: tuple[float, float] | None = None
    looks_at: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Asked:
    """An index and the photos that it is asked for. name : of the index."""

    name: str
    index: OpenedIndex
    shots: tuple[Shot, ...]


@dataclass(frozen=True, slots=True)
class Known:
    """A real photo of an index without poses. relevant : the images of its place."""

    set: str
    path: Path
    relevant: frozenset[int]


def towns(folder: Path, engine: Engine) -> Iterator[Asked]:
    """Every town with its own photos, and with those of the other towns.

    Indexed as `flaneur index` does by default, and as the demo does, with fewer, more crowded
    words.
    """
    for seed in SEEDS:
        _render(folder / f"town-{seed}", seed)
    own = {seed: _photos(folder / f"town-{seed}", seed) for seed in SEEDS}
    for suffix, config in (("", IndexConfig()), (" crowded", DEMO_CONFIG)):
        for seed in SEEDS:
            town = folder / f"town-{seed}"
            root = town / f"index{suffix.replace(' ', '-')}"
            index = _indexed(town / "survey", root, ReadOptions(crs=_CRS), engine, config)
            others = (
                replace(shot, place=None, looks_at=None)
                for other in SEEDS
                for shot in own[other]
                if other != seed
            )
            yield Asked(f"town {seed}{suffix}", index, (*own[seed], *others))


def stereopolis(data: Path, folder: Path, engine: Engine) -> Iterator[Asked]:
    """The first pass of the street, the second pass's photos, and those of other cities.

    Once with all stops of the first pass, 2 to 4 m apart, and once with every third, about as far
    apart as those of the towns.
    """
    survey = data / "stereopolis-paris6"
    upright = folder / "stereopolis" / "queries"
    upright.mkdir(parents=True, exist_ok=True)
    queries = second_pass(survey, upright)
    lon, lat = ToWgs84(_CRS).lon_lat(
        [query.truth.pose.easting for query in queries],
        [query.truth.pose.northing for query in queries],
    )
    shots = [
        Shot("second pass", _stop(query.photo), Path(query.photo), (float(x), float(y)))
        for query, x, y in zip(queries, lon, lat, strict=True)
    ]
    for name in OTHER_CITIES:
        truth = json.loads((data / name / "ground_truth.json").read_text(encoding="utf-8"))
        shots += [Shot(name, f"{name}/{query}", data / name / query) for query in sorted(truth)]
    for name, stops in (
        ("Stereopolis", FIRST_PASS),
        ("Stereopolis, every third stop", THIRD_STOPS),
    ):
        root = folder / name.lower().replace(" ", "-").replace(",", "") / "index"
        index = _indexed(survey, root, ReadOptions(include=stops), engine)
        yield Asked(name, index, tuple(shots))


def real_sets(data: Path, engine: Engine) -> tuple[OpenedIndex, list[Known]]:
    """The index of all real references, and every real query with its place."""
    found = next(iter(rehearsed_sets(data, SETS, engine)))
    return found.index, [
        Known(name, query.path, frozenset(answer["relevant"]))
        for name, query, answer in zip(found.sets, found.queries, found.answers, strict=True)
    ]


def _render(folder: Path, seed: int) -> None:
    if not (folder / "queries" / "ground_truth.json").is_file():
        render_survey(folder, seed=seed, options=ShotOptions(every_style=True))


def _photos(folder: Path, seed: int) -> list[Shot]:
    queries = folder / "queries"
    truth = json.loads((queries / "truth.json").read_text(encoding="utf-8"))
    middles = {facade.name: facade.middle for facade in lay_out(StreetPlan(), seed)}
    to_wgs84 = ToWgs84(_CRS)
    lon, lat = to_wgs84.lon_lat(
        [each["easting"] for each in truth], [each["northing"] for each in truth]
    )
    walls = np.array([middles[each["facade"]][:2] for each in truth])
    wall_lon, wall_lat = to_wgs84.lon_lat(walls[:, 0], walls[:, 1])
    return [
        Shot(
            f"town {seed}",
            f"town {seed}/{each['file'].partition('-')[0]}",
            queries / each["file"],
            (float(lon[n]), float(lat[n])),
            (float(wall_lon[n]), float(wall_lat[n])),
        )
        for n, each in enumerate(truth)
    ]


def _indexed(
    survey: Path,
    root: Path,
    options: ReadOptions,
    engine: Engine,
    config: IndexConfig | None = None,
) -> OpenedIndex:
    if not (root / "CURRENT").is_file():
        index_first_pass(survey, root, options, engine, config)
    return OpenedIndex(root)


def _stop(photo: str) -> str:
    """The panorama that a photo of Stereopolis is of."""
    return Path(photo).stem.rpartition("_")[2]
