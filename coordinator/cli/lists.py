"""Options that take lists or alternatives, shared by the verbs."""

from pathlib import Path
from typing import Annotated

import typer

from contracts.config import SearchConfig
from contracts.errors import BadConfig

Broker = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="A Redis server, such as redis://host:6379/0, with workers started by "
        "`flaneur worker`. Without it (and FLANEUR_BROKER_URL) Flaneur brings its own.",
    ),
]
Workers = Annotated[
    int | None, typer.Option(min=1, help="Local worker processes; default: one a core.")
]
IndexFolder = Annotated[Path, typer.Option("--index", help="The index to search.")]
Pair = Annotated[
    str, typer.Option(help="auto, two detectors such as hesaff,star, or one.", show_default=True)
]
K = Annotated[str, typer.Option("--k", help="Words per keypoint: auto, or 1 to 10.")]
Vote = Annotated[str, typer.Option(help="union, intersection or pairwise.")]
Weights = Annotated[str, typer.Option(help="Any of idf,norm,burst; '' for none.")]
Descriptors = Annotated[
    str | None, typer.Option(help="Any of sift,surf,sc; default: all of the index.")
]


def names(text: str | None) -> tuple[str, ...]:
    """Split a comma-separated option."""
    return tuple(part.strip() for part in (text or "").split(",") if part.strip())


def search_config(
    pair: str, k: str, vote: str, weights: str, descriptors: str | None, top: int
) -> SearchConfig:
    """Build the search from what was typed.

    Raises
    ------
    BadConfig : an option does not hold; names it.
    """
    if k != "auto" and not k.isdigit():
        raise BadConfig(f"--k takes auto or a whole number from 1 to 10; got {k!r}")
    return SearchConfig.of(
        pair="auto" if pair == "auto" else names(pair),
        k="auto" if k == "auto" else int(k),
        vote=vote,
        weights=names(weights),
        descriptors=names(descriptors) or None,
        top=top,
    )
