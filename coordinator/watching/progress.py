"""How far a job (or a batch) is: a small file that its coordinator writes anew every two seconds.

Any machine that sees the folder can read it; none needs the broker for it.
"""

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Literal

from pydantic import TypeAdapter

from index.files import read_text_file, write_bytes

State = Literal[
    "at work", "paused", "waiting", "alone", "finished", "stopped", "cancelled", "failed"
]
"""waiting : for the broker, which is away. alone : no worker listens. stopped : by
Ctrl-C. A coordinator that was killed says nothing: the file says `at work` then, and is written no
more."""

ENDED: tuple[State, ...] = ("finished", "stopped", "cancelled", "failed")


@dataclass(frozen=True, slots=True)
class StageProgress:
    """Orders of a stage: `done` of `total`, those of earlier runs too."""

    name: str
    total: int
    done: int


@dataclass(frozen=True, slots=True)
class AtWork:
    """What a worker process is at. worker : host:pid."""

    worker: str
    task: str


@dataclass(frozen=True, slots=True)
class JobProgress:
    """How far a job is.

    stage : the one it is at. stages : those that were begun, in order.
    images_done : of `images`, extracted or skipped. images_per_s : over the last minutes, of this
    run; None: not known. stage_left_s : until the stage ends, by its own pace; left_s : until the
    job ends. None: nobody can tell.
    lost : orders that were sent again; refused : by workers of another version, say.
    told : what last went wrong.
    beat : grows with every writing: who reads twice sees whether the coordinator lives.
    command : that does the work; the same again goes on.
    """

    job: str
    verb: str
    state: State
    stage: str
    stages: tuple[StageProgress, ...]
    images: int
    images_done: int
    images_per_s: float | None
    stage_left_s: float | None
    left_s: float | None
    skipped: int
    lost: int
    refused: int
    failed: int
    workers: tuple[AtWork, ...]
    told: str
    host: str
    pid: int
    begun_at: str
    updated_at: str
    beat: int
    command: str = ""


_PROGRESS = TypeAdapter(JobProgress)


def write_progress(folder: Path, progress: JobProgress) -> None:
    """Write the file of a job's or a batch's folder."""
    write_bytes(_path(folder), _PROGRESS.dump_json(progress, indent=1))


def read_progress(folder: Path) -> JobProgress | None:
    """What was written last; None: nothing (that can be read)."""
    try:
        progress = _PROGRESS.validate_json(read_text_file(_path(folder)))
        datetime.fromisoformat(progress.updated_at)
    except (OSError, ValueError):
        return None
    return progress


def _path(folder: Path) -> Path:
    return folder / "progress.json"
