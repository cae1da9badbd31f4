"""Merge: all shards' partial indices of a channel become its segment."""

import numpy as np

from contracts.records import Receipt
from index.codebooks import codebook_paths
from index.files import map_array
from index.jobs import JobFolder
from index.segments import segment_paths, write_segment
from workers.stages.extract import instruction_set

WORDS_AT_ONCE = 65_536


def merge_channel(job: JobFolder, channel: str, n_images: int) -> Receipt:
    """Write the segment of one channel. n_images : readable images of the whole job."""
    plan = job.read_plan()
    words = map_array(codebook_paths(job.root, plan.segment, channel)["words"], np.uint8, 2)
    written, n_postings = write_segment(
        segment_paths(job.root, plan.segment, channel),
        [job.partial(shard, channel) for shard in range(plan.n_shards)],
        n_words=len(words),
        n_images=n_images,
        words_at_once=WORDS_AT_ONCE,
    )
    receipt = Receipt(
        stage="merge",
        key=channel,
        outputs={job.relative(path): digest for path, digest in written.items()},
        counts={"postings": n_postings},
        instruction_set=instruction_set(),
    )
    job.write_receipt(receipt)
    return receipt
