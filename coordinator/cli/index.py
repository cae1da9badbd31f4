"""`flaneur index`: a survey becomes an index."""

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from contracts.config import (
    DESCRIPTORS,
    DETECTORS,
    CodebookConfig,
    FeatureConfig,
    IndexConfig,
)
from contracts.errors import BadConfig
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
    MaxFrames,
    OwnIndex,
    Priority,
    Workers,
    frame_limits,
    names_among,
)
from coordinator.cli.show import complain, list_skipped, tell
from coordinator.cli.survey_options import Also, ShardSize, SurveyPath, named_survey, reads_a_survey

if TYPE_CHECKING:  # reading a survey imports much
    from coordinator.indexing import IndexReport
    from survey import ReadOptions

NAME = "index"

Detectors = Annotated[
    str | None,
    typer.Option(help=f"Which to run; default: {','.join(DETECTORS)}, or those of --codebooks."),
]
Descriptors = Annotated[
    str | None,
    typer.Option(help=f"Which to run; default: {','.join(DESCRIPTORS)}, or those of --codebooks."),
]
MaxWords = Annotated[
    int | None,
    typer.Option(help=f"Largest codebook; default: {CodebookConfig().max_words}."),
]


@reads_a_survey()
def command(
    survey: SurveyPath,
    index: OwnIndex,
    reading: "ReadOptions",
    also: Also = None,
    detectors: Detectors = None,
    descriptors: Descriptors = None,
    max_frames: MaxFrames = None,
    max_words: MaxWords = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the codebooks; default: 0.")] = None,
    codebooks: Annotated[
        Path | None,
        typer.Option(
            metavar="SOURCE",
            help="Use the words of another index, or of a folder that `flaneur codebook import` "
            "wrote, instead of training some.",
        ),
    ] = None,
    shard_size: ShardSize = None,
    workers: Workers = None,
    broker: Broker = None,
    priority: Priority = JOB_PRIORITY,
    metrics_port: MetricsPort = None,
    metrics_address: MetricsAddress = HERE,
    as_json: Annotated[bool, typer.Option("--json", help="Report as JSON on stdout.")] = False,
) -> int:
    """Index a survey. Run again, it does only what is missing."""
    from coordinator.adding import before_replacing
    from coordinator.engine.running import JOB_QUEUES, running_engine
    from coordinator.indexing import run_job
    from coordinator.intake import read_surveys
    from coordinator.plan import make_plan
    from coordinator.reusing import config_of_words, misfit, take_over
    from index.importing import words_to_import
    from index.word_sets import open_words

    root = index.absolute()
    if codebooks is None:
        source = words = None
        config = training_config(detectors, descriptors, max_frames, max_words, seed)
    else:
        _refuse_training(max_words, seed)
        source = open_words(codebooks.absolute())
        config = config_of_words(
            source.words,
            names_among(detectors, DETECTORS, "--detectors"),
            names_among(descriptors, DESCRIPTORS, "--descriptors"),
            frame_limits(max_frames) if max_frames else {},
        )
        words = words_to_import(root, source, config.features.channels())
    started = time.perf_counter()
    intake = read_surveys([("", survey.absolute()), *map(named_survey, also or ())], reading)
    job, plan = make_plan(root, intake, config, shard_size, words)
    if source is not None and words is not None:
        take_over(job, source, words)
    for note in intake.notes:
        tell(note)
    if warning := before_replacing(job, plan, intake):
        complain(warning)
    intake = intake.without_images()
    tell(f"{plan.n_images} images in {plan.n_shards} shards; job {plan.job}")
    with announced(metrics_port, metrics_address) as watchers:
        engine = running_engine(
            broker, workers, JOB_QUEUES, priority=priority, listen=watchers.listen
        )
        report = run_job(job, plan, intake, engine, watchers.progress)
    for warning in report.warnings:
        complain(warning)
    if source is not None:
        here = report.generation.segments[0].quantisation
        warning = misfit(source.words.quantisation, here, "without --codebooks words are trained")
        if warning:
            complain(warning)
    list_skipped(report.skipped, str(job.path / "skipped.json"))
    if report.images_extracted:
        tell_what_it_did(job)
    summary = _summary(report, time.perf_counter() - started)
    if as_json:
        typer.echo(json.dumps(summary, ensure_ascii=False).encode())  # UTF-8 in every locale
    else:
        tell(_sentence(summary, root))
    return SOME_SKIPPED if report.skipped else 0


def training_config(
    detectors: str | None = None,
    descriptors: str | None = None,
    max_frames: str | None = None,
    max_words: int | None = None,
    seed: int | None = None,
) -> IndexConfig:
    """What an index with words of its own is made by; None: its default.

    Raises
    ------
    BadConfig : an option does not hold; names it.
    """
    limits = {"max_words": max_words, "seed": seed}
    return IndexConfig(
        features=FeatureConfig.of(
            detectors=names_among(_or_all(detectors, DETECTORS), DETECTORS, "--detectors"),
            descriptors=names_among(
                _or_all(descriptors, DESCRIPTORS), DESCRIPTORS, "--descriptors"
            ),
            **frame_limits(max_frames or ""),
        ),
        codebooks=CodebookConfig.of(
            **{name: value for name, value in limits.items() if value is not None}
        ),
    )


def _refuse_training(max_words: int | None, seed: int | None) -> None:
    if max_words is not None or seed is not None:
        raise BadConfig(
            "--max-words and --seed are for training words, and with --codebooks none are "
            "trained. Leave these away, or --codebooks."
        )


def _or_all(text: str | None, known: Sequence[str]) -> str:
    return ",".join(known) if text is None else text


def _summary(report: "IndexReport", seconds: float) -> dict[str, object]:
    generation = report.generation
    return {
        "generation": generation.number,
        "images": generation.n_live,
        "extracted_now": report.images_extracted,
        "skipped": [{"uri": each.uri, "reason": each.reason} for each in report.skipped],
        "without_keypoints": report.without_frames,
        "postings": generation.n_postings,
        "bytes": report.bytes_on_disk,
        "seconds": round(seconds, 3),
        "images_per_second": round(report.images_extracted / seconds, 3),
    }


def _sentence(summary: dict[str, object], root: Path) -> str:
    if not summary["extracted_now"]:
        done = "nothing was missing"
    else:
        done = (
            f"{summary['extracted_now']} extracted in {summary['seconds']:.1f} s, "
            f"{summary['images_per_second']:.2f} images/s"
        )
    return (
        f"{root}: generation {summary['generation']}, {summary['images']} images "
        f"({summary['without_keypoints']} without keypoints), {summary['postings']:,} postings, "
        f"{summary['bytes']:,} bytes; {done}"
    )
