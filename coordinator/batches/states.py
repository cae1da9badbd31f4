"""How batches are: what is done, and whether anybody works on them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from coordinator.batches.batch import BatchFolder, batches_in
from coordinator.batches.journal import Answers
from coordinator.watching.progress import ENDED, read_progress
from index.control import Wish, read_wish

Condition = Literal["finished", "at work", "paused", "ending", "stopped", "cancelled"]

_AT_WORK: dict[Wish, Condition] = {"run": "at work", "pause": "paused", "cancel": "ending"}
_LEFT: dict[Wish, Condition] = {"run": "stopped", "pause": "paused", "cancel": "cancelled"}


@dataclass(frozen=True, slots=True)
class BatchState:
    """One batch. failed : of the photos done. told : what last went wrong.

    photos_per_s, left_s : None: not known. workers : that answered lately.
    """

    name: str
    state: Condition
    photos: int
    done: int
    failed: int
    photos_per_s: float | None
    left_s: float | None
    workers: tuple[str, ...]
    generation: int
    priority: int
    made_at: str
    told: str


def state_of_batch(folder: BatchFolder) -> BatchState:
    """How a batch is. Errors as `BatchFolder.read`."""
    plan = folder.read()
    at_work = folder.is_worked_on()
    progress = read_progress(folder.path)
    if progress is not None and (at_work or progress.state in ENDED):
        done, failed = progress.images_done, progress.failed
    else:  # killed: its last word may be older than its last answer
        done, failed = Answers.read(folder.answers).count()
    live = progress if at_work else None
    return BatchState(
        name=folder.name,
        state=_condition(folder, done == plan.n_photos, at_work),
        photos=plan.n_photos,
        done=done,
        failed=failed,
        photos_per_s=live.images_per_s if live else None,
        left_s=live.left_s if live else None,
        workers=tuple(each.worker for each in live.workers) if live else (),
        generation=plan.generation,
        priority=plan.priority,
        made_at=plan.made_at,
        told=progress.told if progress else "",
    )


def pinned_generations(place: Path) -> set[int]:
    """Generations that unfinished batches in a folder are located against."""
    states = map(state_of_batch, batches_in(place))
    return {each.generation for each in states if each.state not in ("finished", "cancelled")}


def _condition(folder: BatchFolder, finished: bool, at_work: bool) -> Condition:
    wish = read_wish(folder.path)
    if finished:
        return "finished"
    return (_AT_WORK if at_work else _LEFT)[wish]
