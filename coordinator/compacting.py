"""Compacting: the live images of all segments become one segment, as if indexed in one go."""

import time
from collections import Counter
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex
from contracts.progress import Progress
from coordinator.building import is_built, merge
from coordinator.committing import area_around, now, positions_of, segment_of
from coordinator.engine.running import Engine
from coordinator.plan import free_segment, job_id, write_train_receipts
from coordinator.watching.watch import watching
from index.catalogue import CatalogueRow
from index.codebooks import words_of_generation
from index.commits import is_worked_on, working, writing
from index.control import begin_again
from index.files import write_array
from index.jobs import JobFolder, JobPlan
from index.manifest import Generation, SegmentEntry, read_generation
from index.opened import OpenedIndex


@dataclass(frozen=True, slots=True)
class CompactReport:
    """What compacting did. job : that did it; None: there was nothing to do.

    before : the generation that was compacted.
    """

    job: JobFolder | None
    before: Generation
    generation: Generation
    seconds: float


def is_compact(generation: Generation) -> bool:
    """Whether there is nothing to compact: one segment, and nothing removed."""
    return len(generation.segments) == 1 and generation.n_live == generation.n_images


def compact(
    root: Path, engine: AbstractContextManager[Engine], progress: Progress
) -> CompactReport:
    """Make one segment of the live images, in the order of the bytes of their uris.

    Interrupted and run again, it goes on. Ids of images change, scores do not.
    engine : entered only if there is work.

    Raises
    ------
    BadIndex : the index was changed meanwhile; nothing is committed then.
    """
    started = time.perf_counter()
    index = OpenedIndex(root)
    live = index.generation
    if is_compact(live):
        return CompactReport(None, live, live, 0.0)
    job, plan = _plan(index)
    with working(job), watching(job, plan, progress) as watch:
        begin_again(job.path)
        job.open_again()
        order = _order(index)
        if not is_built(job, plan):
            _write_new_ids(job, index, order)
            sizes = {
                name: int(index.document_frequency(name).sum())
                for name in live.config.features.channels()
            }
            with engine as running:
                merge(job, plan, sizes, index.n_live, watch.followed(running), watch, False)
        with watch.at("commit"):
            generation = _commit(job, plan, index, order)
    if not is_worked_on(job):
        job.close()
    return CompactReport(job, live, generation, time.perf_counter() - started)


def _plan(index: OpenedIndex) -> tuple[JobFolder, JobPlan]:
    """Find or write the job; it belongs to this one state of the index."""
    live = index.generation
    job = JobFolder(index.root, job_id(("compact", live.digest())))
    words = words_of_generation(index.root, live)
    with writing(index.root):
        if job.has_plan():
            return job, job.read_plan()
        plan = JobPlan(
            job=job.job,
            verb="compact",
            config=live.config,
            config_digest=live.config_digest,
            segment=free_segment(index.root),
            codebooks=live.codebooks,
            trains=False,
            compacts=tuple(segment.name for segment in live.segments),
            n_images=live.n_live,
            shard_size=1,
            n_shards=0,
        )
        write_train_receipts(job, words)
        job.write_plan(plan, ())
    return job, plan


def _order(index: OpenedIndex) -> NDArray[np.int64]:
    """Ids of the live images in the order of the bytes of their uris; (n_live,)."""
    uris = index.catalogue.column("uri")
    return np.array(sorted(index.live_ids.tolist(), key=lambda each: uris[each].encode()), np.int64)


def _write_new_ids(job: JobFolder, index: OpenedIndex, order: NDArray[np.int64]) -> None:
    new_ids = np.full(index.n_images, -1, dtype=np.int64)
    new_ids[order] = np.arange(len(order))
    for segment, ids in index.generation.placed:
        write_array(job.new_ids(segment.name), new_ids[ids])


def _commit(
    job: JobFolder, plan: JobPlan, index: OpenedIndex, order: NDArray[np.int64]
) -> Generation:
    """Put the new segment in the place of all those that it was made of."""
    live = index.generation
    rows = [replace(row, image_id=number) for number, row in enumerate(index.catalogue.rows(order))]
    segment = segment_of(job, plan, _entry(plan, live.segments, rows), rows, live.crs)
    with writing(job.root) as writer:
        current = read_generation(job.root)
        if [each.name for each in current.segments] == [plan.segment]:
            return current  # by the same command, run twice at once
        if current.digest() != live.digest():
            raise BadIndex(
                f"{job.root} was changed (generation {current.number}) while generation "
                f"{live.number} was compacted, and stays as it is. Run `flaneur compact` again; "
                "with --prune it also removes what was prepared."
            )
        generation = live.model_copy(
            update={
                "number": writer.next_number(),
                "made_by": plan.verb,
                "created_at": now(),
                "area": area_around(positions_of(segment.catalogue), live.crs),
                "segments": (segment.entry,),
                "files": {**segment.files, **segment.codebook_files},
            }
        )
        writer.commit(generation)
    return generation


def _entry(
    plan: JobPlan, segments: Sequence[SegmentEntry], rows: Sequence[CatalogueRow]
) -> SegmentEntry:
    """What is to be said of the new segment; distances to words are weighted by images."""
    latest = {survey.name: survey for segment in segments for survey in segment.surveys}
    left = Counter(row.survey for row in rows)
    weights = [segment.n_images for segment in segments]
    return SegmentEntry(
        name=plan.segment,
        jobs=tuple(job for segment in segments for job in segment.jobs),
        n_images=len(rows),
        n_postings=0,
        n_skipped=sum(segment.n_skipped for segment in segments),
        surveys=tuple(
            survey.model_copy(update={"n_images": left[name]})
            for name, survey in latest.items()
            if left[name]
        ),
        quantisation={
            channel: float(
                np.average([segment.quantisation[channel] for segment in segments], weights=weights)
            )
            for channel in plan.config.features.channels()
        },
    )
