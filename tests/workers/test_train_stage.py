"""A channel's words come of a sample that knows nothing of shards, and is of bounded size."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig
from index.codebooks import codebook_paths
from index.files import write_arrays
from index.jobs import IndexedImage, JobFolder, JobPlan
from retrieval.sampling import SampleReservoir
from workers.stages import train
from workers.stages.sample import put_aside
from workers.stages.train import train_channel

CHANNEL, N_IMAGES, MOST = "hesaff-sc", 12, 150
CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff",), descriptors=("sc",)),
    codebooks=CodebookConfig(max_words=40, max_train_points=MOST),
)
RNG = np.random.default_rng(0)
DESCRIBED = [RNG.integers(0, 200, (n, 36), dtype=np.uint8) for n in RNG.integers(0, 90, N_IMAGES)]


def words_of(root: Path, order: list[int], shard_size: int) -> list[bytes]:
    """Train from images in some order, cut into shards; the bytes of the codebook's files."""
    shards = [order[at : at + shard_size] for at in range(0, N_IMAGES, shard_size)]
    job = JobFolder(root, "0" * 16)
    plan = JobPlan(
        job=job.job,
        verb="index",
        config=CONFIG,
        config_digest=CONFIG.digest(),
        segment="0001",
        codebooks="0001",
        trains=True,
        n_images=N_IMAGES,
        shard_size=shard_size,
        n_shards=len(shards),
    )
    job.write_plan(plan, ())
    for number, images in enumerate(shards):
        digests = [hashlib.sha256(bytes([image])).hexdigest() for image in images]
        indexed = [IndexedImage(row, digest, 9, 9) for row, digest in enumerate(digests)]
        job.write_indexed(number, indexed)
        described = [DESCRIBED[image] for image in images]
        arrays: dict[str, NDArray[np.generic]] = {
            "hesaff/counts": np.array([len(each) for each in described], dtype=np.int32),
            CHANNEL: np.concatenate(described),
        }
        write_arrays(job.features(number), {**arrays, **put_aside(indexed, arrays, plan)})
    receipt = train_channel(job, CHANNEL)
    assert job.valid_receipt("train", CHANNEL) == receipt
    assert receipt.counts == {"words": 40, "points": sum(map(len, DESCRIBED))}
    return [path.read_bytes() for path in codebook_paths(root, "0001", CHANNEL).values()]


def test_words_are_the_same_bytes_whatever_the_shards_and_their_order(tmp_path: Path) -> None:
    assert sum(map(len, DESCRIBED)) > 2 * MOST
    order = list(range(N_IMAGES))
    once = words_of(tmp_path / "once", order, N_IMAGES)
    assert words_of(tmp_path / "apart", order, 1) == once
    assert words_of(tmp_path / "fives", order[::-1], 5) == once
    assert words_of(tmp_path / "fives", order[::-1], 5) == once, "delivered again"


def test_no_more_points_are_held_than_the_configuration_allows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes: list[int] = []

    class Watched(SampleReservoir):
        def sample(self) -> NDArray[np.uint8]:
            sizes.append(len(found := super().sample()))
            return found

    monkeypatch.setattr(train, "SampleReservoir", Watched)
    words_of(tmp_path, list(range(N_IMAGES)), 5)
    assert sizes == [MOST]


@pytest.mark.parametrize("dense", [1, 30])
def test_a_large_survey_is_trained_from_what_shards_put_aside(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dense: int
) -> None:
    """dense : how many times as many descriptors the first image has as any other."""
    sizes = [300 * dense, *[300] * (N_IMAGES - 1)]
    described = [RNG.integers(0, 200, (size, 36), dtype=np.uint8) for size in sizes]
    read_whole: list[int] = []
    whole = train._all_of

    def watched(
        job: JobFolder, plan: JobPlan, shard: int, channel: str
    ) -> tuple[NDArray[np.uint64], NDArray[np.uint8]]:
        read_whole.append(shard)
        return whole(job, plan, shard, channel)

    monkeypatch.setattr(train, "_all_of", watched)
    monkeypatch.setattr("test_train_stage.DESCRIBED", described)
    order = list(range(N_IMAGES))
    found = words_of(tmp_path / "aside", order, 1)
    assert read_whole == ([0] if dense > 1 else [])
    monkeypatch.setattr("retrieval.sampling._WORTH_PUTTING_ASIDE", 0.0)
    assert words_of(tmp_path / "whole", order, 1) == found
    assert sorted(read_whole[-N_IMAGES:]) == order
