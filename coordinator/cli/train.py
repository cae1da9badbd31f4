"""`flaneur train`: fit the adaptive choice of detectors and k to an index."""

from pathlib import Path
from typing import Annotated, get_args

import typer

from contracts.config import VariantName
from contracts.errors import BadConfig
from coordinator.cli.lists import (
    SOME_SKIPPED,
    Broker,
    Descriptors,
    IndexFolder,
    Truth,
    TruthRoot,
    Vote,
    Weights,
    Workers,
    fitted_search,
    search_config,
)
from coordinator.cli.opening import opened_index
from coordinator.cli.outputs import result_file
from coordinator.cli.show import bars, complain, tell

NAME = "train"
_VARIANTS: tuple[VariantName, ...] = get_args(VariantName)


def command(
    index: IndexFolder,
    truth: Truth,
    root: TruthRoot = None,
    out: Annotated[
        Path | None, typer.Option(help="Write the model here, not into the index.")
    ] = None,
    variant: Annotated[
        str,
        typer.Option(
            help=f"Form of the regression: {', '.join(_VARIANTS)}; or auto: the one that does best "
            "on places left out."
        ),
    ] = "auto",
    vote: Vote = "auto",
    weights: Weights = "idf,norm",
    descriptors: Descriptors = None,
    workers: Workers = None,
    broker: Broker = None,
) -> int:
    """Fit the model that chooses detectors and k for each photo (Eq. 1 of the paper)."""
    from coordinator.comparing.report import check_comparable
    from coordinator.engine.running import running_engine
    from coordinator.export.files import write_whole
    from coordinator.querying import Rules, rehearse_queries
    from coordinator.training import train_model
    from coordinator.truth import truth_of_index
    from index.models import model_path, write_model
    from workers.stages.choose import KS

    variants = _variants(variant)
    if out is None and not isinstance(index, Path):
        raise BadConfig(
            f"{index} is in a store, where no model is written: name a file with --out, or train "
            "in the index's folder and publish it again"
        )
    search = search_config("auto", "auto", vote, weights, descriptors, top=10)
    opened = opened_index(index)
    search = fitted_search(search, vote, opened.config.features)
    out = None if out is None else result_file(out, (truth,))
    queries = truth_of_index(opened, truth, root)
    check_comparable(opened, queries)
    if out is None:
        model_path(opened.root).parent.mkdir(exist_ok=True)  # or fail before the work
    with running_engine(broker, workers, ("locate",)) as engine, bars() as progress:
        progress.begin("train", len(queries), 0)
        answers = rehearse_queries(
            opened,
            queries,
            search,
            Rules.of(search),
            KS,
            engine.follower,
            lambda: progress.advance("train"),
        )
    model = train_model(answers, queries, opened, search, truth.absolute().parent.name, variants)
    if out is None:
        write_model(opened.root, model)
    else:
        write_whole(out, model.to_json().encode())
    unreadable = [answer for answer in answers if "error" in answer]
    for answer in unreadable:
        complain(f"{answer['query']}: {answer['error']}")
    tell(model.summary())
    if model.variant == "fixed":
        complain(
            "Choosing for each photo did no better than one choice for all: `flaneur locate` will "
            "use that."
        )
    return SOME_SKIPPED if unreadable else 0


def _variants(variant: str) -> list[VariantName]:
    chosen = [name for name in _VARIANTS if variant in ("auto", name)]
    if not chosen:
        raise BadConfig(f"--variant takes auto or one of {', '.join(_VARIANTS)}; got {variant!r}")
    return chosen
