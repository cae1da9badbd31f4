"""The jobs of an index, finished or not, and which of them a person means."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from contracts.errors import BadConfig, BadIndex
from coordinator.index_state import JobState
from coordinator.status import state_of
from coordinator.watching.progress import read_progress
from coordinator.watching.seeing import Seen, Sight
from index.control import Wish, read_wish
from index.jobs import JobFolder, jobs_of

Condition = Literal[
    "at work",
    "waiting",
    "pausing",
    "paused",
    "ending",
    "finished",
    "stopped",
    "failed",
    "cancelled",
    "damaged",
]
"""waiting : for the broker or a worker. pausing, ending : it was told to, and has not heeded it
yet."""
AT_WORK: tuple[Condition, ...] = ("at work", "waiting", "pausing", "paused", "ending")
"""A coordinator is there."""


@dataclass(frozen=True, slots=True)
class KnownJob:
    """A job of an index.

    images, shards : as planned; shards is None where there is no plan, 0 where it has none.
    extracted : shards. begun_at : seconds since 1970, when its plan was written.
    command : that it was begun by, without a password; "" where that is not known.
    """

    folder: JobFolder
    verb: str
    condition: Condition
    images: int
    shards: int | None
    extracted: int
    begun_at: float
    command: str

    @property
    def is_at_work(self) -> bool:
        return self.condition in AT_WORK


def known_jobs(root: Path) -> list[KnownJob]:
    """The jobs of an index, the one begun last at the end.

    Raises
    ------
    BadIndex : `root` is neither an index nor one that is being made.
    """
    unfinished = {state.job: state for state in state_of(root).jobs}
    seen = {each.folder: each for each in Sight(root).look()}
    jobs = [
        _finished(job)
        if job.job not in unfinished
        else _unfinished(job, unfinished[job.job], seen.get(job.path))
        for job in jobs_of(root)
    ]
    return sorted(jobs, key=lambda each: (each.begun_at, each.folder.job))


def unfinished_job(root: Path, name: str | None) -> KnownJob:
    """The unfinished job whose id begins with `name`; None: the only one, or the one at work.

    Raises
    ------
    BadConfig : there is none, there are several, or it is finished. BadIndex : not an index.
    """
    known = known_jobs(root)
    job = _only(root, known) if name is None else _named(root, known, name)
    if job.condition == "finished":
        raise BadConfig(
            f"Job {job.folder.job} is finished; there is nothing to pause, resume or cancel. "
            f"What it did: flaneur job report {root} {job.folder.job}"
        )
    return job


def latest_job(root: Path, name: str | None) -> KnownJob:
    """The job whose id begins with `name`; None: the one begun last.

    Raises
    ------
    BadConfig : there is none, or there are several. BadIndex : not an index.
    """
    known = known_jobs(root)
    if name is not None:
        return _named(root, known, name)
    if not known:
        raise BadConfig(f"{root} has no job. `flaneur index` begins one.")
    return known[-1]


def _only(root: Path, known: list[KnownJob]) -> KnownJob:
    unfinished = [job for job in known if job.condition != "finished"]
    at_work = [job for job in unfinished if job.is_at_work]
    if not unfinished:
        raise BadConfig(f"{root} has no unfinished job. All its jobs: flaneur job list {root}")
    if len(unfinished) > 1 and len(at_work) != 1:
        raise BadConfig(f"{root} has several unfinished jobs. Name one: {_names(unfinished)}")
    return (at_work or unfinished)[0]


def _named(root: Path, known: list[KnownJob], name: str) -> KnownJob:
    meant = [job for job in known if name and job.folder.job.startswith(name.lower())]
    if not meant:
        told = f"Its jobs: {_names(known)}" if known else "It has none."
        raise BadConfig(f"{root} has no job whose id begins with {name!r}. {told}")
    if len(meant) > 1:
        raise BadConfig(f"{name!r} begins the id of several jobs. Name more of it: {_names(meant)}")
    return meant[0]


def _names(jobs: list[KnownJob]) -> str:
    return ", ".join(f"{job.folder.job} ({job.condition})" for job in jobs)


def _finished(job: JobFolder) -> KnownJob:
    try:
        plan = job.read_plan()
    except BadIndex:  # what it made is committed, and needs no plan any more
        return KnownJob(job, "", "finished", 0, None, 0, _begun_at(job), "")
    shards = plan.n_shards
    return KnownJob(
        job, plan.verb, "finished", plan.n_images, shards, shards, _begun_at(job), _command(job)
    )


def _unfinished(job: JobFolder, state: JobState, seen: Seen | None) -> KnownJob:
    condition: Condition = "damaged" if state.fault else _condition(job, state, seen)
    return KnownJob(
        folder=job,
        verb=state.verb,
        condition=condition,
        images=state.images,
        shards=state.shards,
        extracted=state.done["extract"],
        begun_at=_begun_at(job),
        command=_command(job),
    )


def _condition(job: JobFolder, state: JobState, seen: Seen | None) -> Condition:
    wish: Wish = read_wish(job.path)
    told = None if seen is None else seen.progress.state
    if seen.is_at_work if seen is not None else state.at_work:
        if wish == "cancel":
            return "ending"
        if wish == "pause":
            return "paused" if told == "paused" else "pausing"
        return "waiting" if told in ("waiting", "alone") else "at work"
    if wish == "cancel" or told == "cancelled":
        return "cancelled"
    return "failed" if told == "failed" else "stopped"


def _command(job: JobFolder) -> str:
    progress = read_progress(job.path)
    return "" if progress is None else progress.command


def _begun_at(job: JobFolder) -> float:
    plan = job.path / "plan.json"
    return (plan if plan.is_file() else job.path).stat().st_mtime
