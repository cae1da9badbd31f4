"""`flaneur plan`: what indexing a survey will take, before any work."""

import json
import os
from typing import TYPE_CHECKING, Annotated

import typer

from contracts.config import DESCRIPTORS, DETECTORS
from contracts.places import Place
from coordinator.cli.index import MaxWords, training_config
from coordinator.cli.lists import SOME_SKIPPED, MaxFrames
from coordinator.cli.outputs import utf_8
from coordinator.cli.show import bars, list_skipped, tell
from coordinator.cli.survey_options import Also, ShardSize, SurveyPath, named_survey, reads_a_survey
from coordinator.cli.tables import print_line, print_table

if TYPE_CHECKING:  # reading a survey imports much
    from survey import ReadOptions

NAME = "plan"
WORKERS = (1, 2, 8, 40)


@reads_a_survey()
def command(
    survey: SurveyPath,
    reading: "ReadOptions",
    also: Also = None,
    detectors: Annotated[str, typer.Option(help="Which to run.")] = ",".join(DETECTORS),
    descriptors: Annotated[str, typer.Option(help="Which to run.")] = ",".join(DESCRIPTORS),
    max_frames: MaxFrames = None,
    max_words: MaxWords = None,
    shard_size: ShardSize = None,
    sample: Annotated[int, typer.Option(min=1, max=10_000, help="Images to extract for it.")] = 20,
    workers: Annotated[
        list[int] | None,
        typer.Option(
            min=1, max=100_000, metavar="N", help="How many worker processes; may be repeated."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Report as JSON on stdout.")] = False,
) -> int:
    """Predict hours, memory and bytes of `flaneur index` from a sample. Nothing is indexed."""
    from workers.run import worker_environment

    os.environ.update(worker_environment())  # before numba is imported: the workers' kernels
    from coordinator.forecast import telling
    from coordinator.forecast.foreseeing import Machine, foresee
    from coordinator.forecast.sample import draw, extract_sample
    from coordinator.forecast.yardstick import idle_as_a_worker, slowness
    from coordinator.intake import read_surveys
    from coordinator.plan import shard_size_for

    config = training_config(detectors, descriptors, max_frames, max_words)
    sources: list[tuple[str, Place]] = [("", survey.absolute()), *map(named_survey, also or ())]
    machine = Machine(idle=idle_as_a_worker(), slowness=slowness())
    intake = read_surveys(sources, reading)
    for note in intake.notes:
        tell(note)
    groups = draw(intake.images, sample)
    with bars() as progress:
        progress.begin("sample", sum(map(len, groups)), 0)
        found = extract_sample(groups, config.features, lambda: progress.advance("sample"))
    forecast = foresee(
        found,
        config,
        len(intake.images),
        shard_size or shard_size_for(len(intake.images)),
        sorted(set(workers or WORKERS)),
        machine,
    )
    skipped = (*intake.skipped, *forecast.skipped)
    if as_json:
        report = telling.as_dict(forecast) | {"not_read": len(intake.skipped)}
        typer.echo(utf_8(json.dumps(report, ensure_ascii=False, allow_nan=False)))
        list_skipped(skipped, "what `flaneur doctor` says")
    else:
        list_skipped(skipped, "what `flaneur doctor` says")
        for line in telling.opening(forecast):
            print_line(line)
        for headings, rows in (
            telling.time_table(forecast),
            telling.memory_table(forecast),
            telling.disk_table(forecast),
        ):
            print_line("")
            print_table(headings, rows)
        print_line("")
        print_line(telling.closing())
    return SOME_SKIPPED if skipped else 0
