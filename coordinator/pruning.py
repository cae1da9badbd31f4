"""Pruning: what only former generations need, or nobody, is deleted."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from coordinator.batches.batch import BATCHES
from coordinator.batches.states import pinned_generations
from index.commits import is_worked_on, writing
from index.inventory import sizes_on_disk, unneeded
from index.jobs import JobPlan, jobs_of
from index.manifest import (
    Generation,
    generation_numbers,
    generation_path,
    live_number,
    read_generation,
)


@dataclass(frozen=True, slots=True)
class Pruned:
    """What was deleted. generations : their numbers."""

    generations: tuple[int, ...]
    n_files: int
    n_bytes: int


def prune(root: Path) -> Pruned:
    """Delete the generations before the live one, and every file that no other one needs.

    Jobs that a process works on stay; unfinished ones that nobody works on go. A generation that
    an unfinished batch of the index is located against stays. Files in the folder that are none of
    the index's stay, batches among them. Generations go first: killed half-way, what is left
    is files that nobody names, and the next time takes them.

    Raises
    ------
    BadIndex : not an index, damaged, or held by another writer.
    """
    live_number(root)  # or a lock would be made in what is no index
    with writing(root):
        pinned, live = pinned_generations(root / BATCHES), live_number(root)
        numbers = generation_numbers(root)
        kept_numbers = [each for each in numbers if each >= live or each in pinned]
        kept = [read_generation(root, number) for number in kept_numbers]
        spare = unneeded(sizes_on_disk(root), kept, _at_work(root, kept))
        former = tuple(number for number in numbers if number not in kept_numbers)
        for number in former:
            generation_path(root, number).unlink()
        for name in sorted(spare):
            (root / name).unlink(missing_ok=True)
        _remove_empty(root, {folder for name in spare for folder in Path(name).parents})
    return Pruned(former, len(spare), sum(spare.values()))


def _at_work(root: Path, generations: Iterable[Generation]) -> list[JobPlan]:
    """The plans of jobs that are in none of these generations yet, but that somebody works on."""
    done = {name for each in generations for name in each.jobs}
    jobs = [job for job in jobs_of(root) if job.job not in done and job.has_plan()]
    return [job.read_plan() for job in jobs if is_worked_on(job)]


def _remove_empty(root: Path, folders: set[Path]) -> None:
    for folder in sorted(folders - {Path()}, reverse=True):
        with suppress(OSError):  # something is in it
            (root / folder).rmdir()
