"""`flaneur remove`: images of an index are no longer found."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.cli.lists import OwnIndex
from coordinator.cli.outputs import utf_8
from coordinator.cli.show import MAX_LISTED, bars, tell
from coordinator.cli.where_options import (
    Bbox,
    Heading,
    InSurvey,
    Since,
    Until,
    Within,
    where_of,
)

if TYPE_CHECKING:  # numba and pyproj are imported when the verb runs
    from coordinator.removing import Removal

NAME = "remove"


def command(
    index: OwnIndex,
    uris: Annotated[
        list[str] | None, typer.Argument(metavar="URI", help="Images, as results name them.")
    ] = None,
    image_ids: Annotated[
        list[int] | None, typer.Option("--id", help="An image, by its image_id in results.")
    ] = None,
    glob: Annotated[
        list[str] | None, typer.Option("--glob", metavar="GLOB", help="Images of uris like this.")
    ] = None,
    survey: InSurvey = None,
    since: Since = None,
    until: Until = None,
    bbox: Bbox = None,
    within: Within = None,
    heading: Heading = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only say which images these are.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Report as JSON on stdout.")] = False,
) -> None:
    """Remove the images for which all that is given holds.

    They are not found any more, and scores are as if they had never been there. Their bytes stay
    until `flaneur compact --prune`; until then `flaneur rollback` brings them back. The last image
    is not removed.
    """
    from coordinator.removing import foresee_removal, remove_images
    from index.manifest import read_generation

    root = index.absolute()
    where = where_of(read_generation(root), bbox, within, since, until, heading, survey, glob)
    if dry_run:
        removal = foresee_removal(root, where, uris or (), image_ids or ())
    else:
        with bars() as progress:
            removal = remove_images(root, where, uris or (), image_ids or (), progress)
    if as_json:
        summary = {
            "generation": None if removal.generation is None else removal.generation.number,
            "removed": list(removal.uris),
            "images": removal.n_live,
        }
        typer.echo(utf_8(json.dumps(summary, ensure_ascii=False)))
    else:
        _tell(removal, root)


def _tell(removal: "Removal", root: Path) -> None:
    if not removal.uris:
        tell(f"{root}: no image is like that; nothing was changed")
        return
    for uri in removal.uris[:MAX_LISTED]:
        tell(f"  {uri}")
    if len(removal.uris) > MAX_LISTED:
        tell(f"  … and {len(removal.uris) - MAX_LISTED} more")
    if removal.generation is None:
        tell(f"{root}: these {len(removal.uris)} would be removed, {removal.n_live} would be left")
    else:
        tell(
            f"{root}: {len(removal.uris)} images removed, {removal.n_live} are left; generation "
            f"{removal.generation.number}"
        )
