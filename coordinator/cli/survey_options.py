"""How a survey is to be read: the options that verbs share."""

import unicodedata
from collections.abc import Callable, Collection
from functools import wraps
from inspect import Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from contracts.config import North as NorthName
from contracts.errors import BadConfig
from contracts.places import Place, place_of
from coordinator.cli.lists import given_place

if TYPE_CHECKING:  # reading a survey imports much
    from survey import ReadOptions

Verb = Callable[..., int]

SurveyPath = Annotated[
    Place,
    typer.Argument(
        parser=given_place,
        metavar="SURVEY",
        help="A folder, a pose table, or an MCAP file, or its URL such as s3://bucket/folder; see "
        "docs/surveys.md.",
    ),
]
Include = Annotated[list[str] | None, typer.Option(metavar="GLOB", help="Only uris like this.")]
Exclude = Annotated[list[str] | None, typer.Option(metavar="GLOB", help="No uris like this.")]
Crs = Annotated[
    str | None,
    typer.Option(help="CRS of the poses where the survey does not say, such as EPSG:2154."),
]
North = Annotated[
    NorthName | None,
    typer.Option(help="What headings are measured from: grid, true or magnetic."),
]
NoPose = Annotated[bool, typer.Option("--no-pose", help="Index images without poses.")]
Format = Annotated[
    str | None, typer.Option("--format", help="The survey's format; default: by its content.")
]
Mapping = Annotated[
    Path | None, typer.Option(help="TOML file that says what the columns of a pose table are.")
]
MaxGap = Annotated[
    float,
    typer.Option(
        "--max-gap",
        min=0.0,
        metavar="SECONDS",
        help="Poses farther apart in time are not interpolated between.",
    ),
]
WholePanoramas = Annotated[
    bool,
    typer.Option("--whole-panoramas", help="Do not cut panoramas into perspective views."),
]
NoTrackHeadings = Annotated[
    bool,
    typer.Option(
        "--no-track-headings", help="Give images without headings no heading from their track."
    ),
]
AllowBallpark = Annotated[
    bool,
    typer.Option(
        "--allow-ballpark",
        help="Accept a conversion to WGS 84 of unknown accuracy, where there is no other.",
    ),
]


StoredRotation = Annotated[
    bool, typer.Option("--stored-rotation", help="Leave images as stored, not put upright.")
]
NoMasks = Annotated[bool, typer.Option("--no-masks", help="Ignore the survey's masks.")]
Also = Annotated[
    list[str] | None,
    typer.Option(metavar="NAME=SURVEY", help="Another survey; its uris begin with NAME/."),
]
ShardSize = Annotated[
    int | None,
    typer.Option(
        min=1, max=10_000, help="Images a task; default: 8 to 128, by how many there are."
    ),
]


def reading_options(
    include: Include = None,
    exclude: Exclude = None,
    crs: Crs = None,
    north: North = None,
    no_pose: NoPose = False,
    survey_format: Format = None,
    mapping: Mapping = None,
    max_gap: MaxGap = 1.0,
    whole_panoramas: WholePanoramas = False,
    no_track_headings: NoTrackHeadings = False,
    allow_ballpark: AllowBallpark = False,
    stored_rotation: StoredRotation = False,
    no_masks: NoMasks = False,
) -> "ReadOptions":
    """How a survey is read that is to be indexed."""
    from survey import ReadOptions

    return ReadOptions(
        crs=crs,
        north=north,
        no_pose=no_pose,
        include=tuple(include or ()),
        exclude=tuple(exclude or ()),
        format=survey_format,
        make_upright=not stored_rotation,
        use_masks=not no_masks,
        mapping=mapping,
        max_gap_s=max_gap,
        cut_panoramas=not whole_panoramas,
        derive_headings=not no_track_headings,
        allow_ballpark=allow_ballpark,
    )


def reads_a_survey(without: Collection[str] = ()) -> Callable[[Verb], Verb]:
    """Give a verb the options of `reading_options` in the place of its parameter `reading`.

    typer knows a verb's options by the signature of its function, and has no groups of them.
    without : parameters of `reading_options` that are none of this verb's business.
    """
    shared = [
        option
        for name, option in signature(reading_options).parameters.items()
        if name not in without
    ]

    def with_options(command: Verb) -> Verb:
        parameters = [
            option
            for name, own in signature(command).parameters.items()
            for option in (shared if name == "reading" else [own])
        ]

        @wraps(command)
        def run(**given: object) -> int:
            asked: dict[str, Any] = {each.name: given.pop(each.name) for each in shared}
            return command(**given, reading=reading_options(**asked))

        run.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {each.name: each.annotation for each in parameters}
        return run

    return with_options


def named_survey(text: str) -> tuple[str, Place]:
    """Read `NAME=SURVEY` of --also.

    Raises
    ------
    BadConfig : it is something else.
    """
    name, separator, path = text.partition("=")
    refused = f"--also takes NAME=SURVEY, with no / in NAME; got {text!r}"
    if not (separator and name and path):
        raise BadConfig(refused)
    return survey_name(name, refused), place_of(path).absolute()


def survey_name(name: str, refused: str) -> str:
    """The name of a survey, as its uris begin with it; '': of the main one.

    Raises
    ------
    BadConfig : `refused`, as no folder is called so; or it means the survey without a name.
    """
    if "/" in name or name in {".", ".."}:
        raise BadConfig(refused)
    if name == "main":
        raise BadConfig(
            "A survey cannot be named main: so the survey without a name is called. Choose "
            "another name; to add images to the main survey, leave --name away."
        )
    return unicodedata.normalize("NFC", name)
