"""Assign: each descriptor of a shard goes to its nearest word: the shard's partial indices."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from contracts.errors import TaskFailed
from contracts.records import Receipt
from index.codebooks import codebook_paths, read_searcher
from index.files import write_array
from index.jobs import JobFolder
from retrieval.codebooks import WordSearcher
from retrieval.postings import build_postings
from workers.stages.extract import instruction_set, read_channel


def assign_shard(job: JobFolder, shard: int, first_image_id: int) -> Receipt:
    """Write the shard's partial inverted index of every channel.

    first_image_id : id of the shard's first readable image; the others follow it.
    """
    plan = job.read_plan()
    outputs: dict[str, str] = {}
    n_postings = 0
    for channel in plan.config.features.channels():
        trained = job.read_receipt("train", channel)
        if trained is None:
            raise TaskFailed(f"Shard {shard}: the codebook of {channel} has no receipt.")
        paths = codebook_paths(job.root, plan.segment, channel)
        digest = trained.outputs[job.relative(paths["search"])]
        searcher = _searcher(job.root, plan.segment, channel, digest)
        words: list[np.ndarray] = [np.zeros(0, dtype=np.int32)]
        image_ids: list[np.ndarray] = [np.zeros(0, dtype=np.uint32)]
        for offset, descriptors in enumerate(read_channel(job.features(shard), channel)):
            nearest, _ = searcher.nearest(descriptors, 1)
            words.append(nearest.ravel())
            image_ids.append(np.full(len(descriptors), first_image_id + offset, dtype=np.uint32))
        postings = build_postings(
            np.concatenate(words), np.concatenate(image_ids), len(searcher.codebook.words)
        )
        indptr_path, ids_path = job.partial(shard, channel)
        outputs[job.relative(indptr_path)] = write_array(indptr_path, postings.indptr)
        outputs[job.relative(ids_path)] = write_array(ids_path, postings.image_ids)
        n_postings += len(postings.image_ids)
    receipt = Receipt(
        stage="assign",
        key=f"{shard:06d}",
        outputs=outputs,
        counts={"postings": n_postings, "first_image_id": first_image_id},
        instruction_set=instruction_set(),
    )
    job.write_receipt(receipt)
    return receipt


@lru_cache(maxsize=32)
def _searcher(root: Path, segment: str, channel: str, digest: str) -> WordSearcher:
    """Codebooks stay open between the shards that a process works on."""
    return read_searcher(codebook_paths(root, segment, channel), digest)
