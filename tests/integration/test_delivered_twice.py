"""Real workers run every task twice, side by side, in other shards and ranges: the same bytes."""

import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig
from coordinator.cli.show import Bars
from coordinator.engine import Engine
from coordinator.follow import Follower
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from retrieval import merging
from survey import ReadOptions

FEATURES = FeatureConfig(detectors=("hesaff", "mser"), descriptors=("sift", "sc"), max_frames=100)
CONFIG = IndexConfig(features=FEATURES, codebooks=CodebookConfig(max_words=60))


def index(survey: Path, root: Path, engine: Engine, shard_size: int) -> dict[str, bytes]:
    """The words and the segment of an index of the survey, by name."""
    intake = read_surveys([("", survey)], ReadOptions(crs="EPSG:2154"))
    job, plan = make_plan(root, intake, CONFIG, shard_size)
    report = run_job(job, plan, intake, nullcontext(engine), Bars(None))
    return {name: (root / name).read_bytes() for name in report.generation.files}


def test_tasks_delivered_twice_count_once_whatever_the_shards_and_ranges(
    small_survey: Path, engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    once = index(small_survey, tmp_path / "once", engine, shard_size=10)

    send = Follower._send
    delivered: list[str] = []

    def send_twice(self: Follower, flight) -> None:  # type: ignore[no-untyped-def]
        again = replace(flight, task_id=f"{flight.task_id}.again")
        send(self, flight)
        send(self, again)
        while not self._is_done(again):
            time.sleep(0.01)
        outcome = self._outcome(again)
        assert outcome.error is None
        delivered.append(outcome.order.name)

    monkeypatch.setattr(Follower, "_send", send_twice)
    monkeypatch.setattr(merging, "POSTINGS_AT_ONCE", 300)
    assert index(small_survey, tmp_path / "twice", engine, shard_size=3) == once
    assert {name: delivered.count(name) for name in ("extract", "train", "assign", "join")} == {
        "extract": 4,
        "train": 4,
        "assign": 4,
        "join": 4,
    }
    assert delivered.count("merge") >= 8
