"""`flaneur rollback`: a former generation becomes the live one again."""

import json
from typing import Annotated

import typer

from coordinator.cli.lists import OwnIndex
from coordinator.cli.outputs import utf_8
from coordinator.cli.show import tell

NAME = "rollback"


def command(
    index: OwnIndex,
    to: Annotated[
        int | None, typer.Option(min=1, help="Its number; default: the one before the live one.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Report as JSON on stdout.")] = False,
) -> None:
    """Go back to a former generation, or with --to to any that is there.

    Nothing is deleted: the generation that was live can be gone to in the same way. Generations
    that `flaneur compact --prune` deleted are gone; `flaneur status` lists those that are there.
    """
    from index.commits import roll_back

    root = index.absolute()
    generation = roll_back(root, to)
    summary = {
        "generation": generation.number,
        "made_by": generation.made_by,
        "created_at": generation.created_at,
        "images": generation.n_live,
        "segments": len(generation.segments),
        "surveys": sorted({survey.name or survey.path for survey in generation.surveys}),
    }
    if as_json:
        typer.echo(utf_8(json.dumps(summary, ensure_ascii=False)))
    else:
        tell(
            f"{root}: generation {generation.number} is live, made by `{generation.made_by}` on "
            f"{generation.created_at}; {generation.n_live} images in {len(generation.segments)} "
            f"segments"
        )
