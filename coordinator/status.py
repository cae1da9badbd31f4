"""Looking after an index: what state it is in, and whether all its files are there."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from contracts.errors import BadIndex
from coordinator.batches.batch import BATCHES
from coordinator.batches.states import pinned_generations
from coordinator.building import STAGES
from coordinator.index_state import (
    CodebookState,
    GenerationState,
    IndexState,
    JobState,
    SegmentState,
)
from index.codebooks import codebook_paths, count_words
from index.commits import is_worked_on
from index.files import check_files
from index.inventory import sizes_on_disk, unneeded
from index.jobs import JobFolder, JobPlan, jobs_of
from index.manifest import (
    Generation,
    generation_numbers,
    generation_path,
    read_generation,
)

MANY_SEGMENTS = 8
"""Beyond, compacting pays: each word of a photo is looked up once in every segment."""

MUCH_REMOVED = 0.2
"""Share of removed images beyond which compacting pays: they are unpacked, then left out."""


def state_of(root: Path) -> IndexState:
    """Look at an index without changing it, or reading what is in its large files.

    Works while others write: what they have not committed yet is an unfinished job.

    Raises
    ------
    BadIndex : `root` is neither an index nor one that is being made.
    """
    faults: list[str] = []
    hints: list[str] = []
    live = _live(root, faults)
    generations = _all_readable(root, live, hints)
    health = {each.number: _missing(root, each) for each in generations}
    jobs = _unfinished(root, generations)
    sizes = sizes_on_disk(root)
    if live is not None:
        faults += health[live.number]
        hints += _reasons_to_compact(live)
    return IndexState(
        index=str(root),
        live=None if live is None else live.number,
        generations=tuple(_generation(each, health[each.number]) for each in generations),
        segments=() if live is None else _segments(live),
        codebooks_digest=None if live is None else live.codebooks_digest,
        codebooks=() if live is None else _codebooks(root, live),
        jobs=tuple(_job(job, plan, fault) for job, plan, fault in jobs),
        bytes=sum(sizes.values()),
        bytes_unneeded=0 if live is None else _unneeded(root, sizes, live, generations, jobs),
        instruction_sets=() if live is None else _instruction_sets(root, live),
        faults=tuple(faults),
        hints=tuple(hints),
    )


_Job = tuple[JobFolder, JobPlan | None, str | None]


def _live(root: Path, faults: list[str]) -> Generation | None:
    unfinished = (root / "jobs").is_dir() and not generation_numbers(root)
    if unfinished and not (root / "CURRENT").exists():
        return None
    try:
        return read_generation(root)
    except BadIndex as error:
        if not generation_numbers(root):
            raise
        faults.append(str(error))
        return None


def _all_readable(root: Path, live: Generation | None, hints: list[str]) -> list[Generation]:
    found = {} if live is None else {live.number: live}
    for number in generation_numbers(root):
        try:
            found[number] = found.get(number) or read_generation(root, number)
        except BadIndex as error:
            if generation_path(root, number).exists():  # not if it was pruned meanwhile
                hints.append(str(error))
    return [found[number] for number in sorted(found)]


def _missing(root: Path, generation: Generation) -> tuple[str, ...]:
    """What is wrong with the files of a generation, as far as sizes tell."""
    faults = []
    for name, size in generation.sizes.items():
        try:
            check_files(root, {name: size})
        except BadIndex as error:
            faults.append(str(error))
    return tuple(faults)


def _generation(generation: Generation, faults: tuple[str, ...]) -> GenerationState:
    return GenerationState(
        number=generation.number,
        made_by=generation.made_by,
        created_at=generation.created_at,
        images=generation.n_live,
        removed=generation.n_images - generation.n_live,
        segments=len(generation.segments),
        faults=faults,
    )


def _segments(live: Generation) -> tuple[SegmentState, ...]:
    return tuple(
        SegmentState(
            name=segment.name,
            images=segment.n_images - segment.n_removed,
            removed=segment.n_removed,
            postings=segment.n_postings,
            bytes=_bytes_under(live, f"segments/{segment.name}/"),
            surveys=tuple(survey.name or survey.path for survey in segment.surveys),
        )
        for segment in live.segments
    )


def _codebooks(root: Path, live: Generation) -> tuple[CodebookState, ...]:
    states = []
    for channel in live.config.features.channels():
        paths = codebook_paths(root, live.codebooks, channel)
        names = [path.relative_to(root).as_posix() for path in paths.values()]
        n_bytes = sum(live.files[name].size for name in names if name in live.files)
        try:
            n_words: int | None = count_words(root, live.codebooks, channel)
        except BadIndex:  # told among the faults, by its size or by `flaneur verify`
            n_words = None
        states.append(CodebookState(channel, n_words, n_bytes))
    return tuple(states)


def _bytes_under(live: Generation, folder: str) -> int:
    return sum(size for name, size in live.sizes.items() if name.startswith(folder))


def _unfinished(root: Path, generations: Sequence[Generation]) -> list[_Job]:
    jobs_done = {job for each in generations for job in each.jobs}
    # A segment names no job that compacted it.
    made = {segment.name for each in generations for segment in each.segments}
    found: list[_Job] = []
    for job in jobs_of(root):
        if job.job in jobs_done:
            continue
        try:
            plan = job.read_plan() if job.has_plan() else None
        except BadIndex as error:
            found.append((job, None, str(error)))
            continue
        if plan is None or plan.segment not in made:
            found.append((job, plan, None))
    return found


def _unneeded(
    root: Path,
    sizes: dict[str, int],
    live: Generation,
    generations: Sequence[Generation],
    jobs: Sequence[_Job],
) -> int:
    """Bytes that pruning would free; it keeps generations after the live one, if there are."""
    pinned = pinned_generations(root / BATCHES)
    kept = [each for each in generations if each.number >= live.number or each.number in pinned]
    at_work = [plan for job, plan, _ in jobs if plan is not None and _at_work(job) is not False]
    return sum(unneeded(sizes, kept, at_work).values())


def _job(job: JobFolder, plan: JobPlan | None, fault: str | None) -> JobState:
    receipts = {stage: list((job.path / "receipts" / stage).glob("*.json")) for stage in STAGES}
    last = max(
        (path.stat().st_mtime for paths in receipts.values() for path in paths), default=None
    )
    return JobState(
        job=job.job,
        verb="" if plan is None else plan.verb,
        images=0 if plan is None else plan.n_images,
        shards=None if plan is None else plan.n_shards,
        channels=None if plan is None else len(plan.config.features.channels()),
        done={stage: len(paths) for stage, paths in receipts.items()},
        last_receipt_at=None if last is None else _when(last),
        at_work=None if plan is None else _at_work(job),
        fault=fault,
    )


def _at_work(job: JobFolder) -> bool | None:
    try:
        return is_worked_on(job)
    except OSError:  # a read-only folder, where no lock can be tried
        return None


def _when(seconds: float) -> str:
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="seconds")


def _instruction_sets(root: Path, live: Generation) -> tuple[str, ...]:
    """Of the machines that extracted its images, as far as receipts are there."""
    found: set[str] = set()
    for name in live.jobs:
        job = JobFolder(root, name)
        for path in (job.path / "receipts" / "extract").glob("*.json"):
            receipt = job.read_receipt("extract", path.stem)
            found |= {receipt.instruction_set} if receipt else set()
    return tuple(sorted(found - {""}))


def _reasons_to_compact(live: Generation) -> list[str]:
    hints = []
    if len(live.segments) > MANY_SEGMENTS:
        hints.append(
            f"{len(live.segments)} segments: every search looks in each. Join them with "
            "`flaneur compact`."
        )
    removed = live.n_images - live.n_live
    if removed > MUCH_REMOVED * live.n_images:
        hints.append(
            f"{removed / live.n_images:.0%} of the images are removed: searches still read them. "
            "Drop them with `flaneur compact`."
        )
    return hints
