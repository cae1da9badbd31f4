"""Images that kill the processes that work on them: found, left out and told, and no others."""

import json
import shutil
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import pytest

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig
from coordinator import extracting, isolating
from coordinator.cli.show import Bars
from coordinator.engine.running import Engine, running_engine
from coordinator.indexing import IndexReport, run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from index.jobs import JobFolder
from survey import ReadOptions

CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff",), descriptors=("sift",), max_frames=60),
    codebooks=CodebookConfig(max_words=60),
)
IN_WORKERS = """
import os, signal, sys, time

def deadly(event, arguments):
    deed = "{deeds}/" + os.path.basename(str(arguments[0])) if event == "open" else ""
    if deed and not deed.endswith(".py") and os.path.exists(deed) and arguments[0] != deed:
        exec(open(deed).read())

sys.addaudithook(deadly)
"""
KILL = "os.kill(os.getpid(), signal.SIGKILL)"
EXHAUST = "bytearray(2 ** 62)"
HANG = "time.sleep(600)"


@dataclass(frozen=True)
class Poisoned:
    """An engine whose workers do a deed when they open an image that has one."""

    engine: Engine
    deeds: Path

    def poison(self, names: tuple[str, ...], deed: str) -> None:
        for name in names:
            (self.deeds / name).write_text(deed)


@pytest.fixture(scope="module")
def workers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Poisoned]:
    folder, deeds = tmp_path_factory.mktemp("in_workers"), tmp_path_factory.mktemp("deeds")
    (folder / "sitecustomize.py").write_text(IN_WORKERS.format(deeds=deeds))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FLANEUR_LEASE_S", "2")
        patch.setenv("PYTHONPATH", str(folder), prepend=":")
        with running_engine(None, 2) as engine:
            yield Poisoned(engine, deeds)


@pytest.fixture
def poisoned(workers: Poisoned) -> Iterator[Poisoned]:
    yield workers
    for deed in workers.deeds.iterdir():
        deed.unlink()


def index(survey: Path, root: Path, engine: Engine) -> tuple[IndexReport, JobFolder]:
    intake = read_surveys([("", survey)], ReadOptions(crs="EPSG:2154"))
    job, plan = make_plan(root, intake, CONFIG, 5)
    return run_job(job, plan, intake, nullcontext(engine), Bars(None)), job


def without(survey: Path, names: tuple[str, ...], folder: Path) -> Path:
    """The same survey, and these images are not in it."""
    shutil.copytree(survey, folder)
    for name in names:
        (folder / name).unlink()
    lines = (folder / "poses.csv").read_text().splitlines(keepends=True)
    left = [line for line in lines if not line.startswith(names)]
    (folder / "poses.csv").write_text("".join(left))
    return folder


def contents(report: IndexReport, root: Path) -> dict[str, bytes]:
    """The words and postings, by name."""
    names = (name for name in report.generation.files if not name.startswith("catalogue"))
    return {name: (root / name).read_bytes() for name in names}


def test_an_image_that_exhausts_its_worker_is_left_out(
    small_survey: Path, tmp_path: Path, poisoned: Poisoned
) -> None:
    poisoned.poison(("06.jpg",), EXHAUST)
    report, _ = index(small_survey, tmp_path / "index", poisoned.engine)
    assert [(each.uri, each.reason) for each in report.skipped] == [
        ("06.jpg", "no worker could work on it: it needs more memory than its worker may have.")
    ]
    assert report.generation.n_images == 9


@pytest.mark.faults
def test_images_that_kill_workers_are_left_out_and_the_rest_is_as_if_they_were_not_there(
    small_survey: Path, tmp_path: Path, poisoned: Poisoned
) -> None:
    poison = ("01.jpg", "03.jpg", "08.jpg")
    clean = without(small_survey, poison, tmp_path / "clean")
    plain, _ = index(clean, tmp_path / "a", poisoned.engine)
    poisoned.poison(poison, KILL)
    report, job = index(small_survey, tmp_path / "b", poisoned.engine)
    assert contents(report, tmp_path / "b") == contents(plain, tmp_path / "a")
    skipped = json.loads((job.path / "skipped.json").read_text())
    assert [each["uri"] for each in skipped] == list(poison)
    reason = (
        "no worker could work on it: it was begun 3 times, and its worker process died each time "
        "(out of memory?). Give workers more memory."
    )
    assert {each["reason"] for each in skipped} == {reason}


@pytest.mark.faults
def test_an_image_on_which_workers_never_end_is_left_out(
    small_survey: Path, tmp_path: Path, poisoned: Poisoned, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(isolating, "IMAGE_LIMIT_S", 3.0)
    monkeypatch.setattr(extracting, "SHARD_LIMIT_S", 10.0)
    poisoned.poison(("06.jpg",), HANG)
    report, _ = index(small_survey, tmp_path / "index", poisoned.engine)
    assert [(each.uri, each.reason) for each in report.skipped] == [
        (
            "06.jpg",
            "no worker could work on it: it did not end within 3 s, and its process was killed.",
        )
    ]


def test_a_shard_whose_workers_died_for_another_reason_is_worked_on_again(
    small_survey: Path, tmp_path: Path, poisoned: Poisoned
) -> None:
    """Its workers run out of memory, but only the first time: no image of it does that."""
    poisoned.poison(("06.jpg",), f"os.unlink({str(poisoned.deeds / '06.jpg')!r}); {EXHAUST}")
    report, _ = index(small_survey, tmp_path / "index", poisoned.engine)
    assert report.skipped == ()
    assert report.generation.n_images == 10
