"""`flaneur add`: a new survey, or new images of a known one, go into an index."""

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.cli.announcing import (
    HERE,
    MetricsAddress,
    MetricsPort,
    announced,
    tell_what_it_did,
)
from coordinator.cli.lists import (
    JOB_PRIORITY,
    SOME_SKIPPED,
    Broker,
    OwnIndex,
    Priority,
    Workers,
)
from coordinator.cli.outputs import utf_8
from coordinator.cli.show import complain, list_skipped, tell
from coordinator.cli.survey_options import ShardSize, SurveyPath, reads_a_survey, survey_name

if TYPE_CHECKING:  # geopandas and faiss are imported when the verb runs
    from coordinator.adding import NewImages
    from coordinator.indexing import IndexReport
    from index.opened import OpenedIndex
    from survey import ReadOptions

NAME = "add"


@reads_a_survey()
def command(
    survey: SurveyPath,
    index: OwnIndex,
    reading: "ReadOptions",
    name: Annotated[
        str,
        typer.Option(
            help="Name of the survey; its uris begin with NAME/. Default: the index's main survey."
        ),
    ] = "",
    shard_size: ShardSize = None,
    workers: Workers = None,
    broker: Broker = None,
    priority: Priority = JOB_PRIORITY,
    metrics_port: MetricsPort = None,
    metrics_address: MetricsAddress = HERE,
    as_json: Annotated[bool, typer.Option("--json", help="Report as JSON on stdout.")] = False,
) -> int:
    """Add the images of a survey that an index does not have. Run again, it goes on.

    They are described as the index's own images are, with its words, and get its coordinate
    system. An image is known by its uri, whatever is in its file: remove it first to have it read
    again.
    """
    from coordinator.adding import find_new, plan_addition, run_addition
    from coordinator.engine.running import JOB_QUEUES, running_engine
    from index.opened import OpenedIndex

    started = time.perf_counter()
    opened = OpenedIndex(index.absolute())
    named = survey_name(name, f"--name takes a name without /; got {name!r}")
    new = find_new(opened, named, survey.absolute(), reading)
    for note in new.intake.notes:
        tell(note)
    report = None
    if new.intake.images:
        job, plan = plan_addition(opened, new.intake, shard_size)
        new = replace(new, intake=new.intake.without_images())
        tell(f"{plan.n_images} new images in {plan.n_shards} shards; job {plan.job}")
        with announced(metrics_port, metrics_address) as watchers:
            engine = running_engine(
                broker, workers, JOB_QUEUES, priority=priority, listen=watchers.listen
            )
            report = run_addition(job, plan, new.intake, engine, watchers.progress)
        tell_what_it_did(job)
    skipped = new.intake.skipped if report is None else report.skipped
    for warning in () if report is None else report.warnings:
        complain(warning)
    list_skipped(skipped, "the report of --json")
    summary = _summary(opened, new, report, time.perf_counter() - started)
    if as_json:
        typer.echo(utf_8(json.dumps(summary, ensure_ascii=False)))
    else:
        tell(_sentence(summary, opened.root))
    return SOME_SKIPPED if skipped else 0


def _summary(
    opened: "OpenedIndex", new: "NewImages", report: "IndexReport | None", seconds: float
) -> dict[str, object]:
    generation = opened.generation if report is None else report.generation
    skipped = new.intake.skipped if report is None else report.skipped
    unreadable = len(skipped) - len(new.intake.skipped)
    return {
        "generation": generation.number,
        "images": generation.n_live,
        "added": len(new.intake.survey_names) - unreadable,
        "known": new.n_known,
        "extracted_now": 0 if report is None else report.images_extracted,
        "skipped": [{"uri": each.uri, "reason": each.reason} for each in skipped],
        "without_keypoints": 0 if report is None else report.without_frames,
        "postings": generation.n_postings,
        "warnings": [] if report is None else list(report.warnings),
        "seconds": round(seconds, 3),
    }


def _sentence(summary: dict[str, object], root: Path) -> str:
    done = f"{root}: {summary['added']} images added"
    if not summary["added"]:
        done = f"{root}: nothing new, and nothing was changed"
    return (
        f"{done}, {summary['known']} were there already; generation {summary['generation']}, "
        f"{summary['images']} images, {summary['postings']:,} postings; {summary['seconds']:.1f} s"
    )
