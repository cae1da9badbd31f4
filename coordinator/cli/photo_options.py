"""Which photos are meant, and which batch: options that verbs share."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from contracts.places import Place

if TYPE_CHECKING:
    from coordinator.batches.batch import BatchFolder

Sources = Annotated[
    list[str],
    typer.Argument(
        metavar="SOURCE...",
        help="Photos, folders, lists (.csv, .tsv, .txt; - for stdin), manifests or collections of "
        "IIIF (.json or a URL).",
    ),
]
Name = Annotated[str, typer.Argument(metavar="NAME", help="What the batch is called.")]
Batches = Annotated[
    Path | None,
    typer.Option(metavar="FOLDER", help="The folder of the batches; default: INDEX/batches."),
]
AsJson = Annotated[bool, typer.Option("--json", help="As JSON on stdout.")]


def batch_folder(name: str, index: Place, batches: Path | None) -> "BatchFolder":
    """The folder of a batch, there or to be.

    Raises
    ------
    BadConfig : it is no name, or there is no place for batches.
    """
    from coordinator.batches.batch import BatchFolder
    from coordinator.batches.submitting import place_of_batches

    return BatchFolder(place_of_batches(index, batches), name)


def from_anywhere(index: Place) -> Place:
    """The index as it is found from any folder."""
    return index.absolute() if isinstance(index, Path) else index
