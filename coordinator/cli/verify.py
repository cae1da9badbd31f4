"""`flaneur verify`: whether an index is still what was written, byte for byte, and makes sense."""

import json
from typing import TYPE_CHECKING, Annotated

import typer

from contracts.places import Place
from coordinator.cli.lists import SeenIndex
from coordinator.cli.opening import folder_of
from coordinator.cli.outputs import utf_8
from coordinator.cli.show import bars, complain, tell

if TYPE_CHECKING:  # faiss is imported when the verb runs
    from index.verifying import Verdict

NAME = "verify"
DAMAGED = 2
"""Exit code: something is wrong."""


def command(
    index: SeenIndex,
    every: Annotated[
        bool, typer.Option("--all", help="All generations; default: the live one.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="As JSON on stdout.")] = False,
) -> int:
    """Read every file of an index: its digest, and whether what is in it makes sense.

    Changes nothing. Exit code 2: something is wrong; each fault is named with what mends it.
    """
    from index.verifying import verify

    held = folder_of(index)
    with bars() as progress:
        verdict = verify(held.root, every, progress)
    if as_json:
        typer.echo(utf_8(json.dumps(_report(index, verdict), ensure_ascii=False)))
    for told in verdict.faults:
        complain(told)
    tell(_sentence(index, every, verdict))
    return DAMAGED if verdict.faults else 0


def _report(index: Place, verdict: "Verdict") -> dict[str, object]:
    return {
        "index": str(index.absolute()),
        "generations": verdict.generations,
        "sound": verdict.sound,
        "files": verdict.files,
        "bytes": verdict.bytes,
        "faults": [
            {"told": told, "generations": numbers} for told, numbers in verdict.faults.items()
        ],
    }


def _sentence(index: Place, every: bool, verdict: "Verdict") -> str:
    if not verdict.faults:
        of_what = f"generation {verdict.generations[0]}" if not every else "all generations"
        return f"{index}: {of_what} sound, {verdict.files:,} files, {verdict.bytes:,} bytes"
    if verdict.sound:
        return f"Sound: `flaneur rollback {index} --to {verdict.sound[-1]}` goes back to it"
    if every or len(verdict.generations) > 1:
        return "No generation is sound: restore the files, or index again"
    return f"`flaneur verify {index} --all` tells whether there is a sound one to go back to"
