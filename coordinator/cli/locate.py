"""`flaneur locate`: photos become places, as GeoJSON and in other formats."""

from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
from coordinator.cli.opening import opened_index
from coordinator.cli.outputs import result_file
from coordinator.cli.photo_options import Sources
from coordinator.cli.show import bars, complain, tell
from coordinator.cli.where_options import (
    Bbox,
    Heading,
    InSurvey,
    Since,
    Until,
    Uri,
    Within,
    where_of,
)

if TYPE_CHECKING:
    from coordinator.querying import Located

NAME = "locate"


def command(
    sources: Sources,
    index: IndexFolder,
    out: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="Results, in the format that the name ends in: .geojson, .geojsons (a text "
            "sequence, RFC 8142), .gpkg, .fgb, .parquet or .kml; may be given several times. "
            "Default: GeoJSON on stdout.",
        ),
    ] = None,
    top: Annotated[int, typer.Option(help="Matches a photo.")] = 10,
    pair: Pair = "auto",
    k: K = "auto",
    vote: Vote = "auto",
    weights: Weights = "idf,norm",
    descriptors: Descriptors = None,
    bbox: Bbox = None,
    within: Within = None,
    since: Since = None,
    until: Until = None,
    heading: Heading = None,
    survey: InSurvey = None,
    uri: Uri = None,
    workers: Workers = None,
    broker: Broker = None,
) -> int:
    """Find where photos were taken."""
    from coordinator.batches.at_once import photos_at_hand, seen_by_workers
    from coordinator.engine.broker import broker_url
    from coordinator.engine.running import available_cores, running_engine
    from coordinator.export.geojson import encoded, provenance
    from coordinator.export.results import (
        features_of,
        refuse_unknown,
        refuse_unwritable,
        write_results,
    )
    from coordinator.querying import locate_photos, searched

    search = search_config(pair, k, vote, weights, descriptors, top)
    opened = opened_index(index)
    search = fitted_search(search, vote, opened.config.features)
    outs = [result_file(each, map(Path, sources)) for each in out or ()]
    refuse_unknown(outs)
    refuse_unwritable(outs)
    where = where_of(
        opened.generation, bbox, within, since, until, heading, surveys=survey, uris=uri
    )
    search = search.model_copy(update={"where": where})
    about = {**provenance(opened), "searched": searched(opened, where)}
    tally = _Tally()
    with ExitStack() as stack:
        progress = stack.enter_context(bars())
        photos = stack.enter_context(
            photos_at_hand(sources, seen_by_workers(index, broker_url(broker)), progress)
        )
        for each in outs:  # a folder or a list may name one of them
            result_file(each, (Path(photo.path) for photo in photos if photo.path))
        count = min(workers or len(photos), len(photos), available_cores())
        engine = stack.enter_context(running_engine(broker, count, ("locate",)))
        progress.begin("locate", len(photos), 0)
        answers = tally.count(
            locate_photos(
                opened, photos, search, engine.follower, lambda: progress.advance("locate")
            )
        )
        if outs:
            write_results(outs, answers, opened, about, tell)
        else:
            for piece in encoded(features_of(answers), about):
                typer.echo(piece, nl=False)  # UTF-8 in every locale
    for query, error in tally.failed:
        complain(f"{query}: {error}")
    for choice in sorted(tally.not_chosen):
        tell(f"Detectors and k by {choice}")
    if outs:
        located = tally.n_answers - len(tally.failed)
        tell(f"{located} of {tally.n_answers} photos located: {', '.join(map(str, outs))}")
    if tally.n_doubtful:
        tell(
            f"{tally.n_doubtful} of {tally.n_answers} photos may be of another place: nothing in "
            "this survey stands out as theirs (in_survey: false)."
        )
    return SOME_SKIPPED if tally.failed else 0


class _Tally:
    """What a person is told at the end, noted as the answers go by."""

    def __init__(self) -> None:
        self.n_answers = self.n_doubtful = 0
        self.failed: list[tuple[str, str]] = []
        self.not_chosen: set[str] = set()

    def count(self, answers: "Iterable[Located]") -> "Iterator[Located]":
        for answer in answers:
            self.n_answers += 1
            self.n_doubtful += answer.doubtful
            self.not_chosen |= answer.not_chosen
            if answer.error is not None:
                self.failed.append((answer.query, answer.error))
            yield answer
