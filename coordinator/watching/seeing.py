"""Seeing, from any machine that has the folder, how the jobs and batches of an index go."""

import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from contracts.errors import BadIndex
from coordinator.batches.batch import BATCHES, batches_in
from coordinator.watching.progress import ENDED, JobProgress, read_progress
from index.commits import is_worked_on
from index.jobs import jobs_of

QUIET_S = 20.0
"""A coordinator that writes nothing for so long does not live, or cannot write."""


@dataclass(frozen=True, slots=True)
class Seen:
    """A job or a batch as it is seen.

    died : its coordinator ended without a word. quiet_s : for how long it has written nothing,
    as far as that was seen.
    """

    folder: Path
    progress: JobProgress
    died: bool
    quiet_s: float

    @property
    def is_at_work(self) -> bool:
        return not (self.died or self.progress.state in ENDED)


class Sight:
    """Looks at an index again and again.

    Whether a coordinator lives is seen by its lock, and where locks do not reach by its writing:
    clocks of two machines are compared once, at the first look.
    """

    def __init__(self, root: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self._root = root
        self._clock = clock
        self._beats: dict[Path, tuple[tuple[str, int], float]] = {}
        self._at_work: set[Path] = set()

    def look(self) -> list[Seen]:
        """What is at work or did not end well, and what ended since the first look.

        Where there is nothing of that, what ended last.
        """
        seen = [self._seen(folder, is_held) for folder, is_held in self._folders()]
        known = [each for each in seen if each is not None]
        self._at_work |= {each.folder for each in known if each.is_at_work}
        shown = [
            each
            for each in known
            if each.progress.state != "finished" or each.folder in self._at_work
        ]
        last = sorted(known, key=lambda each: each.progress.updated_at)[-1:]
        return sorted(shown or last, key=lambda each: each.progress.begun_at)

    def _folders(self) -> Iterator[tuple[Path, Callable[[], bool]]]:
        for job in jobs_of(self._root):
            yield job.path, partial(is_worked_on, job)
        for batch in batches_in(self._root / BATCHES):
            yield batch.path, batch.is_worked_on

    def _seen(self, folder: Path, is_held: Callable[[], bool]) -> Seen | None:
        progress = read_progress(folder)
        if progress is None:
            return None
        quiet_s = self._quiet_s(folder, progress)
        held = progress.state in ENDED or _asked(is_held)
        is_here = progress.host == socket.gethostname()  # then the lock is the truth
        return Seen(folder, progress, not held and (is_here or quiet_s > QUIET_S), quiet_s)

    def _quiet_s(self, folder: Path, progress: JobProgress) -> float:
        now, beat = self._clock(), (progress.begun_at, progress.beat)
        if folder not in self._beats:
            age = datetime.now(UTC) - datetime.fromisoformat(progress.updated_at)
            self._beats[folder] = beat, now - max(age.total_seconds(), 0.0)
        elif self._beats[folder][0] != beat:
            self._beats[folder] = beat, now
        return now - self._beats[folder][1]


def _asked(is_held: Callable[[], bool]) -> bool:
    try:
        return is_held()
    except (OSError, BadIndex):  # read-only, or it has just been pruned
        return False
