"""Adding: images that an index does not have yet become one more segment of it.

They are described and assigned as the index's own images were, by its configuration and words.
"""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from contracts.errors import BadConfig, BadIndex
from contracts.places import Place
from contracts.progress import Progress
from contracts.records import PosedImage
from coordinator.building import NothingReadable
from coordinator.committing import Segment, area_around, now, positions_of
from coordinator.engine.running import Engine
from coordinator.indexing import IndexReport, find_finished, report_of_job, run_and_commit
from coordinator.intake import Intake, read_surveys
from coordinator.plan import plan_images
from coordinator.reusing import misfit
from index.codebooks import words_of_generation
from index.commits import Writer
from index.jobs import JobFolder, JobPlan
from index.manifest import Generation, read_generation
from index.opened import OpenedIndex
from survey import ReadOptions


@dataclass(frozen=True, slots=True)
class NewImages:
    """What a survey has that an index has not. n_known : images of the survey that it has."""

    intake: Intake
    n_known: int


def find_new(index: OpenedIndex, name: str, path: Place, options: ReadOptions) -> NewImages:
    """Read a survey, in the coordinates of the index, and leave out what is live in the index.

    Raises
    ------
    BadSurvey, UnknownCrs : as `read_surveys`. BadConfig : an image of the same uri lies elsewhere.
    """
    intake = read_surveys([(name, path)], options, index.generation.crs)
    ids = index.ids_by_uri()
    paths = index.catalogue.column("path")
    new = [row for row, image in enumerate(intake.images) if image.uri not in ids]
    for image in intake.images:
        known = ids.get(image.uri)
        if known is not None:
            _refuse_another(index.root, image, paths[known])
    images = tuple(intake.images[row] for row in new)
    names = tuple(intake.survey_names[row] for row in new)
    notes = (*intake.notes, *_caveats(index, images))
    taken = replace(intake, images=images, survey_names=names, notes=notes)
    return NewImages(taken, len(intake.images) - len(new))


def before_replacing(job: JobFolder, plan: JobPlan, intake: Intake) -> str | None:
    """What a person should know whose job will replace all that is live; None: it will not."""
    if not (job.root / "CURRENT").is_file() or find_finished(job) is not None:
        return None
    try:
        index = OpenedIndex(job.root)
        there = index.ids_by_uri().keys()
    except BadIndex as error:
        return f"What is live is damaged, and will be replaced: {error}"
    read = {image.uri for image in intake.images}
    told = (
        f"{job.root} holds {index.n_live} images (generation {index.generation.number}), which "
        "will be replaced; `flaneur rollback` goes back."
    )
    if there < read and index.generation.config_digest == plan.config_digest:
        n_new = len(read) - len(there)
        told += f" To add only the {n_new} new images, stop this and use `flaneur add`."
    return told


def plan_addition(
    index: OpenedIndex, intake: Intake, shard_size: int | None = None
) -> tuple[JobFolder, JobPlan]:
    """Find or write the job that adds these images.

    Images that were added, removed and are added again need another job than the first time: its
    segment is in the index, with all of them removed.
    """
    words = words_of_generation(index.root, index.generation)
    config = index.generation.config
    again = 0
    while True:
        job, plan = plan_images(index.root, "add", intake.images, config, shard_size, words, again)
        if find_finished(job) is None:
            return job, plan
        again += 1


def run_addition(
    job: JobFolder,
    plan: JobPlan,
    intake: Intake,
    engine: AbstractContextManager[Engine],
    progress: Progress,
) -> IndexReport:
    """Do what is missing of a job that adds images, and commit it beside what is live then.

    If none of them can be read, nothing is committed and the report says so.
    """
    started = time.perf_counter()
    try:
        report = run_and_commit(job, plan, intake, engine, progress, with_segment)
    except NothingReadable:
        return report_of_job(job, plan, intake, read_generation(job.root), 0, started)
    added = next(each for each in report.generation.segments if job.job in each.jobs)
    first = report.generation.segments[0]
    warning = misfit(
        first.quantisation,
        added.quantisation,
        "to train words for all images, index them together into a new folder",
        _points_per_word(JobFolder(job.root, first.jobs[0]), plan),
    )
    return report if warning is None else replace(report, warnings=(*report.warnings, warning))


def with_segment(writer: Writer, plan: JobPlan, intake: Intake, segment: Segment) -> Generation:
    """The live generation and one more segment.

    Raises
    ------
    BadIndex : the index changed meanwhile so that they do not fit together any more.
    """
    index = OpenedIndex(writer.root)
    live = index.generation
    _refuse_changed(index, plan, intake, segment)
    crs = live.crs or intake.crs
    places = [positions_of(each) for each in (index.catalogue, segment.catalogue)]
    return live.model_copy(
        update={
            "number": writer.next_number(),
            "made_by": plan.verb,
            "created_at": now(),
            "crs": crs,
            "area": area_around(np.concatenate(places), crs),
            "allow_ballpark": live.allow_ballpark or intake.allow_ballpark,
            "segments": (*live.segments, segment.entry),
            "files": {**live.files, **segment.files},
        }
    )


def _caveats(index: OpenedIndex, images: Sequence[PosedImage]) -> Iterator[str]:
    """What a person should know where only some images of an index have poses."""
    n_unposed = sum(image.pose is None for image in images)
    if index.generation.crs is not None and n_unposed:
        yield (
            f"{n_unposed} of the new images have no pose: photos are matched with them, but "
            "they give no place"
        )
    if index.generation.crs is None and n_unposed < len(images):
        yield "The images of the index have no poses: matches give a place with the new ones only"


def _refuse_another(root: Path, image: PosedImage, path: str) -> None:
    if image.path == path or Path(image.path).resolve() == Path(path).resolve():
        return
    raise BadConfig(
        f"{root} has an image {image.uri!r} already, from {path}; that of the survey is "
        f"{image.path}. Give another survey a name of its own with --name; if the same survey was "
        "moved, remove its images first (flaneur remove) and add them again."
    )


def _refuse_changed(index: OpenedIndex, plan: JobPlan, intake: Intake, segment: Segment) -> None:
    live = index.generation
    before = "while these images were prepared. Nothing was committed: run the same command again."
    if live.codebooks != plan.codebooks or live.config_digest != plan.config_digest:
        raise BadIndex(f"{index.root} was given other words (generation {live.number}) {before}")
    if live.crs is not None and intake.crs not in (None, live.crs):
        raise BadIndex(
            f"{index.root} was given poses in {live.crs} (generation {live.number}), these are in "
            f"{intake.crs}, {before}"
        )
    there = index.ids_by_uri()
    twice = next((uri for uri in segment.catalogue.column("uri") if uri in there), None)
    if twice is not None:
        raise BadIndex(f"{index.root} was given {twice!r} (generation {live.number}) {before}")


def _points_per_word(trainer: JobFolder, plan: JobPlan) -> dict[str, float]:
    """By channel, how many descriptors each word was made of; infinite: words from elsewhere.

    trainer : the job of the index's first images.
    """
    points = {}
    for channel in plan.config.features.channels():
        trained = trainer.read_receipt("train", channel)
        counts = {} if trained is None else trained.counts
        n_points = counts.get("points", 0)
        points[channel] = n_points / max(counts["words"], 1) if n_points else math.inf
    return points
