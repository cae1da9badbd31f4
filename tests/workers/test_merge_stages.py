"""Merging shards by ranges of words, and compacting segments, give the segment of one build."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from contracts.config import IndexConfig
from contracts.errors import BadIndex
from index.codebooks import codebook_paths
from index.files import write_array
from index.jobs import JobFolder, JobPlan
from index.segments import join_pieces, segment_paths, write_piece
from retrieval.postings import build_postings, posting_keys
from workers.stages.join import join_channel
from workers.stages.merge import merge_words

CHANNEL, N_WORDS, N_IMAGES, N_SHARDS = "hesaff-sift", 30, 24, 6
PAIRS = np.random.default_rng(0).integers(0, (N_WORDS, N_IMAGES), (600, 2))


def job_of(root: Path, compacts: tuple[str, ...] = ()) -> JobFolder:
    config = IndexConfig()
    job = JobFolder(root, "0" * 16)
    plan = JobPlan(
        job=job.job,
        verb="compact" if compacts else "index",
        config=config,
        config_digest=config.digest(),
        segment="0009",
        codebooks="0001",
        trains=not compacts,
        compacts=compacts,
        n_images=N_IMAGES,
        shard_size=4,
        n_shards=0 if compacts else N_SHARDS,
    )
    job.write_plan(plan, ())
    words = codebook_paths(root, "0001", CHANNEL)["words"]
    write_array(words, np.zeros((N_WORDS, 4), dtype=np.uint8))
    return job


def columns(pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return pairs[:, 0].astype(np.int32), pairs[:, 1].astype(np.uint32)


def write_partials(job: JobFolder) -> None:
    for shard in range(N_SHARDS):
        mine = PAIRS[PAIRS[:, 1] // 4 == shard]
        write_array(job.partial(shard, CHANNEL), posting_keys(*columns(mine), N_WORDS))


def segment_at_once(root: Path, name: str, pairs: np.ndarray, n_images: int) -> list[bytes]:
    piece = root / "piece.npz"
    write_piece(piece, build_postings(*columns(pairs), N_WORDS), n_images)
    written, _ = join_pieces(segment_paths(root, name, CHANNEL), [piece], N_WORDS, n_images)
    return [path.read_bytes() for path in written]


def merged(job: JobFolder, bounds: list[int]) -> list[bytes]:
    """Run the stages as the tasks do, the last range first and the first one twice."""
    ranges = [range(first, stop) for first, stop in pairwise(bounds)]
    for words in [*ranges[::-1], ranges[0]]:
        receipt = merge_words(job, CHANNEL, words, N_IMAGES)
        assert job.valid_receipt("merge", f"{CHANNEL}.{words.start:07d}") == receipt
    receipt = join_channel(job, CHANNEL, bounds[:-1], N_IMAGES)
    assert job.valid_receipt("join", CHANNEL) == receipt
    assert receipt.counts == {"postings": len(np.unique(PAIRS, axis=0))}
    return [(job.root / name).read_bytes() for name in receipt.outputs]


@pytest.mark.parametrize("bounds", [[0, 30], [0, 1, 17, 30]])
def test_shards_become_the_segment_of_one_build(tmp_path: Path, bounds: list[int]) -> None:
    job = job_of(tmp_path / "index")
    write_partials(job)
    assert merged(job, bounds) == segment_at_once(tmp_path, "0001", PAIRS, N_IMAGES)


def test_segments_become_the_segment_of_one_build(tmp_path: Path) -> None:
    """Two segments of every other image and of one that is left out."""
    root = tmp_path / "index"
    job = job_of(root, compacts=("0001", "0002"))
    for parity, name in enumerate(("0001", "0002")):
        mine = PAIRS[PAIRS[:, 1] % 2 == parity] // (1, 2) + (0, 1)
        gone = np.array([[word, 0] for word in range(0, N_WORDS, 3)])
        segment_at_once(root, name, np.concatenate([gone, mine]), 1 + N_IMAGES // 2)
        new_ids = np.concatenate([[-1], np.arange(parity, N_IMAGES, 2)])
        write_array(job.new_ids(name), new_ids)
    assert merged(job, [0, 11, 30]) == segment_at_once(tmp_path, "0001", PAIRS, N_IMAGES)


def test_a_missing_or_cut_partial_is_named(tmp_path: Path) -> None:
    job = job_of(tmp_path)
    write_partials(job)
    path = job.partial(3, CHANNEL)
    path.write_bytes(path.read_bytes()[:-5])
    with pytest.raises(BadIndex, match=r"000003\.npy"):
        merge_words(job, CHANNEL, range(N_WORDS), N_IMAGES)
    path.unlink()
    with pytest.raises(BadIndex, match=r"000003\.npy"):
        merge_words(job, CHANNEL, range(N_WORDS), N_IMAGES)


def test_a_range_that_was_not_merged_is_not_joined_over(tmp_path: Path) -> None:
    job = job_of(tmp_path)
    write_partials(job)
    merge_words(job, CHANNEL, range(10), N_IMAGES)
    merge_words(job, CHANNEL, range(20, N_WORDS), N_IMAGES)
    with pytest.raises(BadIndex, match="hold 20 words, the codebook 30"):
        join_channel(job, CHANNEL, [0, 20], N_IMAGES)
