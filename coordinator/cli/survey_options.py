"""How a survey is to be read: the options that `index`, `doctor` and `export` share."""

from pathlib import Path
from typing import Annotated

import typer

from contracts.config import North as NorthName

SurveyPath = Annotated[
    Path, typer.Argument(help="A folder, a pose table, or an MCAP file; see docs/surveys.md.")
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
