"""`flaneur doctor`: what is wrong with a survey, before any work."""

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from contracts.errors import BadConfig
from coordinator.cli.lists import SOME_SKIPPED
from coordinator.cli.outputs import refuse_inside, result_file, result_folder, utf_8
from coordinator.cli.show import stdout, tell
from coordinator.cli.survey_options import SurveyPath, reads_a_survey

if TYPE_CHECKING:  # survey is imported when the verb runs
    from survey import ReadOptions
    from survey.doctor import Examination

NAME = "doctor"
ERRORS = 2
"""Exit code: `flaneur index` would refuse the survey or place photos wrongly."""


@reads_a_survey(without=("whole_panoramas", "no_track_headings", "stored_rotation"))
def command(
    survey: SurveyPath,
    reading: "ReadOptions",
    out: Annotated[
        Path | None, typer.Option(help="A folder for report.json, report.txt and track.png.")
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(help="A map of the track alone: a .png file.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Report as JSON on stdout.")] = False,
) -> int:
    """Look for what is wrong with a survey, and say what mends it. Nothing is indexed.

    Exit code 0: nothing worse than a note; 3: warnings; 2: errors.
    """
    from coordinator.export.examination import as_dict, as_text, write_picture, write_report
    from survey.doctor import examine

    folder = None if out is None else result_folder(out)
    drawing = None if picture is None else _png(picture)
    for option, place in (("--out", out), ("--picture", picture)):
        if place is not None:
            refuse_inside(survey, place, option)
    examination = examine(survey.absolute(), reading, datetime.now(UTC))
    if folder is not None:
        write_report(folder, examination)
        tell(f"Report: {out}")
    if drawing is not None:
        drawn = write_picture(drawing, examination)
        tell(f"Drawn: {picture}" if drawn else "Nothing drawn: no position can be used")
    if as_json:
        typer.echo(utf_8(json.dumps(as_dict(examination), ensure_ascii=False, allow_nan=False)))
    else:
        stdout.print(as_text(examination), markup=False, soft_wrap=not stdout.is_terminal)
    return _exit_code(examination)


def _png(picture: Path) -> Path:
    if picture.suffix.lower() != ".png":
        raise BadConfig(f"--picture takes a name that ends in .png; got {str(picture)!r}")
    return result_file(picture)


def _exit_code(examination: "Examination") -> int:
    severities = {finding.severity for finding in examination.findings}
    if "error" in severities:
        return ERRORS
    return SOME_SKIPPED if "warning" in severities else 0
