"""The tasks of a job of any size, from what was measured on a small one."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.scaling.measured import Channel, Measured, RealJob
from contracts.config import CodebookConfig
from coordinator.forecast import costs
from retrieval.codebooks import n_words_for
from retrieval.merging import word_ranges
from retrieval.sampling import share_put_aside
from workers.tasks import MOST_THREADS

KEY_BYTES = 8
_WORDS = CodebookConfig()


@dataclass(frozen=True, slots=True)
class Task:
    """seconds : of a core. read, written : bytes in the shared folder. opened : files there."""

    seconds: float
    read: float
    written: float
    opened: int


@dataclass(frozen=True, slots=True)
class Layout:
    """How a survey is cut, and for how many workers.

    puts_aside : shards put aside what training may need. threaded : training uses processes that
    wait for it.
    """

    n_images: int
    shard_size: int
    n_workers: int = 1
    puts_aside: bool = True
    threaded: bool = True

    @property
    def n_shards(self) -> int:
        return -(-self.n_images // self.shard_size)


@dataclass(frozen=True, slots=True)
class Work:
    """A job as tasks by stage, and what its coordinator does alone before and after."""

    stages: dict[str, list[Task]]
    plan_s: float
    commit_s: float

    @property
    def core_s(self) -> float:
        """Seconds of all its tasks."""
        return sum(task.seconds for tasks in self.stages.values() for task in tasks)


def work_of(measured: Measured, layout: Layout) -> Work:
    """The tasks of indexing a survey like the one that was measured."""
    job = measured.jobs[0]
    channels = [_grown(channel, job, layout) for channel in job.channels]
    stages = {
        "extract": list(_extract(measured, job, layout)),
        "train": [_train(measured, channel, layout, len(channels)) for channel in channels],
        "assign": list(_assign(job, channels, layout)),
        "merge": [task for each in channels for task in _merge(measured, each, layout)],
        "join": [_join(measured, channel) for channel in channels],
    }
    alone = measured.alone[-1]
    index_bytes = sum(channel.postings for channel in channels) * measured.pieces.posting_bytes
    return Work(
        stages,
        plan_s=alone.planned_s * layout.n_images / alone.n_images,
        commit_s=alone.committed_s * layout.n_images / alone.n_images
        + 2 * index_bytes * measured.pieces.digest_byte_s,
    )


def _grown(channel: Channel, job: RealJob, layout: Layout) -> Channel:
    """The same channel in a survey of so many images; seconds grow as they are known to."""
    points = round(channel.points / job.n_images * layout.n_images)
    words = n_words_for(points, _WORDS)
    then = costs.train_s(_sampled(channel.points), channel.words, channel.dimensions)
    now = costs.train_s(_sampled(points), words, channel.dimensions)
    postings = round(channel.postings / job.n_images * layout.n_images)
    train_s = channel.train_s * now / then if then else 0.0
    return Channel(channel.name, channel.dimensions, points, words, postings, train_s)


def _sampled(points: int) -> int:
    return min(points, _WORDS.max_train_points)


def _extract(measured: Measured, job: RealJob, layout: Layout) -> Iterator[Task]:
    """Shards of images as they came, from anywhere in the survey that was measured."""
    bare = measured.bare[0]
    with_files = sum(job.tasks["extract"].values()) / sum(bare.image_s)
    image_s = np.array(bare.image_s) * with_files
    written = sum(each.points * each.dimensions for each in job.channels) / job.n_images
    starts = np.random.default_rng(0).integers(0, len(image_s), layout.n_shards)
    for shard, start in enumerate(starts.tolist()):
        size = min(layout.shard_size, layout.n_images - shard * layout.shard_size)
        rows = (start + np.arange(size)) % len(image_s)
        yield Task(
            seconds=float(image_s[rows].sum()),
            read=size * measured.image_bytes,
            written=size * written,
            opened=size + 3,
        )


def _train(measured: Measured, channel: Channel, layout: Layout, n_channels: int) -> Task:
    share = share_put_aside(channel.points, _WORDS.max_train_points) if layout.puts_aside else 0.0
    read = (share or 1.0) * channel.points * channel.dimensions
    threads = min(max(layout.n_workers // n_channels, 1), MOST_THREADS) if layout.threaded else 1
    alone = measured.pieces.train_alone
    seconds = channel.train_s * (alone + (1 - alone) / threads) + read * costs.READ_S_A_BYTE
    seconds += layout.n_shards * costs.SAMPLE_S_A_SHARD
    if not share:
        seconds += layout.n_images * costs.SAMPLE_S_AN_IMAGE
    return Task(seconds, read, channel.words * channel.dimensions, layout.n_shards)


def _assign(job: RealJob, channels: list[Channel], layout: Layout) -> Iterator[Task]:
    pairs = list(zip(job.channels, channels, strict=True))
    then = sum(each.points * costs.assign_s(each.words, each.dimensions) for each, _ in pairs)
    now = sum(each.points * costs.assign_s(more.words, each.dimensions) for each, more in pairs)
    image_s = sum(job.tasks["assign"].values()) / job.n_images * now / then
    read = sum(each.points * each.dimensions for each in job.channels) / job.n_images
    written = sum(each.postings * KEY_BYTES for each in job.channels) / job.n_images
    for shard in range(layout.n_shards):
        size = min(layout.shard_size, layout.n_images - shard * layout.shard_size)
        yield Task(size * image_s, size * read, size * written, 2 + len(channels))


def _merge(measured: Measured, channel: Channel, layout: Layout) -> Iterator[Task]:
    ranges = word_ranges(channel.words, channel.points)
    pieces = measured.pieces
    for _ in ranges:
        postings = channel.postings / len(ranges)
        yield Task(
            seconds=postings * pieces.posting_s + layout.n_shards * pieces.run_s,
            read=postings * KEY_BYTES,
            written=postings * pieces.posting_bytes,
            opened=layout.n_shards,
        )


def _join(measured: Measured, channel: Channel) -> Task:
    n_bytes = channel.postings * measured.pieces.posting_bytes
    opened = len(word_ranges(channel.words, channel.points))
    return Task(n_bytes * measured.pieces.join_byte_s, n_bytes, n_bytes, opened)
