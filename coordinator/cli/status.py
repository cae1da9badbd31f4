"""`flaneur status`: what an index holds, and what state it is in."""

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from contracts.errors import BadConfig, BadIndex
from contracts.places import Place
from coordinator.cli.lists import SeenIndex
from coordinator.cli.opening import folder_of
from coordinator.cli.outputs import utf_8
from coordinator.cli.show import complain
from coordinator.cli.tables import print_line, print_table

if TYPE_CHECKING:  # faiss and pyproj are imported when the verb runs
    from coordinator.index_state import IndexState, JobState

NAME = "status"
DAMAGED = 2
"""Exit code: the live generation lacks files, or cannot be read."""


def command(
    index: SeenIndex,
    watch: Annotated[
        bool,
        typer.Option("--watch", help="Show how its jobs and batches go, until Ctrl-C."),
    ] = False,
    broker: Annotated[
        str | None,
        typer.Option(metavar="URL", help="With --watch: also tell who listens at this broker."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON on stdout.")] = False,
) -> int:
    """What an index holds: generations, segments, words, unfinished jobs, bytes, health.

    Changes nothing, and may run while another process writes. Of files only the sizes are
    compared; `flaneur verify` reads them. Exit code 2: the live generation is damaged.
    """
    if watch:
        _watch(index, broker, as_json)
        return 0
    from coordinator.status import state_of

    held = folder_of(index)
    state = replace(state_of(held.root), index=str(index.absolute()))
    if as_json:
        typer.echo(utf_8(json.dumps(asdict(state), ensure_ascii=False, allow_nan=False)))
    else:
        _print(state)
    return DAMAGED if state.faults else 0


def _watch(index: Place, broker: str | None, as_json: bool) -> None:
    from coordinator.cli.watching import present_at, watch

    if not isinstance(index, Path):
        raise BadConfig(
            f"{index} is in a store, where no job works. Watch the folder that it was published "
            "from."
        )
    root = index.absolute()
    if not any((root / name).exists() for name in ("jobs", "batches", "CURRENT")):
        raise BadIndex(f"{root} is no index, and none is being made there. Name an index.")
    watch(root, present_at(broker), as_json)


def _print(state: "IndexState") -> None:
    print_line(_headline(state))
    _print_generations(state)
    _print_segments(state)
    _print_codebooks(state)
    _print_jobs(state.jobs)
    print_line("")
    print_line(f"{state.bytes:,} bytes in all")
    if state.bytes_unneeded:
        print_line(
            f"{state.bytes_unneeded:,} of them only earlier generations or nobody needs: "
            "`flaneur compact --prune` frees them"
        )
    if len(state.instruction_sets) > 1:
        print_line(
            f"Extracted with different instruction sets: {'; '.join(state.instruction_sets)}"
        )
    for hint in state.hints:
        print_line(hint)
    for fault in state.faults:
        complain(fault)


def _headline(state: "IndexState") -> str:
    live = next((each for each in state.generations if each.number == state.live), None)
    if live is None:
        return f"{state.index}: " + ("damaged" if state.faults else "nothing to search yet")
    health = "damaged" if state.faults else "all files there"
    return f"{state.index}: {live.images:,} images, generation {live.number}, {health}"


def _print_generations(state: "IndexState") -> None:
    rows = [
        (
            f"{each.number} live" if each.number == state.live else str(each.number),
            each.made_by,
            each.created_at[:16].replace("T", " "),
            f"{each.images:,}",
            f"{each.removed:,}",
            str(each.segments),
            f"{len(each.faults)} damaged" if each.faults else "there",
        )
        for each in state.generations
    ]
    columns = ("generation", "by", "made (UTC)", "images", "removed", "segments", "files")
    _print_some(columns, rows)


def _print_segments(state: "IndexState") -> None:
    rows = [
        (
            each.name,
            f"{each.images:,}",
            f"{each.removed:,}",
            f"{each.postings:,}",
            f"{each.bytes:,}",
            f"{each.bytes / each.postings:.2f}" if each.postings else "-",
            ", ".join(each.surveys),
        )
        for each in state.segments
    ]
    columns = ("segment", "images", "removed", "postings", "bytes", "bytes a posting", "surveys")
    _print_some(columns, rows)


def _print_codebooks(state: "IndexState") -> None:
    rows = [
        (each.channel, "-" if each.words is None else f"{each.words:,}", f"{each.bytes:,}")
        for each in state.codebooks
    ]
    _print_some((f"words {state.codebooks_digest}", "words", "bytes"), rows)


def _print_jobs(jobs: "tuple[JobState, ...]") -> None:
    rows = [
        (
            each.job,
            each.verb or "-",
            f"{each.images:,}",
            *(_progress(each, stage) for stage in ("extract", "train", "assign", "merge", "join")),
            _how_it_is(each),
        )
        for each in jobs
    ]
    columns = ("unfinished job", "verb", "images", "extract", "train", "assign", "merge", "join")
    _print_some((*columns, "state"), rows)


def _how_it_is(job: "JobState") -> str:
    if job.fault:
        return job.fault
    state = {True: "at work", False: "stopped", None: ""}[job.at_work]
    return f"{state}, last receipt {job.last_receipt_at}" if job.last_receipt_at else state


def _progress(job: "JobState", stage: str) -> str:
    """How many of a stage's tasks are done; how many merges there are is known once it begins."""
    totals = {"extract": job.shards, "assign": job.shards, "train": job.channels}
    total = {**totals, "join": job.channels}.get(stage)
    return f"{job.done[stage]}" if total is None else f"{job.done[stage]} of {total}"


def _print_some(columns: tuple[str, ...], rows: Sequence[Sequence[str]]) -> None:
    if rows:
        print_line("")
        print_table(columns, rows)
