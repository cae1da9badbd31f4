"""Real workers run every task twice, side by side, in other shards and ranges: the same bytes."""

from collections.abc import Mapping
from contextlib import nullcontext
from pathlib import Path

import pytest

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig
from coordinator.cli.show import Bars
from coordinator.engine.running import Engine
from coordinator.following.courier import RedisCourier
from coordinator.following.events import Order
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

    send = RedisCourier.send
    delivered: list[str] = []

    def send_twice(self: RedisCourier, orders: Mapping[str, Order]) -> None:
        send(self, orders)
        send(self, {f"{task_id}.again": order for task_id, order in orders.items()})
        delivered.extend(order.name for order in orders.values())

    monkeypatch.setattr(RedisCourier, "send", send_twice)
    monkeypatch.setattr(merging, "POSTINGS_AT_ONCE", 300)
    assert index(small_survey, tmp_path / "twice", engine, shard_size=3) == once
    assert {name: delivered.count(name) for name in ("extract", "train", "assign", "join")} == {
        "extract": 4,
        "train": 4,
        "assign": 4,
        "join": 4,
    }
    assert delivered.count("merge") >= 8
