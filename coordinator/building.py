"""The stages of a job: what is missing of extract, train, assign, merge and join, in order."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from itertools import accumulate

from contracts.errors import BadIndex, BadSurvey
from contracts.progress import Progress
from coordinator.events import Order
from coordinator.follow import Follower
from index.jobs import JobFolder, JobPlan
from retrieval.merging import word_ranges
from workers.messages import job_message

STAGES = ("extract", "train", "assign", "merge", "join")


class NothingReadable(BadSurvey):
    """Not one image of a job can be read."""


def build(job: JobFolder, plan: JobPlan, follower: Follower, progress: Progress) -> int:
    """Turn shards of images into a segment; returns how many images were extracted just now.

    Raises
    ------
    NothingReadable : no image can be read. BadIndex : existing words are damaged.
    TaskFailed : a task failed.
    """
    channels = plan.config.features.channels()
    shards = range(plan.n_shards)
    untrained = [name for name in channels if not job.valid_receipt("train", name)]
    if untrained and not plan.trains:
        raise BadIndex(
            f"The words of {untrained[0]} in {job.root / 'codebooks' / plan.codebooks} are not "
            "what they were. Restore them, or index again."
        )
    unassigned = [n for n in shards if untrained or not job.valid_receipt("assign", f"{n:06d}")]
    # The features of an assigned shard are gone; they are needed again only to train.
    needed = list(shards) if untrained else unassigned
    missing = [n for n in needed if not job.valid_receipt("extract", f"{n:06d}")]

    extracts = [Order("extract", f"{n:06d}", job_message(job, plan, shard=n)) for n in missing]
    _drain(_run(follower, progress, "extract", len(shards), extracts))
    trains = [Order("train", name, job_message(job, plan, channel=name)) for name in untrained]
    indexed = [len(job.read_indexed(shard)) for shard in shards]
    if not any(indexed):
        raise NothingReadable(
            f"Not one of the {plan.n_images} images can be read; see {job.path / 'receipts'}. "
            "Check the survey's files."
        )
    if plan.trains:
        _drain(_run(follower, progress, "train", len(channels), trains))

    # Ids are dense over the readable images: each shard begins where the former one ended.
    first_ids = [0, *accumulate(indexed)]
    assigns = [
        Order("assign", f"{n:06d}", job_message(job, plan, shard=n, first_image_id=first_ids[n]))
        for n in unassigned
    ]
    for order in _run(follower, progress, "assign", len(shards), assigns):
        job.features(int(order.key)).unlink(missing_ok=True)
    assigned = assigned_counts(job, plan)
    points = {name: assigned[f"{name}/points"] for name in channels}
    merge(job, plan, points, sum(indexed), follower, progress, bool(unassigned))
    return sum(indexed[shard] for shard in missing)


def is_built(job: JobFolder, plan: JobPlan) -> bool:
    """Whether the segment is there, whatever has been cleared away since."""
    return all(
        job.valid_receipt("train", name) and job.valid_receipt("join", name)
        for name in plan.config.features.channels()
    )


def merge(
    job: JobFolder,
    plan: JobPlan,
    n_postings: Mapping[str, int],
    n_images: int,
    follower: Follower,
    progress: Progress,
    afresh: bool,
) -> None:
    """Merge the partials (or segments) of every channel, a range of words at a time, and join.

    n_postings : by channel, or an upper bound. n_images : of the segment to be.
    afresh : what was merged before does not count.
    """
    unjoined = [
        name
        for name in plan.config.features.channels()
        if afresh or not job.valid_receipt("join", name)
    ]
    merges: list[Order] = []
    joins: list[Order] = []
    for channel in unjoined:
        ranges = word_ranges(_n_words(job, channel), n_postings[channel])
        for first, stop in ranges:
            key = f"{channel}.{first:07d}"
            if afresh or not job.valid_receipt("merge", key):
                words = {"first_word": first, "stop_word": stop}
                message = job_message(job, plan, channel=channel, n_images=n_images, **words)
                merges.append(Order("merge", key, message))
        pieces = [first for first, _ in ranges]
        message = job_message(job, plan, channel=channel, n_images=n_images, first_words=pieces)
        joins.append(Order("join", channel, message))
    _drain(_run(follower, progress, "merge", len(merges), merges))
    _drain(_run(follower, progress, "join", len(plan.config.features.channels()), joins))


def assigned_counts(job: JobFolder, plan: JobPlan) -> Counter[str]:
    """What assigning counted in all shards: for each channel `/points` and `/sq_dist`."""
    counts: Counter[str] = Counter()
    for shard in range(plan.n_shards):
        receipt = job.read_receipt("assign", f"{shard:06d}")
        if receipt is None:
            raise BadIndex(f"{job.path} lacks the receipt of shard {shard}. Run it again.")
        counts.update(receipt.counts)
    return counts


def quantisation_of(job: JobFolder, plan: JobPlan) -> dict[str, float]:
    """By channel, the mean squared distance of all descriptors to their words."""
    counts = assigned_counts(job, plan)
    return {
        name: counts[f"{name}/sq_dist"] / max(counts[f"{name}/points"], 1)
        for name in plan.config.features.channels()
    }


def _run(
    follower: Follower, progress: Progress, stage: str, total: int, orders: list[Order]
) -> Iterator[Order]:
    progress.begin(stage, total, total - len(orders))
    for order, _ in follower.results(orders):
        progress.advance(stage)
        yield order


def _drain(orders: Iterable[Order]) -> None:
    for _ in orders:
        pass


def _n_words(job: JobFolder, channel: str) -> int:
    trained = job.read_receipt("train", channel)
    if trained is None:
        raise BadIndex(f"{job.path} lacks the receipt of {channel}'s words. Run it again.")
    return trained.counts["words"]
