"""Isolating: which images of a shard kill the processes that work on it, by halving."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

from coordinator.following.events import Order
from coordinator.following.flow import Outcome
from coordinator.following.follow import Follower, value_of
from index.jobs import JobFolder, JobPlan
from workers.messages import job_message

IMAGE_LIMIT_S = 60.0
"""How long a process may work on one image."""


@dataclass(frozen=True, slots=True)
class _Suspects:
    """Rows first to stop - 1 of a shard."""

    shard: int
    first: int
    stop: int

    def halves(self) -> "Iterator[_Suspects]":
        """Of a single row: itself."""
        middle = (self.first + self.stop) // 2
        for first, stop in ((self.first, middle), (middle, self.stop)):
            if first < stop:
                yield _Suspects(self.shard, first, stop)


def isolate(job: JobFolder, plan: JobPlan, shards: Iterable[int], follower: Follower) -> None:
    """Find the images that kill workers, and have them left out when their shards are sent again.

    All shards are searched at once, in as many rounds as a shard can be halved. Where nothing is
    found (a machine died for another reason), nothing is left out.

    Raises
    ------
    TaskFailed : images could not be tried for another reason.
    """
    found = {shard: job.read_excluded(shard) for shard in shards}
    suspects = [
        half
        for shard, excluded in found.items()
        for first, stop in _runs(len(job.read_images(shard)), excluded)
        for half in _Suspects(shard, first, stop).halves()
    ]
    while suspects:
        narrower: list[_Suspects] = []
        for rows, outcome in _tried(job, plan, suspects, follower):
            if not outcome.given_up:
                value_of(outcome)
            elif rows.stop - rows.first > 1:
                narrower += rows.halves()
            else:
                found[rows.shard][rows.first] = f"no worker could work on it: {outcome.error}"
                job.write_excluded(rows.shard, found[rows.shard])
        suspects = narrower


def _tried(
    job: JobFolder, plan: JobPlan, suspects: list[_Suspects], follower: Follower
) -> Iterator[tuple[_Suspects, Outcome]]:
    by_key = {f"{each.shard:06d}-{each.first}-{each.stop}": each for each in suspects}
    for outcome in follower.outcomes(
        Order(
            "probe",
            key,
            job_message(job, plan, shard=each.shard, first_row=each.first, stop_row=each.stop),
            IMAGE_LIMIT_S * (each.stop - each.first),
        )
        for key, each in by_key.items()
    ):
        yield by_key[outcome.order.key], outcome


def _runs(n_rows: int, excluded: Iterable[int]) -> Iterator[tuple[int, int]]:
    """First row and stop of each run of rows that are not left out yet."""
    for before, after in pairwise([-1, *sorted(excluded), n_rows]):
        if after - before > 1:
            yield before + 1, after
