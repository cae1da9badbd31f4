"""`flaneur batch status|list|results`: how batches are, and what they have found."""

import json
import time
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.cli.lists import SOME_SKIPPED, IndexFolder
from coordinator.cli.outputs import result_file, utf_8
from coordinator.cli.photo_options import AsJson, Batches, Name, batch_folder, from_anywhere
from coordinator.cli.show import tell
from coordinator.cli.tables import print_line, print_table

if TYPE_CHECKING:  # faiss and pyproj are imported when a verb runs
    from coordinator.batches.states import BatchState

LOOK_S = 2.0


def status(
    name: Name,
    index: IndexFolder,
    batches: Batches = None,
    watch: Annotated[
        bool, typer.Option("--watch", help="Tell again and again until it has ended.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """How far a batch is, how fast it goes, and who works on it."""
    from coordinator.batches.states import state_of_batch

    folder = batch_folder(name, index, batches)
    state = state_of_batch(folder)
    _print_state(state, as_json)
    while watch and state.state in ("at work", "paused", "ending"):
        time.sleep(LOOK_S)
        before, state = state, state_of_batch(folder)
        if state != before:
            _print_state(state, as_json)


def list_(index: IndexFolder, batches: Batches = None, as_json: AsJson = False) -> None:
    """All batches, by name."""
    from coordinator.batches.batch import batches_in
    from coordinator.batches.states import state_of_batch
    from coordinator.batches.submitting import place_of_batches

    place = place_of_batches(index, batches)
    states = [state_of_batch(each) for each in batches_in(place)]
    if as_json:
        typer.echo(utf_8(json.dumps([asdict(each) for each in states])))
    elif states:
        rows = [
            (
                *(each.name, each.state, f"{each.photos:,}", f"{each.done:,}"),
                *(f"{each.failed:,}", str(each.generation), each.made_at),
            )
            for each in states
        ]
        columns = ("batch", "state", "photos", "done", "failed", "generation", "submitted (UTC)")
        print_table(columns, rows)
    else:
        print_line(f"{place} has no batch")


def results(
    name: Name,
    index: IndexFolder,
    batches: Batches = None,
    out: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="As of `locate`, or .geojsons for a GeoJSON text sequence (RFC 8142); may be "
            "given several times. Default: GeoJSON on stdout.",
        ),
    ] = None,
    seq: Annotated[
        bool, typer.Option("--seq", help="A GeoJSON text sequence on stdout (RFC 8142).")
    ] = False,
) -> int:
    """What a batch has found so far, in the order of its photos; it may go on meanwhile.

    A collection of a batch that is not finished says "partial": true.
    """
    from coordinator.batches.journal import Answers
    from coordinator.batches.results import about_results, answered_photos, index_for
    from coordinator.export.geojson import encoded, sequence
    from coordinator.export.results import (
        features_of,
        refuse_unknown,
        refuse_unwritable,
        write_results,
    )

    folder = batch_folder(name, index, batches)
    plan = folder.read()
    outs = [result_file(each) for each in out or ()]
    refuse_unknown(outs)
    refuse_unwritable(outs)
    found = Answers.read(folder.answers)
    done, failed = found.count()
    about = about_results(plan, done)
    answers = answered_photos(folder, found)
    if outs:
        write_results(outs, answers, index_for(from_anywhere(index), plan, outs), about, tell)
        tell(
            f"{done - failed} of {plan.n_photos} photos located, {failed} could not be: "
            f"{', '.join(map(str, outs))}"
        )
    else:
        features = features_of(answers)
        for piece in sequence(features) if seq else encoded(features, about):
            typer.echo(piece, nl=False)  # UTF-8 in every locale
    if done < plan.n_photos:
        tell(f"{plan.n_photos - done} of {plan.n_photos} photos have no answer yet")
    return SOME_SKIPPED if failed else 0


def _print_state(state: "BatchState", as_json: bool) -> None:
    if as_json:
        typer.echo(utf_8(json.dumps(asdict(state))))
        return
    counts = f"{state.done:,} of {state.photos:,} photos, {state.failed:,} could not be located"
    parts = [f"{state.name}: {state.state}, {counts}"]
    if state.photos_per_s is not None:
        parts.append(f"{state.photos_per_s:.2f} photos/s")
    if state.left_s is not None and state.state == "at work":
        parts.append(f"{_span(state.left_s)} left")
    if state.workers:
        parts.append(f"by {', '.join(state.workers)}")
    print_line("; ".join(parts))
    if state.told and state.state != "finished":
        print_line(f"last: {state.told}")


def _span(seconds: float) -> str:
    minutes = round(seconds / 60)
    return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
