"""Planning: surveys become one ordered list of images, cut into shards of minutes of work."""

import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from contracts.config import IndexConfig
from contracts.errors import BadIndex, BadSurvey, UnknownCrs
from contracts.records import PosedImage, Skipped
from index.jobs import JobFolder, JobPlan
from survey import ReadOptions, Survey, read_survey

DEFAULT_SHARD_SIZE = 32
"""Images a shard: half a minute of one core, so that a lost worker costs little."""


@dataclass(frozen=True, slots=True)
class NamedSurvey:
    """A survey as the command line names it; the main one has the name ''."""

    name: str
    path: Path
    survey: Survey


@dataclass(frozen=True, slots=True)
class Intake:
    """All images that are to be indexed together, in the order of their uris."""

    surveys: tuple[NamedSurvey, ...]
    images: tuple[PosedImage, ...]
    survey_names: tuple[str, ...]
    """The survey of each image."""
    skipped: tuple[Skipped, ...]
    crs: str | None


def read_surveys(sources: Sequence[tuple[str, Path]], options: ReadOptions) -> Intake:
    """Read every survey; `sources` are (name, path), the main survey's name is ''.

    Raises
    ------
    BadSurvey : one is empty or no survey. UnknownCrs : they have different CRSs.
    """
    surveys = tuple(
        NamedSurvey(name, path, read_survey(path, _renamed(options, name)))
        for name, path in sources
    )
    systems = {named.survey.crs for named in surveys if named.survey.crs is not None}
    if len(systems) > 1:
        raise UnknownCrs(
            f"The surveys are in {' and '.join(sorted(systems))}; one index has one CRS. "
            "Convert one of them, or index them separately."
        )
    tagged = sorted(
        ((image, named.name) for named in surveys for image in named.survey.images),
        key=lambda pair: pair[0].uri.encode(),
    )
    if not tagged:
        raise BadSurvey("No image of the survey can be used; see the reasons above.")
    images = tuple(image for image, _ in tagged)
    for former, later in pairwise(images):
        if former.uri == later.uri:
            raise BadSurvey(
                f"Two images are called {later.uri!r}. Give each --also survey its own name."
            )
    return Intake(
        surveys=surveys,
        images=images,
        survey_names=tuple(name for _, name in tagged),
        skipped=tuple(skip for named in surveys for skip in named.survey.skipped),
        crs=next(iter(systems), None),
    )


def _renamed(options: ReadOptions, name: str) -> ReadOptions:
    return replace(options, name=name)


def make_plan(
    root: Path, intake: Intake, config: IndexConfig, shard_size: int
) -> tuple[JobFolder, JobPlan]:
    """Find or write the job of this survey and configuration.

    The job's id is a digest of every image's uri, pose, size and time of change, and of the
    configuration: the same survey comes back to the same job, a changed one gets a new job.
    A job keeps the shard size it was begun with.
    """
    job = JobFolder(root, _job_id(intake, config))
    if job.has_plan():
        return job, job.read_plan()
    if root.exists() and not (root / "jobs").is_dir() and any(root.iterdir()):
        raise BadIndex(
            f"{root} is not empty and not a Flaneur index; nothing was written there. "
            "Name a new folder."
        )
    shards = [
        intake.images[start : start + shard_size]
        for start in range(0, len(intake.images), shard_size)
    ]
    plan = JobPlan(
        job=job.job,
        config=config,
        config_digest=config.digest(),
        segment=_free_segment(root),
        n_images=len(intake.images),
        shard_size=shard_size,
        n_shards=len(shards),
    )
    job.write_plan(plan, shards)
    return job, plan


def _job_id(intake: Intake, config: IndexConfig) -> str:
    digest = hashlib.sha256(config.digest().encode())
    for image in intake.images:
        status = Path(image.path).stat()
        digest.update(f"{image!r} {status.st_size} {status.st_mtime_ns}\n".encode())
    return digest.hexdigest()[:16]


def _free_segment(root: Path) -> str:
    """The next number that no job has taken."""
    taken = [
        int(JobFolder(root, entry.name).read_plan().segment)
        for entry in (os.scandir(root / "jobs") if (root / "jobs").is_dir() else ())
        if JobFolder(root, entry.name).has_plan()
    ]
    return f"{max(taken, default=0) + 1:04d}"
