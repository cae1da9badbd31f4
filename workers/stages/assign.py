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
from retrieval.merging import posting_keys
from workers.stages.extract import instruction_set, read_channel


def assign_shard(job: JobFolder, shard: int, first_image_id: int) -> Receipt:
    """Write the shard's partial inverted index of every channel.

    first_image_id : id of the shard's first readable image; the others follow it.
    """
    plan = job.read_plan()
    outputs: dict[str, str] = {}
    counts = {"postings": 0, "first_image_id": first_image_id}
    for channel in plan.config.features.channels():
        trained = job.awaited_receipt("train", channel)
        if trained is None:
            raise TaskFailed(f"Shard {shard}: the codebook of {channel} has no receipt.")
        paths = codebook_paths(job.root, plan.codebooks, channel)
        digest = trained.outputs[job.relative(paths["search"])]
        searcher = _searcher(job.root, plan.codebooks, channel, digest)
        n_words, dimensions = searcher.codebook.words.shape
        images = read_channel(job.features(shard), channel)
        # All at once: the search goes through the words list by list for thousands of descriptors.
        none = np.zeros((0, dimensions), dtype=np.uint8)
        word_ids, sq_dist = searcher.nearest(np.concatenate([none, *images]), 1)
        image_ids = first_image_id + np.arange(len(images), dtype=np.uint32)
        of_descriptor = np.repeat(image_ids, [len(descriptors) for descriptors in images])
        of_word = of_descriptor[: word_ids.size]  # none, in a channel without words
        keys = posting_keys(word_ids.reshape(-1), of_word, n_words)
        path = job.partial(shard, channel)
        outputs[job.relative(path)] = write_array(path, keys)
        counts["postings"] += len(keys)
        counts[f"{channel}/points"] = len(word_ids)
        counts[f"{channel}/sq_dist"] = int(sq_dist.sum(dtype=np.float64))
    receipt = Receipt(
        stage="assign",
        key=f"{shard:06d}",
        outputs=outputs,
        counts=counts,
        instruction_set=instruction_set(),
        made_from=job.words_digest(plan.config.features.channels()),
    )
    job.write_receipt(receipt)
    return receipt


@lru_cache(maxsize=32)
def _searcher(root: Path, codebooks: str, channel: str, digest: str) -> WordSearcher:
    """Codebooks stay open between the shards that a process works on.

    Their words are mapped and shared; a process holds some 5 bytes a word of its own.
    """
    return read_searcher(codebook_paths(root, codebooks, channel), digest)
