"""The stages of a job as tasks: how long each takes, and what a worker holds meanwhile."""

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

from coordinator.forecast.ranges import Range, exactly, total


@dataclass(frozen=True, slots=True)
class Tasks:
    """`number` tasks that take `seconds` each, of one worker process on one core."""

    number: int
    seconds: Range


@dataclass(frozen=True, slots=True)
class Stage:
    """A stage of a job, its tasks in the order in which they are sent.

    private_bytes : what a worker process holds at most and shares with no other. shared_bytes :
    what the processes of a machine map together. None: not known here.
    """

    name: str
    tasks: tuple[Tasks, ...]
    private_bytes: float | None
    shared_bytes: float | None

    @property
    def n_tasks(self) -> int:
        return sum(tasks.number for tasks in self.tasks)

    @property
    def core_s(self) -> Range:
        """Seconds of all its tasks together."""
        return total(tasks.seconds.times(tasks.number) for tasks in self.tasks)

    def wall_s(self, n_workers: int) -> Range:
        """Seconds until the last worker has no task left."""
        return Range(
            _last_ends([(tasks.number, tasks.seconds.low) for tasks in self.tasks], n_workers),
            _last_ends([(tasks.number, tasks.seconds.likely) for tasks in self.tasks], n_workers),
            _last_ends([(tasks.number, tasks.seconds.high) for tasks in self.tasks], n_workers),
        )


def equal_tasks(number: int, core_s: Range) -> tuple[Tasks, ...]:
    """Work cut into equal tasks."""
    return (Tasks(number, core_s.times(1.0 / number)),) if number else ()


def wall_s(stages: Sequence[Stage], n_workers: int, start_s: float) -> Range:
    """Seconds of a whole job: a stage begins when the one before has ended."""
    return total((exactly(start_s), *(stage.wall_s(n_workers) for stage in stages)))


def _last_ends(tasks: Sequence[tuple[int, float]], n_workers: int) -> float:
    """Each task goes to the worker that is free first."""
    free_at = [0.0] * n_workers
    for number, seconds in tasks:
        rounds, rest = divmod(number, n_workers)
        free_at = [at + rounds * seconds for at in free_at]  # equal tasks: one each, in turn
        heapq.heapify(free_at)
        for _ in range(rest):
            heapq.heapreplace(free_at, free_at[0] + seconds)
    return max(free_at)
