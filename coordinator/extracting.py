"""Extracting: the shards whose features are needed, and the images in them that kill workers."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.progress import Progress
from coordinator.following.events import Order
from coordinator.following.flow import Outcome
from coordinator.following.follow import Follower, value_of
from coordinator.isolating import isolate
from index.jobs import JobFolder, JobPlan
from workers.messages import job_message

ROUNDS = 3
"""How often images are looked for that kill workers, where a shard does so again."""
SHARD_LIMIT_S = 3600.0
UNKNOWN = -1


@dataclass(frozen=True, slots=True)
class Shards:
    """What is known of the shards of a job; both (n_shards,) int64.

    n_images : that can be read. assigned_from : the first id that a shard's images were given when
    they were assigned. UNKNOWN : they are to be extracted; to be assigned.
    """

    n_images: NDArray[np.int64]
    assigned_from: NDArray[np.int64]

    @classmethod
    def unknown(cls, n_shards: int) -> "Shards":
        return cls(np.full(n_shards, UNKNOWN, np.int64), np.full(n_shards, UNKNOWN, np.int64))

    def first_ids(self) -> NDArray[np.int64]:
        """Ids are dense over the readable images: each shard begins where the former one ended."""
        return np.cumsum(self.n_images) - self.n_images

    def is_assigned(self, shard: int) -> bool:
        return bool(self.assigned_from[shard] != UNKNOWN)

    @property
    def all_assigned(self) -> bool:
        return bool((self.assigned_from != UNKNOWN).all())

    def misplaced(self) -> list[int]:
        """Shards that were assigned with other ids than they have now."""
        is_wrong = (self.assigned_from != UNKNOWN) & (self.assigned_from != self.first_ids())
        return np.flatnonzero(is_wrong).tolist()


def extract_missing(
    job: JobFolder,
    plan: JobPlan,
    shards: Shards,
    words: str,
    follower: Follower,
    progress: Progress,
) -> int:
    """Extract all shards that are not assigned to `words`; returns how many images were new.

    Workers say which shards are there already: they read the features of many at a time.
    """
    progress.begin("extract", plan.n_shards, 0)
    wanted = _unassigned(job, plan, shards, words, progress)
    extracted = 0
    while True:
        for shard, n_images, anew in _extracted(job, plan, wanted, follower):
            if shards.n_images[shard] == UNKNOWN:
                progress.advance("extract")
            shards.n_images[shard] = n_images
            extracted += n_images if anew else 0
        misplaced = shards.misplaced()
        if not misplaced:
            return extracted
        shards.assigned_from[misplaced] = UNKNOWN
        wanted = iter(misplaced)


def _unassigned(
    job: JobFolder, plan: JobPlan, shards: Shards, words: str, progress: Progress
) -> Iterator[int | None]:
    """Shards to be extracted, and None for each that is not; `shards` is told of these."""
    for shard in range(plan.n_shards):
        assigned = job.assigned(shard, words) if words else None
        extracted = job.read_receipt("extract", f"{shard:06d}") if assigned else None
        if assigned is None or extracted is None:
            yield shard
        else:
            shards.assigned_from[shard] = assigned.counts["first_image_id"]
            shards.n_images[shard] = extracted.counts["images"]
            progress.advance("extract")
            yield None


def _extracted(
    job: JobFolder, plan: JobPlan, wanted: Iterable[int | None], follower: Follower
) -> Iterator[tuple[int, int, bool]]:
    """Of each shard: its number, its readable images, and whether it was extracted just now."""
    orders = (None if shard is None else _order(job, plan, shard) for shard in wanted)
    for turn in range(ROUNDS + 1):
        given_up: list[Outcome] = []
        for outcome in follower.outcomes(orders):
            if outcome.given_up and turn < ROUNDS:
                given_up.append(outcome)
            else:
                value = value_of(outcome)
                yield int(outcome.order.key), value["counts"]["images"], value["anew"]
        if not given_up:
            return
        again = [int(outcome.order.key) for outcome in given_up]
        isolate(job, plan, again, follower)
        orders = (_order(job, plan, shard) for shard in again)


def _order(job: JobFolder, plan: JobPlan, shard: int) -> Order:
    return Order("extract", f"{shard:06d}", job_message(job, plan, shard=shard), SHARD_LIMIT_S)
