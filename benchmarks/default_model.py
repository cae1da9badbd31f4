"""How the shipped choice of detectors and k is made: `python -m benchmarks default-model`.

Towns of other seeds than the demo's are rendered, indexed as the demo indexes, and every query
is searched with every pair and k; Eq. 1 is fitted on all of them, one place left out at a time
for the scores. Only coefficients are kept. Takes half an hour.
"""

import tempfile
from contextlib import nullcontext
from dataclasses import replace
from itertools import product
from pathlib import Path

from contracts.config import (
    DESCRIPTORS,
    DETECTORS,
    FeatureConfig,
    IndexConfig,
    SearchConfig,
)
from coordinator.cli.show import bars
from coordinator.demo import CONFIG, SHARD_SIZE
from coordinator.engine import Engine, running_engine
from coordinator.indexing import run_job
from coordinator.plan import make_plan, read_surveys
from coordinator.querying import rehearse_queries
from coordinator.training import places_of, training_rows
from coordinator.truth import read_truth
from index.opened import OpenedIndex
from retrieval.choice import TrainingRow, TrainingSet, fit
from survey import ReadOptions
from survey.synthetic import DemoSurvey, render_survey
from workers.stages.retrieve import KS

SEEDS = (1, 2, 3)
MAX_FRAMES = (600, 1000)
"""The demo's, and the default of `flaneur index`."""
SHIPPED = Path(__file__).parents[1] / "index" / "default_choice.json"


def run(_: Path) -> None:
    """Make the model, print what it is worth, and write it where it is shipped from."""
    search = SearchConfig()
    rows: list[TrainingRow] = []
    sets: list[TrainingSet] = []
    with tempfile.TemporaryDirectory() as scratch, running_engine(None, None) as engine:
        for seed, max_frames in product(SEEDS, MAX_FRAMES):
            name = f"synthetic town, seed {seed}, {max_frames} frames"
            demo = render_survey(Path(scratch) / str(seed), seed=seed)
            found = rehearsed(demo, Path(scratch) / name, max_frames, engine)
            # The same place, however many frames are found there, is left out as one.
            rows += [
                replace(row, query=f"{name}: {row.query}", place=f"seed {seed}: {row.place}")
                for row in found
            ]
            sets.append(
                TrainingSet(
                    set=name,
                    n_queries=len({row.query for row in found}),
                    n_places=len({row.place for row in found}),
                )
            )
    model = fit(
        rows,
        detectors=DETECTORS,
        descriptors=DESCRIPTORS,
        vote=search.vote,
        weights=tuple(sorted(search.weights)),
        trained_on=tuple(sets),
    )
    SHIPPED.write_text(model.to_json() + "\n", encoding="utf-8")
    print(model.summary())
    for fixed in model.fitted.fixed[:5]:
        print(f"{'-'.join(fixed.pair)}, k = {fixed.k}: mAP {fixed.mean_ap:.3f}")


def rehearsed(demo: DemoSurvey, root: Path, max_frames: int, engine: Engine) -> list[TrainingRow]:
    """Index a town as the demo does and search every query with every pair and k."""
    config = IndexConfig(features=FeatureConfig(max_frames=max_frames), codebooks=CONFIG.codebooks)
    intake = read_surveys([("", demo.survey)], ReadOptions(crs=demo.crs))
    job, plan = make_plan(root, intake, config, SHARD_SIZE)
    with bars() as progress:
        run_job(job, plan, intake, nullcontext(engine), progress)
    index = OpenedIndex(root)
    truth = demo.queries / "ground_truth.json"
    queries = read_truth(truth, None, index.catalogue.column("uri"))
    answers = rehearse_queries(index, queries, SearchConfig(), KS, engine.follower, lambda: None)
    return training_rows(answers, places_of(queries))
