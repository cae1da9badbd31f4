"""The stages of a job: what is missing of extract, train, assign, merge and join, in order.

An order is made when it is sent: a survey of millions of images has thousands of them.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from contracts.errors import BadIndex, BadSurvey
from contracts.progress import Progress
from contracts.records import Receipt
from coordinator.extracting import Shards, extract_missing
from coordinator.following.events import Order
from coordinator.following.flow import Outcome
from coordinator.following.follow import Follower, value_of
from index.jobs import JobFolder, JobPlan
from retrieval.merging import word_ranges
from workers.messages import job_message

STAGES = ("extract", "train", "assign", "merge", "join")
LONG_S = 6 * 3600.0
"""After which a task is killed that reads much of a job: one of train, merge or join."""

Orders = Iterable[Order | None]


class NothingReadable(BadSurvey):
    """Not one image of a job can be read."""


def build(job: JobFolder, plan: JobPlan, follower: Follower, progress: Progress) -> int:
    """Turn shards of images into a segment; returns how many images were extracted just now.

    Raises
    ------
    NothingReadable : no image can be read. BadIndex : existing words are damaged.
    TaskFailed : a task failed. Cancelled : that was wished.
    """
    channels = plan.config.features.channels()
    untrained = [name for name in channels if not job.valid_receipt("train", name)]
    if untrained and not plan.trains:
        raise BadIndex(
            f"The words of {untrained[0]} in {job.root / 'codebooks' / plan.codebooks} are not "
            "what they were. Restore them, or index again."
        )
    shards = Shards.unknown(plan.n_shards)
    # The features of an assigned shard are gone; they are needed again only to train.
    words = "" if untrained else job.words_digest(channels)
    extracted = extract_missing(job, plan, shards, words, follower, progress)
    if not shards.n_images.any():
        raise NothingReadable(
            f"Not one of the {plan.n_images} images can be read; see {job.path / 'receipts'}. "
            "Check the survey's files."
        )
    if plan.trains:
        _train(job, plan, untrained, follower, progress)
    counts, anew = _assign(job, plan, shards, follower, progress)
    points = {name: counts[f"{name}/points"] for name in channels}
    merge(job, plan, points, int(shards.n_images.sum()), follower, progress, anew)
    return extracted


def is_built(job: JobFolder, plan: JobPlan) -> bool:
    """Whether the segment is there, whatever has been cleared away since."""
    return all(
        job.valid_receipt("train", name) and job.valid_receipt("join", name)
        for name in plan.config.features.channels()
    )


def _train(
    job: JobFolder,
    plan: JobPlan,
    untrained: Sequence[str],
    follower: Follower,
    progress: Progress,
) -> None:
    n_channels = len(plan.config.features.channels())
    progress.begin("train", n_channels, n_channels - len(untrained))
    orders = (
        Order("train", name, job_message(job, plan, channel=name), LONG_S) for name in untrained
    )
    for _ in _done(follower, orders, progress, "train"):
        pass


def _assign(
    job: JobFolder, plan: JobPlan, shards: Shards, follower: Follower, progress: Progress
) -> tuple[Counter[str], bool]:
    """Assign what is not; returns what was counted in all shards, and whether any was missing."""
    counts: Counter[str] = Counter()
    first_ids = shards.first_ids()

    def orders() -> Iterator[Order | None]:
        for shard in range(plan.n_shards):
            if shards.is_assigned(shard):
                counts.update(_receipt(job, "assign", f"{shard:06d}").counts)
                progress.advance("assign")
                yield None
            else:
                first_id = int(first_ids[shard])
                message = job_message(job, plan, shard=shard, first_image_id=first_id)
                yield Order("assign", f"{shard:06d}", message)

    progress.begin("assign", plan.n_shards, 0)
    for outcome in _done(follower, orders(), progress, "assign"):
        counts.update(value_of(outcome)["counts"])
        job.features(int(outcome.order.key)).unlink(missing_ok=True)
    return counts, not shards.all_assigned


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
    channels = plan.config.features.channels()
    unjoined = [name for name in channels if afresh or not job.valid_receipt("join", name)]
    ranges = {
        name: word_ranges(_receipt(job, "train", name).counts["words"], n_postings[name])
        for name in unjoined
    }

    def merges() -> Iterator[Order | None]:
        for channel, of_channel in ranges.items():
            for first, stop in of_channel:
                key = f"{channel}.{first:07d}"
                if not afresh and job.valid_receipt("merge", key):
                    progress.advance("merge")
                    yield None
                    continue
                words = {"first_word": first, "stop_word": stop}
                message = job_message(job, plan, channel=channel, n_images=n_images, **words)
                yield Order("merge", key, message, LONG_S)

    progress.begin("merge", sum(map(len, ranges.values())), 0)
    for _ in _done(follower, merges(), progress, "merge"):
        pass
    joins = (
        Order(
            "join",
            channel,
            job_message(
                job,
                plan,
                channel=channel,
                n_images=n_images,
                first_words=[first for first, _ in of_channel],
            ),
            LONG_S,
        )
        for channel, of_channel in ranges.items()
    )
    progress.begin("join", len(channels), len(channels) - len(unjoined))
    for _ in _done(follower, joins, progress, "join"):
        pass


def assigned_counts(job: JobFolder, plan: JobPlan) -> Counter[str]:
    """What assigning counted in all shards: for each channel `/points` and `/sq_dist`."""
    counts: Counter[str] = Counter()
    for shard in range(plan.n_shards):
        counts.update(_receipt(job, "assign", f"{shard:06d}").counts)
    return counts


def quantisation_of(job: JobFolder, plan: JobPlan) -> dict[str, float]:
    """By channel, the mean squared distance of all descriptors to their words."""
    counts = assigned_counts(job, plan)
    return {
        name: counts[f"{name}/sq_dist"] / max(counts[f"{name}/points"], 1)
        for name in plan.config.features.channels()
    }


def _done(follower: Follower, orders: Orders, progress: Progress, stage: str) -> Iterator[Outcome]:
    for outcome in follower.outcomes(orders):
        value_of(outcome)
        progress.advance(stage)
        yield outcome


def _receipt(job: JobFolder, stage: str, key: str) -> Receipt:
    receipt = job.awaited_receipt(stage, key)
    if receipt is None:
        raise BadIndex(f"{job.path} lacks the receipt of {stage} {key}. Run it again.")
    return receipt
