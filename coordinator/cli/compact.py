"""`flaneur compact`: one segment of all images that are left."""

import json
from typing import Annotated

import typer

from coordinator.cli.announcing import (
    HERE,
    MetricsAddress,
    MetricsPort,
    announced,
    tell_what_it_did,
)
from coordinator.cli.lists import JOB_PRIORITY, Broker, OwnIndex, Priority, Workers
from coordinator.cli.outputs import utf_8
from coordinator.cli.show import tell

NAME = "compact"


def command(
    index: OwnIndex,
    prune: Annotated[
        bool,
        typer.Option(
            "--prune",
            help="Then delete the generations before the live one, and every file that only they "
            "or unfinished jobs need. Searches that began before may fail then, with a clear "
            "message, and `flaneur rollback` has nothing to go back to.",
        ),
    ] = False,
    workers: Workers = None,
    broker: Broker = None,
    priority: Priority = JOB_PRIORITY,
    metrics_port: MetricsPort = None,
    metrics_address: MetricsAddress = HERE,
    as_json: Annotated[bool, typer.Option("--json", help="Report as JSON on stdout.")] = False,
) -> None:
    """Make one segment of all images that were not removed. Run again, it goes on.

    The files are the same as if these images had been indexed in one go with the same words. Ids
    of images change; results do not. Without --prune nothing is deleted: searches under way keep
    the generation that they opened, and `flaneur rollback` goes back.
    """
    from coordinator import pruning
    from coordinator.compacting import compact
    from coordinator.engine.running import running_engine

    root = index.absolute()
    with announced(metrics_port, metrics_address) as watchers:
        engine = running_engine(
            broker, workers, ("merge",), priority=priority, listen=watchers.listen
        )
        report = compact(root, engine, watchers.progress)
    if report.job is not None:
        tell_what_it_did(report.job)
    pruned = pruning.prune(root) if prune else None
    before, after = report.before, report.generation
    summary = {
        "generation": after.number,
        "images": after.n_live,
        "dropped": before.n_images - after.n_images,
        "segments_before": len(before.segments),
        "bytes_before": before.n_bytes,
        "bytes": after.n_bytes,
        "seconds": round(report.seconds, 3),
        "pruned_generations": [] if pruned is None else list(pruned.generations),
        "pruned_bytes": 0 if pruned is None else pruned.n_bytes,
    }
    if as_json:
        typer.echo(utf_8(json.dumps(summary, ensure_ascii=False)))
        return
    if after == before:
        tell(f"{root}: generation {after.number} is one segment with nothing removed already")
    else:
        tell(
            f"{root}: generation {after.number}, {after.n_live} images in one segment instead of "
            f"{len(before.segments)}, {summary['dropped']} removed ones dropped; "
            f"{after.n_bytes:,} bytes instead of {before.n_bytes:,}, {report.seconds:.1f} s"
        )
    if pruned is not None:
        tell(
            f"{len(pruned.generations)} generations and {pruned.n_files} files deleted: "
            f"{pruned.n_bytes:,} bytes"
        )
