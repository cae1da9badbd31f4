"""Which images of an index are meant: the options that `locate` and `remove` share."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from contracts.config import Where
from contracts.errors import BadConfig

if TYPE_CHECKING:  # pydantic models are made when a verb runs
    from index.manifest import Generation

Bbox = Annotated[
    str | None,
    typer.Option(
        metavar="W,S,E,N",
        help="Only images in this box of WGS 84 degrees; west may lie east of east, across 180.",
    ),
]
Within = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Only images within these polygons: GeoJSON, .gpkg, .shp …"),
]
Since = Annotated[
    str | None,
    typer.Option(metavar="DATE", help="Only images taken then or later, such as 2024-06-16."),
]
Until = Annotated[
    str | None,
    typer.Option(metavar="DATE", help="Only images taken until the end of then, such as 2024."),
]
Heading = Annotated[
    str | None,
    typer.Option(
        metavar="DEG±DEG", help="Only images that look there from true north, such as 180±45."
    ),
]
InSurvey = Annotated[
    list[str] | None,
    typer.Option("--survey", metavar="NAME", help="Only this survey's; main: the main one's."),
]
Uri = Annotated[
    list[str] | None,
    typer.Option("--uri", metavar="GLOB", help="Only images of this uri, or of one like it."),
]


def where_of(
    generation: "Generation",
    bbox: str | None = None,
    within: Path | None = None,
    since: str | None = None,
    until: str | None = None,
    heading: str | None = None,
    surveys: Sequence[str] | None = None,
    uris: Sequence[str] | None = None,
) -> Where:
    """Put what was typed together.

    Raises
    ------
    BadConfig : an option does not hold; names it.
    """
    return Where.of(
        bbox=None if bbox is None else _numbers(bbox, 4, "--bbox", "2.33,48.85,2.35,48.86"),
        polygon=None if within is None else _outline(within),
        since=since,
        until=until,
        heading=None if heading is None else _heading(heading),
        surveys=_surveys(generation, surveys or ()),
        uris=tuple(uris or ()),
    )


def _outline(path: Path) -> str:
    from coordinator.outlines import read_outline

    return read_outline(path)


def _numbers(text: str, count: int, option: str, example: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count:
        raise BadConfig(f"{option} takes {count} numbers such as {example}; got {text!r}")
    return numbers


def _heading(text: str) -> tuple[float, float]:
    """`180±45`, `180+-45` or `180,45`."""
    plain = re.sub(r"\s*(±|\+-|\+/-)\s*", ",", text, count=1)
    middle, reach = _numbers(plain, 2, "--heading", "180±45 or 180,45")
    return middle, reach


def _surveys(generation: "Generation", asked: Sequence[str]) -> tuple[str, ...]:
    """The names as the catalogue has them; `main` is the one without, unless one is called so."""
    from index.selecting import MAIN

    known = [survey.name for survey in generation.surveys]
    named = ["" if name == MAIN and MAIN not in known else name for name in asked]
    for name in named:
        if name not in known:
            there = ", ".join(dict.fromkeys(each or MAIN for each in known)) or "none"
            raise BadConfig(f"--survey {name}: the index has no such survey; it has {there}")
    return tuple(named)
