"""How an index job grows: one worker and two, and a simulation of up to two hundred.

All that the simulation knows was measured in the same run and lies in one JSON file. Set
FLANEUR_SCALING_MEASURED to such a file to simulate again without measuring.
"""

import os
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.index.fresh_process import in_fresh_process
from benchmarks.scaling.alone import plan_and_commit
from benchmarks.scaling.bare import bare_extraction
from benchmarks.scaling.jobs import empty_tasks, whole_job
from benchmarks.scaling.measured import Bare, Measured, read_measured, write_measured
from benchmarks.scaling.pieces import measure_pieces
from benchmarks.scaling.report import print_checked, print_measured, print_simulated
from contracts.config import IndexConfig
from coordinator.intake import read_surveys
from survey import ReadOptions

PROCESSES = (1, 2)
ALONE = (20_000, 100_000)
N_EMPTY = 1000
KEPT = "FLANEUR_SCALING_MEASURED"


def run(data: Path) -> None:
    """Measure, keep, and print tables."""
    kept = os.environ.get(KEPT)
    if kept is None:
        measured = measure(data / "stereopolis-paris6")
        path = Path(tempfile.gettempdir()) / "flaneur-scaling.json"
        write_measured(path, measured)
        print(f"What was measured lies in {path}.\n")
    else:
        measured = read_measured(Path(kept))
    print_measured(measured)
    print_checked(measured)
    print_simulated(measured)


def measure(survey: Path) -> Measured:
    """Index and extract a survey by one process and by two, and measure the rest."""
    intake = read_surveys([("", survey)], ReadOptions())
    bare = [Bare(count, *bare_extraction(survey, count)) for count in PROCESSES]
    jobs = [whole_job(intake, IndexConfig(), count) for count in PROCESSES]
    alone = []
    for n_images in ALONE:
        with tempfile.TemporaryDirectory() as scratch:
            alone.append(in_fresh_process(plan_and_commit, Path(scratch), n_images).result)
    return Measured(
        image_bytes=float(np.mean([Path(image.path).stat().st_size for image in intake.images])),
        jobs=jobs,
        bare=bare,
        alone=alone,
        pieces=measure_pieces(),
        n_empty=N_EMPTY,
        empty=empty_tasks(N_EMPTY, PROCESSES[-1]),
    )
