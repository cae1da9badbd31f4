"""Join: the merged pieces of a channel, end to end, become its part of the segment."""

from collections.abc import Sequence

from contracts.records import Receipt
from index.codebooks import count_words
from index.jobs import JobFolder
from index.segments import join_pieces, segment_paths
from workers.stages.extract import instruction_set


def join_channel(
    job: JobFolder, channel: str, first_words: Sequence[int], n_images: int
) -> Receipt:
    """Write one channel of the segment. first_words : of each piece, ascending."""
    plan = job.read_plan()
    written, n_postings = join_pieces(
        segment_paths(job.root, plan.segment, channel),
        [job.piece(channel, first) for first in first_words],
        n_words=count_words(job.root, plan.codebooks, channel),
        n_images=n_images,
    )
    receipt = Receipt(
        stage="join",
        key=channel,
        outputs={job.relative(path): digest for path, digest in written.items()},
        counts={"postings": n_postings},
        instruction_set=instruction_set(),
    )
    job.write_receipt(receipt)
    return receipt
