"""Records of what a job did, as its report tells it."""

from dataclasses import dataclass

from coordinator.watching.reasons import Reason


@dataclass(frozen=True, slots=True)
class Run:
    """A coordinator at work on the job. how : it ended; "" for one that was killed, or goes on.

    coordinator : host:pid. seconds : up to the last that was noted.
    """

    begun_at: str
    coordinator: str
    command: str
    seconds: float
    how: str
    told: str


@dataclass(frozen=True, slots=True)
class StageTimes:
    """wall_s : from when a run came to the stage to its last order, over all runs. task_s : of
    its tasks, added up."""

    stage: str
    tasks: int
    wall_s: float
    task_s: float


@dataclass(frozen=True, slots=True)
class TaskTime:
    """One task. worker : host:pid."""

    stage: str
    key: str
    seconds: float
    worker: str


@dataclass(frozen=True, slots=True)
class WorkerShare:
    """What one worker process did."""

    worker: str
    tasks: int
    seconds: float


@dataclass(frozen=True, slots=True)
class Trouble:
    """Something that went wrong with an order, the broker or the workers."""

    at: str
    kind: str
    task: str
    worker: str
    told: str


@dataclass(frozen=True, slots=True)
class JobReport:
    """What a job did.

    images : planned; images_extracted : in the runs that are noted, at images_per_s while the
    stage went on (None: there was none). slowest : shards; of a job without shards, tasks.
    counts : of troubles, by kind. Workers: those with the most seconds first.
    """

    job: str
    verb: str
    images: int
    images_extracted: int
    images_per_s: float | None
    seconds: float
    runs: tuple[Run, ...]
    stages: tuple[StageTimes, ...]
    slowest: tuple[TaskTime, ...]
    skipped: tuple[Reason, ...]
    counts: dict[str, int]
    troubles: tuple[Trouble, ...]
    workers: tuple[WorkerShare, ...]
