"""`flaneur job`: what jobs an index has, what they did; pausing, resuming and cancelling them."""

import json
from collections.abc import Callable
from dataclasses import asdict
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.cli.lists import OwnIndex
from coordinator.cli.outputs import utf_8
from coordinator.cli.show import tell
from coordinator.cli.tables import print_line, print_table

if TYPE_CHECKING:  # faiss and pyproj are imported when a verb runs
    from pathlib import Path

    from coordinator.known_jobs import KnownJob
    from index.control import Wish

NAME = "job"
HELP = "The jobs of an index (index, add, compact): list, pause, resume, cancel, report."

Job = Annotated[
    str | None,
    typer.Argument(
        help="The job's id, or how it begins; may be left away where one is unfinished or at work."
    ),
]
AnyJob = Annotated[
    str | None,
    typer.Argument(help="The job's id, or how it begins; default: the one begun last."),
]
AsJson = Annotated[bool, typer.Option("--json", help="As JSON on stdout.")]


def list_(index: OwnIndex, as_json: AsJson = False) -> None:
    """All jobs of an index, the one begun last at the end, and how each is.

    at work, waiting (for the broker or a worker), pausing, paused, ending: a coordinator is there.
    stopped, failed, cancelled: none is, and running the same command again goes on.
    """
    from coordinator.known_jobs import known_jobs

    root = index.absolute()
    known = known_jobs(root)
    if as_json:
        typer.echo(utf_8(json.dumps([_record(job) for job in known])))
    elif known:
        columns = ("job", "verb", "begun (UTC)", "images", "shards extracted", "state")
        print_table(columns, [_row(job) for job in known])
    else:
        print_line(f"{root} has no job")


def pause(index: OwnIndex, job: Job = None, as_json: AsJson = False) -> None:
    """Send nothing more of a job to the workers; what is begun is finished.

    The coordinator stays and waits for `flaneur job resume`; workers are free for other jobs.
    """
    _wish(index, job, "pause", as_json, _of_pause)


def resume(index: OwnIndex, job: Job = None, as_json: AsJson = False) -> None:
    """Let a paused job go on."""
    _wish(index, job, "run", as_json, _of_resume)


def cancel(index: OwnIndex, job: Job = None, as_json: AsJson = False) -> None:
    """End a job: its coordinator exits with 1, its queued tasks are not worked on.

    What is done stays, and running the command that began it again goes on from there.
    """
    _wish(index, job, "cancel", as_json, _of_cancel)


def report(index: OwnIndex, job: AnyJob = None, as_json: AsJson = False) -> None:
    """What a job did so far: time by stage, slowest shards, images skipped by reason, workers."""
    from coordinator.known_jobs import latest_job
    from coordinator.watching.report import report_of
    from coordinator.watching.telling import in_words

    told = report_of(latest_job(index.absolute(), job).folder)
    if as_json:
        typer.echo(utf_8(json.dumps(asdict(told), ensure_ascii=False)))
    else:
        for line in in_words(told).splitlines():
            print_line(line)


def _wish(
    index: "Path",
    name: str | None,
    wish: "Wish",
    as_json: bool,
    words: "Callable[[KnownJob], list[str]]",
) -> None:
    """Say what is wished of a job, and tell what comes of it. words : that tell it to a person."""
    from coordinator.known_jobs import unfinished_job
    from index.control import write_wish

    job = unfinished_job(index.absolute(), name)
    write_wish(job.folder.path, wish)
    if as_json:
        told = {"job": job.folder.job, "wish": wish, "at_work": job.is_at_work}
        typer.echo(utf_8(json.dumps(told)))
    else:
        for line in words(job):
            tell(line)


def _of_pause(job: "KnownJob") -> list[str]:
    name = job.folder.job
    if not job.is_at_work:
        return [f"Job {name}: nobody works on it: there is nothing to pause.", _run_again(job)]
    return [
        f"Job {name}: nothing more is sent, and what is begun is finished.",
        f"To go on: flaneur job resume {job.folder.root} {name}",
    ]


def _of_resume(job: "KnownJob") -> list[str]:
    if job.is_at_work:
        return [f"Job {job.folder.job} goes on."]
    return [f"Job {job.folder.job}: nobody works on it.", _run_again(job)]


def _of_cancel(job: "KnownJob") -> list[str]:
    comes = (
        "its coordinator ends within seconds"
        if job.is_at_work
        else "nobody works on it, and workers leave what is queued of it"
    )
    return [f"Job {job.folder.job}: {comes}. What is done stays.", _run_again(job)]


def _run_again(job: "KnownJob") -> str:
    return f"To go on, run the same command again: {job.command or f'flaneur {job.verb} …'}"


def _row(job: "KnownJob") -> tuple[str, ...]:
    return (
        job.folder.job,
        job.verb or "-",
        _when(job).replace("T", " ")[:16],
        f"{job.images:,}",
        f"{job.extracted} of {job.shards}" if job.shards else "-",
        job.condition,
    )


def _record(job: "KnownJob") -> dict[str, object]:
    return {
        "job": job.folder.job,
        "verb": job.verb,
        "state": job.condition,
        "images": job.images,
        "shards": job.shards,
        "extracted": job.extracted,
        "begun_at": _when(job),
        "command": job.command,
    }


def _when(job: "KnownJob") -> str:
    return datetime.fromtimestamp(job.begun_at, UTC).isoformat(timespec="seconds")


COMMANDS: dict[str, Callable[..., int | None]] = {
    "list": list_,
    "pause": pause,
    "resume": resume,
    "cancel": cancel,
    "report": report,
}
