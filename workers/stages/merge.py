"""Merge: a range of words of one channel, from all shards or from segments to be compacted."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from contracts.records import Receipt
from index.codebooks import count_words
from index.files import map_array
from index.jobs import JobFolder, JobPlan
from index.segments import map_segment, segment_paths, write_piece
from retrieval.merging import keys_of_words, merge_keys, renumbered_keys
from retrieval.packing import Part, unpack
from workers.stages.extract import instruction_set


def merge_words(job: JobFolder, channel: str, words: range, n_images: int) -> Receipt:
    """Write the piece of a channel's `words`. n_images : of the segment to be."""
    plan = job.read_plan()
    runs = _of_segments if plan.compacts else _of_shards
    merged = merge_keys(list(runs(job, plan, channel, words)), words.start, len(words))
    path = job.piece(channel, words.start)
    receipt = Receipt(
        stage="merge",
        key=f"{channel}.{words.start:07d}",
        outputs={job.relative(path): write_piece(path, merged, n_images)},
        counts={"postings": len(merged.image_ids)},
        instruction_set=instruction_set(),
    )
    job.write_receipt(receipt)
    return receipt


def _of_shards(
    job: JobFolder, plan: JobPlan, channel: str, words: range
) -> Iterator[NDArray[np.uint64]]:
    for shard in range(plan.n_shards):
        keys = map_array(job.partial(shard, channel), np.uint64, 1)
        # Copied, as a process may not hold maps of as many files as there are shards.
        yield keys_of_words(keys, words.start, words.stop).copy()


def _of_segments(
    job: JobFolder, plan: JobPlan, channel: str, words: range
) -> Iterator[NDArray[np.uint64]]:
    n_words = count_words(job.root, plan.codebooks, channel)
    for segment in plan.compacts:
        new_ids = map_array(job.new_ids(segment), np.int64, 1)
        paths = segment_paths(job.root, segment, channel)
        part = Part(map_segment(paths, n_words, len(new_ids)), 0, len(new_ids))
        lists = unpack([part], np.arange(words.start, words.stop))
        yield renumbered_keys(lists, words.start, new_ids)
