"""`flaneur batch`: photos by the thousand, under a name, through kills, reboots and pauses."""

import shlex
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from contracts.errors import TaskFailed
from contracts.places import Place
from coordinator.cli.lists import (
    SOME_SKIPPED,
    Broker,
    Descriptors,
    IndexFolder,
    K,
    Pair,
    Vote,
    Weights,
    Workers,
    fitted_search,
    search_config,
)
from coordinator.cli.opening import opened_index
from coordinator.cli.photo_options import (
    Batches,
    Name,
    Sources,
    batch_folder,
    from_anywhere,
)
from coordinator.cli.seeing_batches import list_, results, status
from coordinator.cli.show import bars, tell
from coordinator.cli.where_options import (
    Bbox,
    Heading,
    InSurvey,
    Since,
    Until,
    Uri,
    Within,
    where_of,
)

if TYPE_CHECKING:  # faiss and pyproj are imported when a verb runs
    from coordinator.batches.batch import BatchFolder
    from coordinator.batches.states import BatchState

NAME = "batch"
HELP = "Batches of photos to locate: submit, status, results, pause, resume, cancel, list."

Wait = Annotated[
    bool,
    typer.Option(
        "--wait", help="Stay until it has ended; default: it goes on by itself, its log beside it."
    ),
]


def submit(
    name: Name,
    sources: Sources,
    index: IndexFolder,
    top: Annotated[int, typer.Option(help="Matches a photo.")] = 10,
    pair: Pair = "auto",
    k: K = "auto",
    vote: Vote = "auto",
    weights: Weights = "idf,norm",
    descriptors: Descriptors = None,
    bbox: Bbox = None,
    within: Within = None,
    since: Since = None,
    until: Until = None,
    heading: Heading = None,
    survey: InSurvey = None,
    uri: Uri = None,
    priority: Annotated[
        int, typer.Option(min=1, max=9, help="1 first, 9 last; `locate` is before all of them.")
    ] = 5,
    batches: Batches = None,
    workers: Workers = None,
    broker: Broker = None,
    wait: Wait = False,
) -> int:
    """Locate photos as a named batch, against the index as it is now.

    The same command again goes on where the batch is.
    """
    from coordinator.batches.fetching import Fetcher
    from coordinator.batches.sources import read_sources
    from coordinator.batches.submitting import refuse_another
    from coordinator.batches.submitting import submit as put_there

    search = search_config(pair, k, vote, weights, descriptors, top)
    folder = batch_folder(name, index, batches)
    opened = opened_index(index)
    search = fitted_search(search, vote, opened.config.features)
    where = where_of(
        opened.generation, bbox, within, since, until, heading, surveys=survey, uris=uri
    )
    search = search.model_copy(update={"where": where})
    if folder.exists():
        plan = folder.read()
        refuse_another(folder, plan, search, priority, sources)
        tell(f"It was submitted {plan.made_at}: photos that came since are not in it")
    else:
        with Fetcher() as fetcher:
            photos = read_sources(sources, fetcher)
        plan = put_there(folder, opened, search, priority, sources, photos)
    tell(f"Batch {name}: {plan.n_photos} photos, generation {plan.generation} of {index}")
    return _go_on(folder, index, broker, workers, wait)


def resume(
    name: Name,
    index: IndexFolder,
    batches: Batches = None,
    workers: Workers = None,
    broker: Broker = None,
    wait: Wait = False,
    failed: Annotated[
        bool, typer.Option("--failed", help="Ask again for photos that could not be had.")
    ] = False,
) -> int:
    """Go on with a batch: after a pause, a kill, a reboot, or when it was cancelled."""
    folder = batch_folder(name, index, batches)
    folder.read()
    if failed:
        from coordinator.batches.running import forget_failed

        tell(f"{forget_failed(folder)} photos are asked for again")
    return _go_on(folder, index, broker, workers, wait)


def pause(name: Name, index: IndexFolder, batches: Batches = None) -> None:
    """Send nothing more of a batch to the workers; what is begun is finished."""
    from index.control import write_wish

    folder = batch_folder(name, index, batches)
    folder.read()
    write_wish(folder.path, "pause")
    tell(f"Batch {name} is paused. Go on with: flaneur batch resume {_named(folder, index)}")


def cancel(name: Name, index: IndexFolder, batches: Batches = None) -> None:
    """End a batch; the answers that are there stay."""
    from index.control import write_wish

    folder = batch_folder(name, index, batches)
    folder.read()
    write_wish(folder.path, "cancel")
    tell(
        f"Batch {name} is cancelled; its answers stay. Go on after all with: "
        f"flaneur batch resume {_named(folder, index)}"
    )


def _go_on(
    folder: "BatchFolder", index: Place, broker: str | None, workers: int | None, wait: bool
) -> int:
    from coordinator.batches.following import follow_apart, follow_batch
    from coordinator.batches.states import state_of_batch
    from index.control import begin_again

    begin_again(folder.path)
    if folder.is_worked_on():
        tell(f"A process works on it: flaneur batch status {_named(folder, index)} --watch")
        return 0
    if wait:
        try:
            with bars() as progress:
                follow_batch(folder, from_anywhere(index), broker, workers, progress)
        except KeyboardInterrupt:
            tell(f"Its answers are kept. Go on with: flaneur batch resume {_named(folder, index)}")
            raise
        return _end(state_of_batch(folder), _named(folder, index))
    process = follow_apart(folder, from_anywhere(index), broker, workers)
    _until_begun(folder, process)
    tell(
        f"It goes on by itself: flaneur batch status {_named(folder, index)} --watch; "
        f"its log: {folder.log}"
    )
    return 0


def _named(folder: "BatchFolder", index: Place) -> str:
    """A batch as the arguments of a command that can be pasted."""
    from coordinator.batches.batch import BATCHES

    words = [folder.name, "--index", str(index)]
    if not isinstance(index, Path) or folder.place != index.absolute() / BATCHES:
        words += ["--batches", str(folder.place)]
    return shlex.join(words)


def _until_begun(folder: "BatchFolder", process: "subprocess.Popen[bytes]") -> None:
    """Wait until the process of a batch tells how it goes; complain where it ends at once.

    Raises
    ------
    TaskFailed : it ended without success; shows what it said.
    """
    begun = folder.path / "progress.json"
    before = begun.stat().st_mtime_ns if begun.exists() else None
    while process.poll() is None:
        if begun.exists() and begun.stat().st_mtime_ns != before:
            return
        time.sleep(0.1)
    if process.returncode not in (0, SOME_SKIPPED):
        said = folder.log.read_text("utf-8", "replace")[-2000:].strip()
        raise TaskFailed(f"The batch {folder.name} could not be begun: {said}")


def _end(state: "BatchState", named: str) -> int:
    tell(
        f"{state.done - state.failed} of {state.photos} photos located, {state.failed} could not "
        f"be. Write the answers with: flaneur batch results {named} "
        "--out FILE.geojson"
    )
    return SOME_SKIPPED if state.failed else 0


COMMANDS: dict[str, Callable[..., int | None]] = {
    "submit": submit,
    "status": status,
    "results": results,
    "pause": pause,
    "resume": resume,
    "cancel": cancel,
    "list": list_,
}
