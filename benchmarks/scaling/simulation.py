"""A job as a discrete-event simulation: coordinator, broker, workers and a shared folder.

The stages follow one another; within one, the coordinator keeps four orders a worker in flight,
one message at a time. The broker serves one command at a time, the folder one transfer at a time
at its full speed: together that is as long as if they were shared.
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import simpy

from benchmarks.scaling.tasks import Task, Work

IN_FLIGHT = 4
"""Orders for each worker, as the follower has them."""

Steps = Generator[simpy.Event, object, None]


@dataclass(frozen=True, slots=True)
class Site:
    """Where a job runs. message_s, server_s : of coordinator and broker, for each task.

    folder_bytes_s : what the shared folder moves in a second. open_s : until it opens a file.
    slowdown : of a core, when the others of its machine are busy too.
    """

    n_workers: int
    message_s: float
    server_s: float
    folder_bytes_s: float = float("inf")
    open_s: float = 0.0
    slowdown: float = 1.0


@dataclass(frozen=True, slots=True)
class StageTook:
    """Seconds of the clock, of tasks' cores, and in which coordinator, broker, folder were busy."""

    wall_s: float
    core_s: float
    coordinator_s: float
    server_s: float
    folder_s: float


@dataclass(frozen=True, slots=True)
class Took:
    """A simulated job."""

    plan_s: float
    stages: dict[str, StageTook]
    commit_s: float

    @property
    def wall_s(self) -> float:
        return self.plan_s + self.commit_s + sum(each.wall_s for each in self.stages.values())


def simulate(work: Work, site: Site) -> Took:
    """Run every stage of a job."""
    stages = {name: _Stage(site).run(tasks) for name, tasks in work.stages.items()}
    return Took(work.plan_s, stages, work.commit_s)


class _Stage:
    def __init__(self, site: Site) -> None:
        self.site = site
        self.env = env = simpy.Environment()
        self.server, self.folder = simpy.Resource(env), simpy.Resource(env)
        self.queue, self.landed = simpy.Store(env), simpy.Store(env)
        self.busy = dict.fromkeys(("coordinator", "server", "folder"), 0.0)

    def run(self, tasks: Sequence[Task]) -> StageTook:
        for _ in range(self.site.n_workers):
            self.env.process(self._worker())
        self.env.run(self.env.process(self._coordinator(tasks)))
        core_s = sum(task.seconds for task in tasks)
        busy = (self.busy[name] for name in ("coordinator", "server", "folder"))
        return StageTook(self.env.now, core_s, *busy)

    def _coordinator(self, tasks: Sequence[Task]) -> Steps:
        flying = 0
        for task in tasks:
            if flying == IN_FLIGHT * self.site.n_workers:
                yield from self._collect()
                flying -= 1
            yield from self._message()
            yield from self._use("server", self.server, self.site.server_s / 2)
            self.queue.put(task)
            flying += 1
        for _ in range(flying):
            yield from self._collect()

    def _collect(self) -> Steps:
        yield self.landed.get()
        yield from self._message()

    def _message(self) -> Steps:
        self.busy["coordinator"] += self.site.message_s / 2
        yield self.env.timeout(self.site.message_s / 2)

    def _worker(self) -> Steps:
        site = self.site
        while True:
            task = yield self.queue.get()
            assert isinstance(task, Task)
            yield self.env.timeout(task.opened * site.open_s)
            yield from self._use("folder", self.folder, task.read / site.folder_bytes_s)
            yield self.env.timeout(task.seconds * site.slowdown)
            yield from self._use("folder", self.folder, task.written / site.folder_bytes_s)
            yield from self._use("server", self.server, site.server_s / 2)
            self.landed.put(task)

    def _use(self, name: str, resource: simpy.Resource, seconds: float) -> Steps:
        if not seconds:
            return
        with resource.request() as turn:
            yield turn
            self.busy[name] += seconds
            yield self.env.timeout(seconds)
