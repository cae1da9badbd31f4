"""Photos a second of a named batch, beside bare processes that locate in a loop.

One and two processes of each, in turns in the same run: what the queue costs is the batch's share
of what the bare processes do. All have their kernels compiled and the index open beforehand.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from statistics import median

from PIL import Image

from benchmarks.table import print_table
from contracts.config import SearchConfig
from coordinator.batches.batch import BATCHES, BatchFolder
from coordinator.batches.fetching import Fetcher
from coordinator.batches.photos import photo_file
from coordinator.batches.running import run_batch
from coordinator.batches.submitting import submit
from coordinator.cli.show import Bars
from coordinator.demo import CONFIG, SHARD_SIZE
from coordinator.engine.running import Engine, running_engine
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from index.opened import OpenedIndex
from survey import ReadOptions
from survey.files import list_images
from survey.synthetic import render_survey
from workers.run import worker_environment

PHOTOS = 120
ROUNDS = 3
PROCESSES = (1, 2)
WARM_UP = 8
"""Photos before the clock starts, of every process."""

_BARE = """
import sys
import cv2, faiss
from retrieval.features import compile_kernels
from retrieval.warm import compile_search_kernels
from workers.messages import LocateMessage
from workers.stages.locate import locate_photo
cv2.setNumThreads(1)
faiss.omp_set_num_threads(1)
compile_kernels()
compile_search_kernels()
index, generation, warm_up, *photos = sys.argv[1:]
asked = [
    LocateMessage(index=index, generation=int(generation), query=photo, path=photo, search={})
    for photo in photos
]
for each in asked[: int(warm_up)]:
    locate_photo(each)
print("ready", flush=True)
sys.stdin.readline()
for each in asked:
    locate_photo(each)
print("done", flush=True)
"""


def run(data: Path) -> None:
    """Print photos a second of both with one and two processes, and their ratios."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        index, photos = _town(folder)
        bare: dict[int, list[float]] = {count: [] for count in PROCESSES}
        queue: dict[int, list[float]] = {count: [] for count in PROCESSES}
        for number in range(ROUNDS):
            for count in PROCESSES:
                bare[count].append(bare_processes(index, photos, count))
                queue[count].append(batch(index, photos, count, f"r{number}-{count}"))
    rates = {
        name: {count: median(each[count]) for count in PROCESSES}
        for name, each in (("bare processes", bare), ("batch", queue))
    }
    print(f"{len(photos)} photos, {index.n_live} images indexed, median of {ROUNDS} rounds\n")
    print_table(
        ("", *(f"{count} processes, photos/s" for count in PROCESSES), "ratio"),
        [
            (name, *(f"{rate[count]:.2f}" for count in PROCESSES), f"{rate[2] / rate[1]:.2f}")
            for name, rate in rates.items()
        ],
    )
    shares = [rates["batch"][count] / rates["bare processes"][count] for count in PROCESSES]
    print(f"\nThe batch does {shares[0]:.2f} of one bare process, {shares[1]:.2f} of two.")


def bare_processes(index: OpenedIndex, photos: Sequence[str], count: int) -> float:
    """Photos a second of processes that do nothing but locate their share."""
    common = [sys.executable, "-c", _BARE, str(index.root), str(index.generation.number)]
    processes = [
        subprocess.Popen(
            [*common, str(WARM_UP), *photos[number::count]],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, **worker_environment()},
        )
        for number in range(count)
    ]
    for process in processes:
        _expect(process, "ready")
    began = time.perf_counter()
    for process in processes:
        process.stdin.write("\n")  # type: ignore[union-attr]
        process.stdin.flush()  # type: ignore[union-attr]
    for process in processes:
        _expect(process, "done")
    seconds = time.perf_counter() - began
    for process in processes:
        process.communicate()
    return len(photos) / seconds


def batch(index: OpenedIndex, photos: Sequence[str], count: int, name: str) -> float:
    """Photos a second of a named batch, its engine already running."""
    with running_engine(None, count, ("locate",), priority=5) as engine:
        warm_up = [*photos[: WARM_UP * count]]
        _work(index, warm_up, engine, f"{name}-warm-up")
        began = time.perf_counter()
        _work(index, photos, engine, name)
        return len(photos) / (time.perf_counter() - began)


def _work(index: OpenedIndex, photos: Sequence[str], engine: Engine, name: str) -> None:
    folder = BatchFolder(index.root / BATCHES, name)
    plan = submit(folder, index, SearchConfig(), 5, photos, [photo_file(each) for each in photos])
    with folder.worked_on(), Fetcher() as fetcher:
        run_batch(folder, plan, index, nullcontext(engine), fetcher, Bars(None), lambda *_: None)


def _town(folder: Path) -> tuple[OpenedIndex, list[str]]:
    """The demo's town indexed, and photos that are parts of its images: no two are the same."""
    demo = render_survey(folder / "town")
    intake = read_surveys([("", demo.survey)], ReadOptions(crs=demo.crs))
    root = folder / "index"
    job, plan = make_plan(root, intake, CONFIG, SHARD_SIZE)
    run_job(job, plan, intake, running_engine(None, 2), Bars(None))
    images = sorted(list_images(demo.survey).paths.values())
    photos = [_part(images[number % len(images)], number, folder) for number in range(PHOTOS)]
    return OpenedIndex(root), photos


def _part(image: str, number: int, folder: Path) -> str:
    part = folder / f"{number:03d}.jpg"
    with Image.open(image) as picture:
        left = 5 + number % 40
        picture.crop((left, 5, picture.width - 5, picture.height - 5)).save(part, quality=92)
    return str(part)


def _expect(process: "subprocess.Popen[str]", said: str) -> None:
    if process.stdout is None or process.stdout.readline().strip() != said:
        raise RuntimeError(f"a bare process ended before it was {said}")
