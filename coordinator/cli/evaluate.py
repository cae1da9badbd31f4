"""`flaneur evaluate`: how well photos of known places are found."""

import json
from pathlib import Path
from typing import Annotated

import typer

from contracts.errors import BadConfig
from coordinator.cli.lists import (
    SOME_SKIPPED,
    Broker,
    Descriptors,
    IndexFolder,
    K,
    Pair,
    Truth,
    TruthRoot,
    Vote,
    Weights,
    Workers,
    fitted_search,
    search_config,
)
from coordinator.cli.opening import opened_index
from coordinator.cli.outputs import result_folder, utf_8
from coordinator.cli.show import bars, complain

NAME = "evaluate"


def command(
    index: IndexFolder,
    truth: Truth,
    root: TruthRoot = None,
    out: Annotated[Path | None, typer.Option(help="Folder for the report.")] = None,
    pair: Pair = "auto",
    k: K = "auto",
    vote: Vote = "auto",
    weights: Weights = "idf,norm",
    descriptors: Descriptors = None,
    workers: Workers = None,
    broker: Broker = None,
    tables: Annotated[
        bool,
        typer.Option(
            "--tables",
            help="Also answer every query in every way: single detectors, pairs, late fusion, "
            "every k and rule; the paper's tables with controls go to --out.",
        ),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> int:
    """Search for every query of a ground truth and score the rankings."""
    from coordinator.comparing.report import check_comparable, compare
    from coordinator.engine.running import running_engine
    from coordinator.evaluating import report_of, table_of, write_sheets
    from coordinator.export.files import write_whole
    from coordinator.querying import judge_queries
    from coordinator.truth import truth_of_index

    search = search_config(pair, k, vote, weights, descriptors, top=10)
    opened = opened_index(index)
    search = fitted_search(search, vote, opened.config.features)
    out = None if out is None else result_folder(out)
    if tables and not isinstance(index, Path):
        raise BadConfig("--tables keeps files in the index's folder: name that, not its URL")
    if tables and out is None:
        raise BadConfig("--tables writes several files; name a folder with --out")
    queries = truth_of_index(opened, truth, root)
    if tables:
        check_comparable(opened, queries)
    with running_engine(broker, workers, ("locate",)) as engine, bars() as progress:
        progress.begin("evaluate", len(queries), 0)
        answers = judge_queries(
            opened, queries, search, engine.follower, lambda: progress.advance("evaluate")
        )
        for answer in answers:
            if "error" in answer:
                complain(f"{answer['query']}: {answer['error']}")
        report = report_of(answers, opened, search)
        text = json.dumps(report, ensure_ascii=False, allow_nan=False)
        if out is not None:
            write_whole(out / "report.json", utf_8(text))
            write_whole(out / "report.md", utf_8(table_of(report)))
            write_sheets(out / "index.html", report, answers, queries, opened, progress)
        if tables and out is not None:
            name = truth.absolute().parent.name
            compare(opened, queries, search, name, out, engine.follower, progress)
    typer.echo(utf_8(text if as_json else table_of(report)))
    return SOME_SKIPPED if report["unreadable"] else 0
