"""What was measured in one run, and all that the simulation is fed with: one JSON file."""

from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter


@dataclass(frozen=True, slots=True)
class Spent:
    """What a stretch of a job took, in seconds, bytes and commands of the broker.

    wall_s : of the clock. coordinator_s, workers_s, server_s : of processors. read, written :
    bytes that the workers asked the system for, in files or elsewhere, mapped ones not counted.
    """

    wall_s: float
    coordinator_s: float
    workers_s: float
    server_s: float
    commands: int
    read: int
    written: int

    def since(self, before: "Spent") -> "Spent":
        """What came to it."""
        return Spent(
            self.wall_s - before.wall_s,
            self.coordinator_s - before.coordinator_s,
            self.workers_s - before.workers_s,
            self.server_s - before.server_s,
            self.commands - before.commands,
            self.read - before.read,
            self.written - before.written,
        )


@dataclass(frozen=True, slots=True)
class Channel:
    """One channel of the indexed survey."""

    name: str
    dimensions: int
    points: int
    words: int
    postings: int
    train_s: float


@dataclass(frozen=True, slots=True)
class RealJob:
    """A whole job of so many worker processes, broker and workers already running.

    stages : by name; `commit` is what follows the last task.
    tasks : seconds of every task, by stage and key.
    """

    n_workers: int
    n_images: int
    shard_size: int
    spent: Spent
    stages: dict[str, Spent]
    tasks: dict[str, dict[str, float]]
    channels: list[Channel]

    @property
    def images_a_second(self) -> float:
        return self.n_images / self.spent.wall_s


@dataclass(frozen=True, slots=True)
class Bare:
    """Processes that only extract. image_s : of each image."""

    n_processes: int
    images_a_second: float
    image_s: list[float]


@dataclass(frozen=True, slots=True)
class Alone:
    """Seconds that a coordinator plans and commits, and MB that it holds after each phase.

    read_mb : the survey's images are in memory. planned_mb : shards and plan are written.
    peak_mb : the most it ever held, catalogue and generation written.
    """

    n_images: int
    n_shards: int
    read_mb: float
    planned_s: float
    planned_mb: float
    committed_s: float
    peak_mb: float


@dataclass(frozen=True, slots=True)
class Pieces:
    """Costs that a survey of hundreds of images is too small to show.

    posting_s : to merge one. run_s : to find a range of words in one partial index. join_byte_s :
    to lay a byte of packed postings down. posting_bytes : of a packed posting. digest_byte_s : to
    hash a byte. train_alone : share of training that more threads do not shorten.
    """

    posting_s: float
    run_s: float
    join_byte_s: float
    posting_bytes: float
    digest_byte_s: float
    train_alone: float


@dataclass(frozen=True, slots=True)
class Measured:
    """One run. image_bytes : of a stored image. empty : of `n_empty` tasks without images."""

    image_bytes: float
    jobs: list[RealJob]
    bare: list[Bare]
    alone: list[Alone]
    pieces: Pieces
    n_empty: int
    empty: Spent


_MEASURED = TypeAdapter(Measured)


def write_measured(path: Path, measured: Measured) -> None:
    """Keep what was measured."""
    path.write_bytes(_MEASURED.dump_json(measured, indent=1))


def read_measured(path: Path) -> Measured:
    """What an earlier run has kept."""
    return _MEASURED.validate_json(path.read_bytes())
