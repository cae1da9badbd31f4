"""Train: a deterministic sample of all shards' features becomes a channel's codebook."""

import numpy as np
from numpy.typing import NDArray

from contracts.records import Receipt
from index.codebooks import codebook_paths, write_codebook
from index.files import read_member
from index.jobs import JobFolder, JobPlan
from retrieval.codebooks import n_words_for, train_codebook
from retrieval.sampling import SampleReservoir
from workers.stages.extract import instruction_set
from workers.stages.sample import keys_of, read_sample


def train_channel(job: JobFolder, channel: str, n_threads: int = 1) -> Receipt:
    """Write the codebook of one channel. n_threads : the bytes do not depend on them."""
    plan = job.read_plan()
    config = plan.config.codebooks
    reservoir, n_points = _sampled(job, plan, channel)
    n_words = n_words_for(n_points, config)
    codebook = train_codebook(reservoir.sample(), n_words, config.seed, n_threads)
    paths = codebook_paths(job.root, plan.codebooks, channel)
    outputs = {
        job.relative(path): digest for path, digest in write_codebook(paths, codebook).items()
    }
    receipt = Receipt(
        stage="train",
        key=channel,
        outputs=outputs,
        counts={"words": len(codebook.words), "points": n_points},
        instruction_set=instruction_set(),
    )
    job.write_receipt(receipt)
    return receipt


def _sampled(job: JobFolder, plan: JobPlan, channel: str) -> tuple[SampleReservoir, int]:
    """The sample of all shards, and how many descriptors there are in all."""
    reservoir = SampleReservoir(plan.config.codebooks.max_train_points)
    n_points = 0
    limits: list[int] = []
    for shard in range(plan.n_shards):
        aside = read_sample(job.features(shard), channel)
        reservoir.offer(aside.keys, aside.descriptors)
        limits.append(aside.limit)
        n_points += aside.n_points
    for shard, limit in enumerate(limits):
        # A shard of few images, or with far more descriptors than others, put too few aside.
        if reservoir.may_use(limit):
            keys, descriptors = _all_of(job, plan, shard, channel)
            others = keys >= np.uint64(limit)
            reservoir.offer(keys[others], descriptors[others])
    return reservoir, n_points


def _all_of(
    job: JobFolder, plan: JobPlan, shard: int, channel: str
) -> tuple[NDArray[np.uint64], NDArray[np.uint8]]:
    path = job.features(shard)
    counts = read_member(path, f"{channel.split('-')[0]}/counts", np.int32, 1)
    keys = keys_of(job.read_indexed(shard), counts, plan.config)
    return keys, read_member(path, channel, np.uint8, 2)
