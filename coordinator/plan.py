"""Planning: surveys become one ordered list of images, cut into shards of minutes of work."""

import hashlib
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

from pydantic import ValidationError

from contracts.config import IndexConfig
from contracts.errors import BadConfig, BadIndex, BadSurvey
from contracts.records import PosedImage, Skipped
from geo.reprojection import reproject
from index.jobs import JobFolder, JobPlan
from survey import ReadOptions, Survey, read_survey

_JOB_ID = re.compile(r"[0-9a-f]{16}")
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
    notes: tuple[str, ...]
    allow_ballpark: bool


def read_surveys(sources: Sequence[tuple[str, Path]], options: ReadOptions) -> Intake:
    """Read every survey; `sources` are (name, path), the main survey's name is ''.

    The first survey with poses gives the CRS, those in another are converted into it.

    Raises
    ------
    BadSurvey : one is empty or no survey. UnknownCrs : a CRS cannot be converted.
    BadConfig : two have the same name.
    """
    name, count = Counter(name for name, _ in sources).most_common(1)[0]
    if count > 1:
        raise BadConfig(f"--also names {name!r} {count} times; give each survey its own name.")
    surveys = tuple(
        NamedSurvey(name, path, read_survey(path, _renamed(options, name)))
        for name, path in sources
    )
    crs = next((named.survey.crs for named in surveys if named.survey.crs is not None), None)
    if crs is not None:
        surveys = tuple(_in_crs(named, crs, options.allow_ballpark) for named in surveys)
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
        crs=crs,
        notes=tuple(note for named in surveys for note in named.survey.notes),
        allow_ballpark=options.allow_ballpark,
    )


def _in_crs(named: NamedSurvey, crs: str, allow_ballpark: bool) -> NamedSurvey:
    """A survey with its poses in the CRS of the index, and a note of how they were converted."""
    survey = named.survey
    if survey.crs in {crs, None}:
        return named
    posed = [row for row, image in enumerate(survey.images) if image.pose is not None]
    poses = [pose for image in survey.images if (pose := image.pose) is not None]
    found = reproject(poses, crs, allow_ballpark)
    images = list(survey.images)
    for row, pose in zip(posed, found.poses, strict=True):
        images[row] = replace(images[row], pose=pose)
    notes = (*survey.notes, *found.told(named.name))
    return replace(named, survey=replace(survey, images=tuple(images), crs=crs, notes=notes))


def _renamed(options: ReadOptions, name: str) -> ReadOptions:
    return replace(options, name=name)


def make_plan(
    root: Path, intake: Intake, config: IndexConfig, shard_size: int
) -> tuple[JobFolder, JobPlan]:
    """Find or write the job of this survey and configuration.

    The job's id is a digest of every image's uri, pose, size and time of change, and of the
    configuration: the same survey comes back to the same job, a changed one gets a new job.
    A job keeps the shard size it was begun with.

    Raises
    ------
    BadIndex : `root` is a file or another folder's, or the plan of a job in it is damaged.
    """
    job = JobFolder(root, _job_id(intake, config))
    if job.has_plan():
        return job, _plan_of(job)
    _refuse_foreign(root)
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


def _refuse_foreign(root: Path) -> None:
    if root.exists() and not root.is_dir():
        raise BadIndex(f"{root} is a file; an index is a folder. Name a new one.")
    if root.exists() and not _jobs(root) and any(root.iterdir()):
        raise BadIndex(
            f"{root} is not empty and not a Flaneur index; nothing was written there. "
            "Name a new folder."
        )


def _jobs(root: Path) -> list[JobFolder]:
    """The jobs begun in an index; what else lies in its `jobs/` is not ours."""
    names = sorted(path.name for path in (root / "jobs").glob("*") if path.is_dir())
    return [JobFolder(root, name) for name in names if _JOB_ID.fullmatch(name)]


def _plan_of(job: JobFolder) -> JobPlan:
    try:
        plan = job.read_plan()
    except ValidationError as error:
        raise BadIndex(
            f"{job.path / 'plan.json'} is damaged ({error.errors()[0]['msg']}). Remove the folder "
            f"{job.path} and index again."
        ) from error
    if not re.fullmatch("[0-9]{4,9}", plan.segment):  # it names folders that are written to
        raise BadIndex(
            f"{job.path / 'plan.json'} names the segment {plan.segment!r}, expected a number. "
            f"Remove the folder {job.path} and index again."
        )
    return plan


def _job_id(intake: Intake, config: IndexConfig) -> str:
    digest = hashlib.sha256(config.digest().encode())
    # Many images may lie in one file.
    states = {path: Path(path).stat() for path in {image.path for image in intake.images}}
    for image in intake.images:
        state = states[image.path]
        digest.update(f"{image!r} {state.st_size} {state.st_mtime_ns}\n".encode())
    return digest.hexdigest()[:16]


def _free_segment(root: Path) -> str:
    """The next number that no job has taken."""
    taken = [int(_plan_of(job).segment) for job in _jobs(root) if job.has_plan()]
    return f"{max(taken, default=0) + 1:04d}"
