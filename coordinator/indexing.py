"""Indexing: the stages of a job, then one commit. Run again, it goes on."""

import time
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass

from contracts.errors import BadIndex
from contracts.progress import Progress
from contracts.records import Receipt, Skipped
from coordinator.building import build, is_built
from coordinator.committing import (
    Segment,
    all_skipped,
    area_around,
    extract_receipts,
    finish_segment,
    now,
    positions_of,
)
from coordinator.engine.running import Engine
from coordinator.intake import Intake
from coordinator.watching.watch import watching
from index.commits import Writer, is_worked_on, working, writing
from index.control import begin_again
from index.files import check_files
from index.jobs import JobFolder, JobPlan
from index.manifest import Generation, read_generation


@dataclass(frozen=True, slots=True)
class IndexReport:
    """What an index run did. images_extracted : in this run; 0 where all was there already."""

    generation: Generation
    skipped: tuple[Skipped, ...]
    without_frames: int
    images_extracted: int
    bytes_on_disk: int
    seconds: float
    warnings: tuple[str, ...]


Assemble = Callable[[Writer, JobPlan, Intake, Segment], Generation]
"""Makes of a ready segment, and of what is live, the generation that is to be committed."""


def find_finished(job: JobFolder) -> Generation | None:
    """The live generation, if what this job made is in it; None: there is work to do.

    If files of it are missing and it holds what this job made and nothing else, the job can make
    them again.

    Raises
    ------
    BadIndex : what is live is damaged, and more than this job was needed to make it.
    """
    if not (job.root / "CURRENT").is_file():
        return None
    live = read_generation(job.root)
    if job.job not in live.jobs:
        return None
    try:
        check_files(job.root, live.sizes)
    except BadIndex:
        if live.jobs != {job.job} or live.n_live < live.n_images:
            raise
        return None
    return live


def run_job(
    job: JobFolder,
    plan: JobPlan,
    intake: Intake,
    engine: AbstractContextManager[Engine],
    progress: Progress,
) -> IndexReport:
    """Do what is missing of a job that indexes a survey, and make its segment the whole index.

    A finished job is only reported; what was in the index before can be gone back to.
    engine : entered only if there is work.
    """
    return run_and_commit(job, plan, intake, engine, progress, whole_index)


def run_and_commit(
    job: JobFolder,
    plan: JobPlan,
    intake: Intake,
    engine: AbstractContextManager[Engine],
    progress: Progress,
    assemble: Assemble,
) -> IndexReport:
    """Do what is missing of a job and commit what `assemble` makes of it."""
    started = time.perf_counter()
    generation = find_finished(job)
    extracted = 0
    if generation is None:
        with working(job), watching(job, plan, progress) as watch:
            begin_again(job.path)
            job.open_again()
            if not is_built(job, plan):
                with engine as running:
                    extracted = build(job, plan, watch.followed(running), watch)
            with watch.at("commit"):
                generation = _commit(job, plan, intake, assemble)
    if not is_worked_on(job):  # by the same command, run twice at once
        job.close()
    return report_of_job(job, plan, intake, generation, extracted, started)


def whole_index(writer: Writer, plan: JobPlan, intake: Intake, segment: Segment) -> Generation:
    """A generation of this segment alone."""
    return Generation(
        number=writer.next_number(),
        made_by=plan.verb,
        created_at=now(),
        config=plan.config,
        config_digest=plan.config_digest,
        crs=intake.crs,
        area=area_around(positions_of(segment.catalogue), intake.crs),
        allow_ballpark=intake.allow_ballpark,
        codebooks=plan.codebooks,
        codebooks_digest=segment.codebooks_digest,
        segments=(segment.entry,),
        files={**segment.files, **segment.codebook_files},
    )


def report_of_job(
    job: JobFolder,
    plan: JobPlan,
    intake: Intake,
    generation: Generation,
    extracted: int,
    started: float,
) -> IndexReport:
    """What a person is told of a finished job. started : by `time.perf_counter`."""
    receipts = extract_receipts(job, plan)
    return IndexReport(
        generation=generation,
        skipped=all_skipped(intake, receipts),
        without_frames=sum(receipt.counts["without_frames"] for receipt in receipts),
        images_extracted=extracted,
        bytes_on_disk=generation.n_bytes,
        seconds=time.perf_counter() - started,
        warnings=_warnings(receipts),
    )


def _commit(job: JobFolder, plan: JobPlan, intake: Intake, assemble: Assemble) -> Generation:
    segment = finish_segment(job, plan, intake)
    with writing(job.root) as writer:
        done = find_finished(job)
        if done is not None:
            return done
        generation = assemble(writer, plan, intake, segment)
        writer.commit(generation)
    return generation


def _warnings(receipts: Iterable[Receipt]) -> tuple[str, ...]:
    sets = Counter(receipt.instruction_set for receipt in receipts)
    if len(sets) < 2:
        return ()
    warning = (
        f"The shards were worked on with different instruction sets ({'; '.join(sorted(sets))}): "
        "the index is sound, but another run may differ in bytes."
    )
    return (warning,)
