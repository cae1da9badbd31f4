"""Merging, joining and hashing by the workers' own stages, on partial indices that are made up."""

import hashlib
import tempfile
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.scaling.measured import Pieces
from contracts.config import FeatureConfig, IndexConfig
from index.codebooks import codebook_paths
from index.files import write_array
from index.jobs import JobFolder, JobPlan
from retrieval.codebooks import train_codebook
from workers.stages.join import join_channel
from workers.stages.merge import merge_words

_CHANNEL = "hesaff-sift"
_N_WORDS, _SHARD_SIZE = 20_000, 16
_N_SHARDS, _POSTINGS_A_SHARD = 400, 20_000
_RANGES = 16
_HASHED = 1 << 28
_MIDDLES, _DIMENSIONS = 3000, 64
_N_POINTS, _TRAINED = 120_000, 8000


def measure_pieces() -> Pieces:
    """Merge the same partial indices in one range of words and in many."""
    with tempfile.TemporaryDirectory() as scratch:
        job = _made_job(Path(scratch))
        _merge(job, 1)  # loads what a worker has loaded
        at_once, n_postings = _merge(job, 1)
        in_ranges, _ = _merge(job, _RANGES)
        run_s = max(in_ranges - at_once, 0.0) / ((_RANGES - 1) * _N_SHARDS)
        began = time.perf_counter()
        joined = join_channel(job, _CHANNEL, _bounds(_RANGES)[:-1], _N_SHARDS * _SHARD_SIZE)
        join_s = time.perf_counter() - began
        n_bytes = sum((job.root / name).stat().st_size for name in joined.outputs)
    return Pieces(
        posting_s=max(at_once - run_s * _N_SHARDS, 0.0) / n_postings,
        run_s=run_s,
        join_byte_s=join_s / n_bytes,
        posting_bytes=n_bytes / n_postings,
        digest_byte_s=_digest_s() / _HASHED,
        train_alone=_train_alone(),
    )


def _merge(job: JobFolder, n_ranges: int) -> tuple[float, int]:
    """Seconds to merge all words, and how many postings they have."""
    began = time.perf_counter()
    n_postings = 0
    for first, stop in pairwise(_bounds(n_ranges)):
        receipt = merge_words(job, _CHANNEL, range(first, stop), _N_SHARDS * _SHARD_SIZE)
        n_postings += receipt.counts["postings"]
    return time.perf_counter() - began, n_postings


def _bounds(n_ranges: int) -> list[int]:
    return [_N_WORDS * number // n_ranges for number in range(n_ranges + 1)]


def _made_job(root: Path) -> JobFolder:
    config = IndexConfig(features=FeatureConfig(detectors=("hesaff",), descriptors=("sift",)))
    job = JobFolder(root, "0" * 16)
    plan = JobPlan(
        job=job.job,
        verb="index",
        config=config,
        config_digest=config.digest(),
        segment="0001",
        codebooks="0001",
        trains=True,
        n_images=_N_SHARDS * _SHARD_SIZE,
        shard_size=_SHARD_SIZE,
        n_shards=_N_SHARDS,
    )
    job.write_plan(plan, ())
    words = codebook_paths(root, "0001", _CHANNEL)["words"]
    write_array(words, np.zeros((_N_WORDS, 1), dtype=np.uint8))
    rng = np.random.default_rng(0)
    for shard in range(_N_SHARDS):
        word_ids = rng.integers(0, _N_WORDS, _POSTINGS_A_SHARD).astype(np.uint64)
        images = rng.integers(0, _SHARD_SIZE, _POSTINGS_A_SHARD) + shard * _SHARD_SIZE
        keys = np.unique(word_ids << np.uint64(32) | images.astype(np.uint64))
        write_array(job.partial(shard, _CHANNEL), keys)
    return job


def _digest_s() -> float:
    block = bytes(_HASHED)
    began = time.perf_counter()
    hashlib.sha256(block).hexdigest()
    return time.perf_counter() - began


def _train_alone() -> float:
    """By Amdahl's law, from training by one thread and by two."""
    rng = np.random.default_rng(0)
    middles = rng.integers(0, 256, (_MIDDLES, _DIMENSIONS))
    points = middles[rng.integers(0, _MIDDLES, _N_POINTS)]
    points += rng.normal(0, 20, points.shape).astype(np.int64)
    sample = np.clip(points, 0, 255).astype(np.uint8)
    took = []
    for n_threads in (1, 1, 2):  # the first one loads what a worker has loaded
        began = time.perf_counter()
        train_codebook(sample, _TRAINED, 0, n_threads)
        took.append(time.perf_counter() - began)
    return min(max(2 * took[2] / took[1] - 1, 0.0), 1.0)
