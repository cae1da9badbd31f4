"""`flaneur index`: a survey becomes an index."""

import json
import time
import unicodedata
from pathlib import Path
from typing import Annotated

import typer

from contracts.config import (
    DESCRIPTORS,
    DETECTORS,
    CodebookConfig,
    FeatureConfig,
    IndexConfig,
)
from contracts.errors import BadConfig
from coordinator.cli.lists import (
    SOME_SKIPPED,
    Broker,
    MaxFrames,
    Workers,
    frame_limits,
    names_among,
)
from coordinator.cli.show import bars, complain, list_skipped, tell
from coordinator.cli.survey_options import (
    AllowBallpark,
    Crs,
    Exclude,
    Format,
    Include,
    Mapping,
    MaxGap,
    NoPose,
    North,
    NoTrackHeadings,
    SurveyPath,
    WholePanoramas,
)

NAME = "index"


def command(
    survey: SurveyPath,
    index: Annotated[Path, typer.Argument(help="Where the index goes.")],
    also: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=SURVEY", help="Another survey; its uris begin with NAME/."),
    ] = None,
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
    detectors: Annotated[str, typer.Option(help="Which to run.")] = ",".join(DETECTORS),
    descriptors: Annotated[str, typer.Option(help="Which to run.")] = ",".join(DESCRIPTORS),
    max_frames: MaxFrames = None,
    max_words: Annotated[int, typer.Option(help="Largest codebook.")] = 20_000,
    seed: Annotated[int, typer.Option(help="Seed of the codebooks.")] = 0,
    stored_rotation: Annotated[
        bool,
        typer.Option("--stored-rotation", help="Leave images as stored, not put upright."),
    ] = False,
    no_masks: Annotated[
        bool, typer.Option("--no-masks", help="Ignore the survey's masks.")
    ] = False,
    shard_size: Annotated[
        int | None, typer.Option(min=1, max=10_000, help="Images a task.")
    ] = None,
    workers: Workers = None,
    broker: Broker = None,
    as_json: Annotated[bool, typer.Option("--json", help="Report as JSON on stdout.")] = False,
) -> int:
    """Index a survey. Run again, it does only what is missing."""
    from coordinator.engine import running_engine
    from coordinator.indexing import run_job
    from coordinator.plan import DEFAULT_SHARD_SIZE, make_plan, read_surveys
    from survey import ReadOptions

    config = IndexConfig(
        features=FeatureConfig.of(
            detectors=names_among(detectors, DETECTORS, "--detectors"),
            descriptors=names_among(descriptors, DESCRIPTORS, "--descriptors"),
            **frame_limits(max_frames or ""),
        ),
        codebooks=CodebookConfig.of(max_words=max_words, seed=seed),
    )
    options = ReadOptions(
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
    started = time.perf_counter()
    root = index.absolute()
    intake = read_surveys([("", survey.absolute()), *map(_named, also or ())], options)
    job, plan = make_plan(root, intake, config, shard_size or DEFAULT_SHARD_SIZE)
    for note in intake.notes:
        tell(note)
    tell(f"{len(intake.images)} images in {plan.n_shards} shards; job {plan.job}")
    with bars() as progress:
        report = run_job(job, plan, intake, running_engine(broker, workers), progress)
    for warning in report.warnings:
        complain(warning)
    list_skipped(report.skipped, str(job.path / "skipped.json"))
    generation = report.generation
    seconds = time.perf_counter() - started
    summary = {
        "generation": generation.number,
        "images": generation.n_images,
        "extracted_now": report.images_extracted,
        "skipped": [{"uri": each.uri, "reason": each.reason} for each in report.skipped],
        "without_keypoints": report.without_frames,
        "postings": generation.n_postings,
        "bytes": report.bytes_on_disk,
        "seconds": round(seconds, 3),
        "images_per_second": round(report.images_extracted / seconds, 3),
    }
    if as_json:
        typer.echo(json.dumps(summary, ensure_ascii=False).encode())  # UTF-8 in every locale
    else:
        tell(_sentence(summary, root))
    return SOME_SKIPPED if report.skipped else 0


def _named(text: str) -> tuple[str, Path]:
    name, separator, path = text.partition("=")
    if not (separator and name and path) or "/" in name or name in {".", ".."}:
        raise BadConfig(f"--also takes NAME=SURVEY, with no / in NAME; got {text!r}")
    return unicodedata.normalize("NFC", name), Path(path).absolute()


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
