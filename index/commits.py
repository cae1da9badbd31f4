"""Changing what is live: one writer at a time, and an atomic rename at the end.

A reader sees the former generation or the new one, never a mixture. Locks are the system's
(flock): they end with the process that holds them, however it ends.
"""

import fcntl
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from contracts.errors import BadIndex
from index.files import check_files, write_bytes
from index.jobs import JobFolder
from index.manifest import (
    Generation,
    generation_numbers,
    generation_path,
    live_number,
    read_generation,
)

PATIENCE_S = 60.0
"""How long a writer waits for another: they hold the index for their last seconds only."""
_RETRY_S = 0.1


@dataclass(frozen=True, slots=True)
class Writer:
    """Whoever holds an index for writing."""

    root: Path

    def next_number(self) -> int:
        """The number of the next generation: none is used twice, not even after a rollback."""
        return max(generation_numbers(self.root), default=0) + 1

    def commit(self, generation: Generation) -> None:
        """Write `generation`, if it is one that can be read again, and make it the live one."""
        content = generation.model_dump(mode="json")
        Generation.model_validate(content)
        text = json.dumps(content, indent=1, sort_keys=True)
        write_bytes(generation_path(self.root, generation.number), text.encode())
        self._point_to(generation.number)

    def go_back(self, number: int) -> Generation:
        """Make a former generation (or one that was gone back from) the live one.

        Raises
        ------
        BadIndex : it is not there, or files of it are missing or of another size.
        """
        generation = read_generation(self.root, number)
        check_files(self.root, generation.sizes)
        self._point_to(number)
        return generation

    def _point_to(self, number: int) -> None:
        write_bytes(self.root / "CURRENT", f"{number:06d}\n".encode())


@contextmanager
def writing(root: Path, patience_s: float = PATIENCE_S) -> Iterator[Writer]:
    """Hold the index for writing, and make its folder if there is none.

    Raises
    ------
    BadIndex : another process holds it for longer than `patience_s`.
    """
    root.mkdir(parents=True, exist_ok=True)
    gives_up_at = time.monotonic() + patience_s
    with (root / ".lock").open("a") as stream:
        while not _locked(stream.fileno(), fcntl.LOCK_EX):
            if time.monotonic() > gives_up_at:
                raise BadIndex(
                    f"{root} is being written by another process. Wait for it to end, and run the "
                    "same command again."
                )
            time.sleep(_RETRY_S)
        try:
            yield Writer(root)
        finally:
            # Closing it would not do for a process that was forked meanwhile.
            fcntl.flock(stream, fcntl.LOCK_UN)


@contextmanager
def working(job: JobFolder) -> Iterator[None]:
    """Let others see that a job is being worked on; any number of processes may.

    Raises
    ------
    BadIndex : its plan was pruned.
    """
    try:
        stream = (job.path / "plan.json").open("rb")
    except FileNotFoundError as error:
        raise BadIndex(
            f"{job.path} was pruned before the work began. Run the same command again."
        ) from error
    with stream:
        fcntl.flock(stream, fcntl.LOCK_SH)
        yield


def is_worked_on(job: JobFolder) -> bool:
    """Whether a process is at work on a job that has a plan."""
    with (job.path / "plan.json").open("rb+") as stream:
        return not _locked(stream.fileno(), fcntl.LOCK_EX)


def roll_back(root: Path, number: int | None = None) -> Generation:
    """Make generation `number` the live one; None: the last one before it.

    Raises
    ------
    BadIndex : not an index, there is no such generation, or files of it are gone.
    """
    if not generation_numbers(root):
        live_number(root)  # says why it is no index, before a lock is made in it
    with writing(root) as writer:
        if number is None:
            live = live_number(root)
            earlier = [each for each in generation_numbers(root) if each < live]
            if not earlier:
                raise BadIndex(
                    f"{root} has no generation before {live}. Another one that it has can be named "
                    "with --to."
                )
            number = earlier[-1]
        return writer.go_back(number)


def _locked(descriptor: int, kind: int) -> bool:
    try:
        fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
