"""What `flaneur plan` predicts, beside what indexing the same survey then took.

Two worker processes of this machine. Seconds of a stage are the CPU seconds of the workers, memory
is the most that one of them held for itself.
"""

import json
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import psutil

from benchmarks.table import print_table
from contracts.config import IndexConfig
from coordinator.building import STAGES
from coordinator.demo import CONFIG as DEMO_CONFIG
from coordinator.demo import SHARD_SIZE as DEMO_SHARD_SIZE
from coordinator.engine.running import running_engine
from coordinator.indexing import IndexReport, run_job
from coordinator.intake import read_surveys
from coordinator.plan import SMALLEST_SHARD, make_plan
from survey import ReadOptions
from survey.synthetic import render_survey

WORKERS = 2
_LOOK_S = 0.1


@dataclass(frozen=True, slots=True)
class Case:
    """A survey and how it is read and indexed; `arguments` say the same to `flaneur plan`."""

    name: str
    survey: Path
    arguments: tuple[str, ...]
    options: ReadOptions
    config: IndexConfig
    shard_size: int


class Watch:
    """Progress of a job that notes, for each stage, what its worker processes used.

    cpu_s : by stage. held_bytes : the most one process held. folder_bytes : the most the index
    folder held.
    """

    def __init__(self, folder: Path) -> None:
        self.cpu_s: dict[str, float] = {}
        self.held_bytes: dict[str, int] = {}
        self.folder_bytes = 0
        self._folder = folder
        self._stage = ""
        self._cpu_before = 0.0
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._look)

    def __enter__(self) -> "Watch":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()

    def begin(self, stage: str, total: int, done: int) -> None:
        self.end()
        self._stage, self._cpu_before = stage, _cpu_s()

    def advance(self, stage: str) -> None:
        """Nothing to show."""

    def end(self) -> None:
        """The last stage has ended."""
        if self._stage:
            self.cpu_s[self._stage] = _cpu_s() - self._cpu_before
        self._stage = ""

    def _look(self) -> None:
        while not self._done.wait(_LOOK_S):
            stage = self._stage
            held = max(_each_worker(_own_bytes), default=0)
            self.held_bytes[stage] = max(self.held_bytes.get(stage, 0), held)
            self.folder_bytes = max(self.folder_bytes, _bytes_of(self._folder))


def run(data: Path) -> None:
    """Predict, index, and print both and their ratio for each survey."""
    with tempfile.TemporaryDirectory() as scratch:
        for case in _cases(data, Path(scratch) / "town"):
            predicted = predict(case)
            rows, n_images = _rows(case, predicted)
            print(f"\n### {case.name}: {n_images} images, {predicted['sampled']} sampled\n")
            print_table(("", "predicted", "between", "happened", "predicted / happened"), rows)


def predict(case: Case) -> dict[str, Any]:
    """What `flaneur plan` says, in a process of its own."""
    command = [sys.executable, "-m", "coordinator.cli", "plan", str(case.survey)]
    options = [*case.arguments, "--workers", str(WORKERS), "--json"]
    answer = subprocess.run([*command, *options], capture_output=True, text=True, check=False)
    if answer.returncode not in {0, 3}:
        raise RuntimeError(f"flaneur plan {case.name} failed: {answer.stderr}")
    found: dict[str, Any] = json.loads(answer.stdout)
    return found


def index(case: Case) -> tuple[IndexReport, float, Watch]:
    """What happens: the report, seconds from start to end, and what the workers used."""
    intake = read_surveys([("", case.survey)], case.options)
    with tempfile.TemporaryDirectory() as scratch:
        root = Path(scratch)
        job, plan = make_plan(root, intake, case.config, case.shard_size)
        began = perf_counter()
        with running_engine(None, WORKERS) as engine, Watch(root) as watch:
            report = run_job(job, plan, intake, nullcontext(engine), watch)
            watch.end()
        return report, perf_counter() - began, watch


