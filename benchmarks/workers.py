"""One worker and two, beside two bare processes that only extract."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.table import print_table
from contracts.config import IndexConfig
from coordinator.cli.show import bars
from coordinator.engine import running_engine
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from survey import ReadOptions
from workers.run import worker_environment

SHARD_SIZE = 16

_BARE = """
import sys, cv2
from contracts.config import FeatureConfig
from retrieval.features import compile_kernels
from survey import ReadOptions, read_survey
from workers.stages.extract import image_features
from pathlib import Path
import time
cv2.setNumThreads(1)
compile_kernels()
images = read_survey(Path(sys.argv[1]), ReadOptions()).images
mine = images[int(sys.argv[2])::int(sys.argv[3])]
began = time.perf_counter()
for image in mine:
    image_features(image, FeatureConfig())
print(time.perf_counter() - began)
"""


def run(data: Path) -> None:
    """Print images per second of the whole job and of bare extraction, and the ratios."""
    survey = data / "stereopolis-paris6"
    whole = {count: whole_job(survey, count) for count in (1, 2)}
    bare = {count: bare_extraction(survey, count) for count in (1, 2)}
    print_table(
        ("", "1 process, images/s", "2 processes, images/s", "ratio"),
        [
            (name, f"{rates[1]:.2f}", f"{rates[2]:.2f}", f"{rates[2] / rates[1]:.2f}")
            for name, rates in (("whole index job", whole), ("bare extraction", bare))
        ],
    )


def whole_job(survey: Path, n_workers: int) -> float:
    """Images per second of an index job, its engine already running."""
    with tempfile.TemporaryDirectory() as scratch, bars() as progress:
        intake = read_surveys([("", survey)], ReadOptions())
        job, plan = make_plan(Path(scratch), intake, IndexConfig(), SHARD_SIZE)
        report = run_job(job, plan, intake, running_engine(None, n_workers), progress)
        return report.images_extracted / report.seconds


def bare_extraction(survey: Path, n_processes: int) -> float:
    """Images per second of processes that do nothing but decode and extract."""
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", _BARE, str(survey), str(number), str(n_processes)],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **worker_environment()},
        )
        for number in range(n_processes)
    ]
    slowest = max(float(process.communicate()[0]) for process in processes)
    return len(read_surveys([("", survey)], ReadOptions()).images) / slowest
