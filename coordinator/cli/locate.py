"""`flaneur locate`: photos become GeoJSON."""

from pathlib import Path
from typing import Annotated

import typer

from coordinator.cli.lists import (
    SOME_SKIPPED,
    Broker,
    Descriptors,
    IndexFolder,
    K,
    Pair,
    Vote,
    Weights,
    Workers,
    fitted_search,
    search_config,
)
from coordinator.cli.outputs import result_file
from coordinator.cli.show import bars, complain, tell

NAME = "locate"


def command(
    photos: Annotated[list[str], typer.Argument(metavar="PHOTO...", help="Photos to locate.")],
    index: IndexFolder,
    out: Annotated[Path | None, typer.Option(help="GeoJSON file; default: stdout.")] = None,
    top: Annotated[int, typer.Option(help="Matches a photo.")] = 10,
    pair: Pair = "auto",
    k: K = "auto",
    vote: Vote = "auto",
    weights: Weights = "idf,norm",
    descriptors: Descriptors = None,
    workers: Workers = None,
    broker: Broker = None,
) -> int:
    """Find where photos were taken."""
    from coordinator.engine import running_engine
    from coordinator.export.files import write_geojson
    from coordinator.querying import locate_photos
    from geo.geojson import dumps, feature_collection
    from index.opened import OpenedIndex

    search = search_config(pair, k, vote, weights, descriptors, top)
    opened = OpenedIndex(index.absolute())
    search = fitted_search(search, vote, opened.config.features)
    photos = list(dict.fromkeys(photos))  # globs overlap; a feature's id is of its photo's name
    out = None if out is None else result_file(out, map(Path, photos))
    count = min(workers or len(photos), len(photos)) if broker is None else None
    with running_engine(broker, _at_most_cores(count), ("locate",)) as engine, bars() as progress:
        progress.begin("locate", len(photos), 0)
        located = locate_photos(
            opened, photos, search, engine.follower, lambda: progress.advance("locate")
        )
    features = [feature for answer in located for feature in answer.features]
    collection = feature_collection(features)
    if out is None:
        typer.echo(dumps(collection).encode())  # UTF-8 in every locale
    else:
        write_geojson(out, collection)
    failed = [answer for answer in located if answer.error is not None]
    for answer in failed:
        complain(f"{answer.query}: {answer.error}")
    for choice in sorted({each for answer in located for each in answer.not_chosen}):
        tell(f"Detectors and k by {choice}")
    if out is not None:
        tell(f"{len(located) - len(failed)} of {len(located)} photos located: {out}")
    return SOME_SKIPPED if failed else 0


def _at_most_cores(count: int | None) -> int | None:
    from coordinator.engine import available_cores

    return None if count is None else min(count, available_cores())