def _cases(data: Path, town: Path) -> Sequence[Case]:
    demo = render_survey(town)
    few, small = DEMO_CONFIG.features.max_frames, DEMO_CONFIG.codebooks.max_words
    return (
        Case(
            "the demo's town",
            demo.survey,
            (
                *("--crs", demo.crs, "--max-frames", str(few), "--max-words", str(small)),
                *("--shard-size", str(DEMO_SHARD_SIZE)),
            ),
            ReadOptions(crs=demo.crs),
            DEMO_CONFIG,
            DEMO_SHARD_SIZE,
        ),
        Case(
            "Stereopolis",
            data / "stereopolis-paris6",
            (),
            ReadOptions(),
            IndexConfig(),
            SMALLEST_SHARD,
        ),
        Case(
            "KTH, references",
            data / "kth-buildings" / "references",
            ("--no-pose",),
            ReadOptions(no_pose=True),
            IndexConfig(),
            SMALLEST_SHARD,
        ),
    )


def _rows(case: Case, predicted: dict[str, Any]) -> tuple[list[tuple[str, ...]], int]:
    report, wall_s, watch = index(case)
    rows = []
    for stage in STAGES:
        of_stage = predicted["stages"][stage]
        rows.append(_row(f"{stage}, core seconds", of_stage["core_s"], watch.cpu_s[stage]))
    rows.append(_row("whole job, core seconds", predicted["core_s"], sum(watch.cpu_s.values())))
    wall = predicted["wall_s"][str(WORKERS)]
    rows.append(_row(f"whole job with {WORKERS} workers, seconds", wall, wall_s))
    for stage in STAGES:
        of_stage = predicted["stages"][stage]
        held = of_stage["worker_bytes"]
        if stage in watch.held_bytes:  # a stage may be over before anyone looks
            row = _row(f"{stage}, a worker, MB", _exactly(held), watch.held_bytes[stage], 1e6)
            rows.append(row)
    rows.append(_row("postings", _postings(predicted), report.generation.n_postings))
    rows.append(_row("folder, MB", predicted["folder_bytes"], watch.folder_bytes, 1e6))
    rows.append(_row("index, MB", predicted["index_bytes"]["all"], report.bytes_on_disk, 1e6))
    return rows, report.generation.n_images


def _row(
    name: str, predicted: dict[str, float], happened: float, unit: float = 1.0
) -> tuple[str, ...]:
    low, likely, high = (predicted[key] / unit for key in ("low", "likely", "high"))
    ratio = predicted["likely"] / happened if happened else float("nan")
    between = f"{low:,.1f} - {high:,.1f}"
    return (name, f"{likely:,.1f}", between, f"{happened / unit:,.1f}", f"{ratio:.2f}")


def _exactly(value: float) -> dict[str, float]:
    return dict.fromkeys(("low", "likely", "high"), value)


def _postings(predicted: dict[str, Any]) -> dict[str, float]:
    channels = predicted["channels"].values()
    return {
        key: sum(channel["postings"][key] for channel in channels)
        for key in ("low", "likely", "high")
    }


def _each_worker(measure: Callable[[psutil.Process], float]) -> list[Any]:
    """A figure of each Python process that this one began."""
    found = []
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess, psutil.ZombieProcess):
            if "python" in process.name():
                found.append(measure(process))
    return found


def _own_bytes(process: psutil.Process) -> int:
    """Without libraries and mapped files, which processes share."""
    memory = process.memory_info()
    return int(memory.rss - memory.shared)


def _cpu_s() -> float:
    def spent(process: psutil.Process) -> float:
        times = process.cpu_times()
        return float(times.user + times.system)

    return sum(_each_worker(spent))


def _bytes_of(folder: Path) -> int:
    total = 0
    for path in folder.rglob("*"):
        with suppress(OSError):  # renamed or removed meanwhile
            total += path.stat().st_size if path.is_file() else 0
    return total
