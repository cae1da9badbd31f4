"""Indices of all sets, and their queries rehearsed: built once in a folder, resumed if stopped.

Real sets: kth-buildings, wxbs and budaors; the references of all, and all other folders, form one
index, without any query photo, so that each set has the others as distractors. Towns: three seeds
that the demo does not use, every view restyled in every style, indexed as the demo indexes;
one of them also with more frames and words, as `flaneur index` does by default.
"""

import json
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from contracts.config import DESCRIPTORS, IndexConfig, SearchConfig
from coordinator.cli.show import bars
from coordinator.demo import CONFIG as DEMO_CONFIG
from coordinator.engine.running import Engine
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import SMALLEST_SHARD, make_plan
from coordinator.querying import Rules, rehearse_queries
from coordinator.truth import JudgedQuery, read_truth
from index.opened import OpenedIndex
from survey import ReadOptions
from survey.synthetic import ShotOptions, render_survey
from survey.synthetic.styles import STYLES
from workers.stages.choose import KS

SEEDS = (1, 2, 3)
TOWN_SHARD_SIZE = 8
_SOURCES = (
    ("kth", "kth-buildings"),
    ("wxbs", "wxbs"),
    ("budaors", "budaors"),
    ("stereopolis", "stereopolis-paris6"),
    ("san-francisco", "san-francisco-toy/database"),
    ("gps", "gps-photos"),
)
_QUERIES = ("kth/queries/*", "wxbs/**/01.*", "budaors/then/*")
"""Query photos: never indexed."""


@dataclass(frozen=True, slots=True)
class Rehearsed:
    """The queries of one index, each with its set, and how every way answered them.

    places : of each query. votes : the folder of the single detectors' votes, by number.
    """

    index: OpenedIndex
    queries: tuple[JudgedQuery, ...]
    sets: tuple[str, ...]
    prefix: str
    answers: tuple[dict[str, Any], ...]
    votes: Path


def rehearsed_sets(data: Path, folder: Path, engine: Engine) -> Iterator[Rehearsed]:
    """Every index with its queries; what is in `folder` already is not made again."""
    yield _real(data, folder / "real", engine)
    for seed in SEEDS:
        yield _town(folder / f"town-{seed}", seed, DEMO_CONFIG, engine)
    yield _town(folder / f"town-{SEEDS[0]}-default", SEEDS[0], IndexConfig(), engine)


def _real(data: Path, folder: Path, engine: Engine) -> Rehearsed:
    sources = [(name, data / path) for name, path in _SOURCES]
    options = ReadOptions(no_pose=True, exclude=_QUERIES)
    index = _indexed(folder / "index", sources, options, IndexConfig(), SMALLEST_SHARD, engine)
    queries: list[JudgedQuery] = []
    sets: list[str] = []
    for name in ("kth-buildings", "wxbs", "budaors"):
        truth = data / name / "ground_truth.json"
        found = read_truth(truth, None, index.catalogue.column("uri"))
        queries += found
        sets += [name] * len(found)
    return _rehearsed(folder, index, queries, sets, "", engine)


def _town(folder: Path, seed: int, config: IndexConfig, engine: Engine) -> Rehearsed:
    demo = render_survey(folder, seed=seed, options=ShotOptions(every_style=True))
    index = _indexed(
        folder / "index",
        [("", demo.survey)],
        ReadOptions(crs=demo.crs),
        config,
        TOWN_SHARD_SIZE,
        engine,
    )
    queries = read_truth(demo.queries / "ground_truth.json", None, index.catalogue.column("uri"))
    sets = [next(style for style in STYLES if style in each.query) for each in queries]
    return _rehearsed(folder, index, queries, sets, f"seed {seed}: ", engine)


def _indexed(
    root: Path,
    sources: list[tuple[str, Path]],
    options: ReadOptions,
    config: IndexConfig,
    shard_size: int,
    engine: Engine,
) -> OpenedIndex:
    if not (root / "CURRENT").is_file():
        intake = read_surveys(sources, options)
        job, plan = make_plan(root, intake, config, shard_size)
        with bars() as progress:
            run_job(job, plan, intake, nullcontext(engine), progress)
    return OpenedIndex(root)


def _rehearsed(
    folder: Path,
    index: OpenedIndex,
    queries: list[JudgedQuery],
    sets: list[str],
    prefix: str,
    engine: Engine,
) -> Rehearsed:
    kept, votes = folder / "answers.json", folder / "votes"
    if not kept.is_file():
        with bars() as progress:
            progress.begin(f"rehearse {folder.name}", len(queries), 0)
            answers = rehearse_queries(
                index,
                queries,
                SearchConfig(),
                Rules.all_for(len(DESCRIPTORS), SearchConfig()),
                KS,
                engine.follower,
                lambda: progress.advance(f"rehearse {folder.name}"),
                votes,
            )
        kept.write_text(json.dumps(answers), encoding="utf-8")
    answers = json.loads(kept.read_text(encoding="utf-8"))
    return Rehearsed(index, tuple(queries), tuple(sets), prefix, tuple(answers), votes)
