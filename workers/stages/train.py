"""Train: a deterministic sample of all shards' features becomes a channel's codebook."""

from contracts.records import Receipt
from index.codebooks import codebook_paths, write_codebook
from index.jobs import JobFolder
from retrieval.codebooks import (
    SampleReservoir,
    n_words_for,
    sample_keys,
    train_codebook,
)
from workers.stages.extract import instruction_set, read_channel


def train_channel(job: JobFolder, channel: str) -> Receipt:
    """Write the codebook of one channel."""
    plan = job.read_plan()
    config = plan.config.codebooks
    reservoir = SampleReservoir(config.max_train_points)
    n_points = 0
    for shard in range(plan.n_shards):
        images = job.read_indexed(shard)
        for image, descriptors in zip(
            images, read_channel(job.features(shard), channel), strict=True
        ):
            keys = sample_keys(image.sha256, len(descriptors), config.seed)
            reservoir.offer(keys, descriptors)
            n_points += len(descriptors)
    codebook = train_codebook(reservoir.sample(), n_words_for(n_points, config), config.seed)
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
