"""What a person sees: progress on stderr, plain lines where that is not a terminal."""

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    SpinnerColumn,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from contracts.records import Skipped
from coordinator.export.harmless import harmless

if TYPE_CHECKING:  # imported where programs read what is told
    from structlog.stdlib import BoundLogger

MAX_LISTED = 20

stderr = Console(stderr=True, highlight=False)
stdout = Console(highlight=False)


def complain(message: str) -> None:
    """An error or a warning, for a person."""
    if _logs_json():
        _log().warning(message)
        return
    stderr.print(_shown(message), style="red", markup=False, soft_wrap=True)


def tell(message: str) -> None:
    """A line that is not a result."""
    if _logs_json():
        _log().info(message)
        return
    stderr.print(_shown(message), markup=False, soft_wrap=True)


def _logs_json() -> bool:
    """Whether programs read what is told here (workers/logs.py)."""
    return os.environ.get("FLANEUR_LOG") == "json"


@cache
def _log() -> "BoundLogger":
    from workers.logs import install, logger

    install("json")
    return logger()


def _shown(message: str) -> str:
    return "\n".join(map(harmless, message.split("\n")))


class Bars:
    """A bar a stage on a terminal; elsewhere a line as each stage begins and ends."""

    def __init__(self, progress: Progress | None) -> None:
        self._progress = progress
        self._bars: dict[str, TaskID] = {}
        self._left: dict[str, int] = {}

    def begin(self, stage: str, total: int, done: int) -> None:
        if self._progress is not None:
            self._bars[stage] = self._progress.add_task(stage, total=total, completed=done)
        elif total > done:
            tell(f"{stage}: {total - done} of {total} to do")
        self._left[stage] = total - done

    def advance(self, stage: str) -> None:
        self._left[stage] -= 1
        if self._progress is not None:
            self._progress.advance(self._bars[stage])
        elif self._left[stage] == 0:
            tell(f"{stage}: done")


@contextmanager
def bars() -> Iterator[Bars]:
    """Progress for as long as the block runs."""
    if not sys.stderr.isatty() or _logs_json():
        yield Bars(None)
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description:9}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=stderr, transient=False) as progress:
        yield Bars(progress)


def list_skipped(skipped: Sequence[Skipped], where: str) -> None:
    """Name what was left out, with reasons; a long list is cut and `where` has the rest."""
    if not skipped:
        return
    complain(f"{len(skipped)} skipped:")
    for each in skipped[:MAX_LISTED]:
        complain(f"  {each.uri}: {each.reason}")
    if len(skipped) > MAX_LISTED:
        complain(f"  … and {len(skipped) - MAX_LISTED} more in {where}")
