"""Turning on and off what `inside_processes/sitecustomize.py` does inside every worker."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil
from waiting import wait_until

FOLDER_OF = {
    "extract": "features",
    "train": "codebooks",
    "assign": "partials",
    "merge": "pieces",
    "join": "segments",
}
"""Where the tasks of each stage write first."""
STAGES = tuple(FOLDER_OF)


@dataclass(frozen=True, slots=True)
class Switches:
    """Empty files in a folder that all workers know."""

    folder: Path

    def make(self) -> None:
        """Make the folder; all is off."""
        for name in ("hold", "held", "deadly"):
            (self.folder / name).mkdir(parents=True)

    def all_off(self) -> None:
        for path in self.folder.rglob("*"):
            if path.is_file():
                path.unlink(missing_ok=True)

    def make_slow(self) -> None:
        """The shared folder is slow."""
        (self.folder / "slow").touch()

    def make_deadly(self, name: str) -> None:
        """Who opens an image of that name is killed."""
        (self.folder / "deadly" / name).touch()

    @contextmanager
    def holding(self, stage: str) -> Iterator[Callable[[], int]]:
        """Whoever is about to write in a stage stays there, until this ends.

        Gives what waits for the first of them, and tells its process id.
        """
        switch = self.folder / "hold" / FOLDER_OF[stage]
        switch.touch()
        try:
            yield self._first_held
        finally:
            switch.unlink(missing_ok=True)

    def _first_held(self) -> int:
        wait_until(self._held, "a worker that is about to write")
        return self._held()[0]

    def _held(self) -> list[int]:
        held = (int(path.name) for path in (self.folder / "held").iterdir())
        return [pid for pid in held if psutil.pid_exists(pid)]
