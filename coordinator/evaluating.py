"""Evaluating: judged queries become the report of `flaneur evaluate`."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from pydantic import TypeAdapter

from contracts.config import SearchConfig
from index.opened import OpenedIndex
from retrieval.evaluation import QueryResult, summarise

Json = dict[str, Any]
_RESULT = TypeAdapter(QueryResult)


def report_of(answers: Sequence[Json], index: OpenedIndex, search: SearchConfig) -> Json:
    """The one object that `evaluate --json` prints.

    Queries without a relevant image are left out of all means and counted, as are those that
    cannot be read.

    Raises
    ------
    BadTruth : no query is left.
    """
    results = [
        _RESULT.validate_python(answer)
        for answer in answers
        if "error" not in answer and "excluded" not in answer
    ]
    n_excluded = sum("excluded" in answer for answer in answers)
    return {
        **summarise(results, n_excluded).as_json(),
        "unreadable": [answer for answer in answers if "error" in answer],
        "config": {
            "search": search.model_dump(mode="json"),
            "index": index.config.model_dump(mode="json"),
            "n_images": index.n_images,
            "generation": index.generation.number,
        },
        "per_query": [asdict(result) for result in results],
    }


def table_of(report: Mapping[str, Any]) -> str:
    """The report as Markdown: the means, then a line a query, worst first."""
    names = ("mAP", "mAP@10", "R@1", "R@5", "R@10", "MRR", "seconds_per_query")
    counts = (
        f"{report['n_queries']} queries against {report['config']['n_images']} images; "
        f"{report['n_excluded']} without a relevant image left out, "
        f"{len(report['unreadable'])} unreadable."
    )
    per_query = sorted(report["per_query"], key=lambda result: (result["ap"], result["query"]))
    lines = [
        counts,
        "",
        "| " + " | ".join(names) + " |",
        "|" + "---|" * len(names),
        "| " + " | ".join(f"{report[name]:.3f}" for name in names) + " |",
        "",
        "| query | AP | first hit | relevant | detectors | k |",
        "|---|---|---|---|---|---|",
        *(
            f"| {each['query']} | {each['ap']:.3f} | {each['first_hit_rank'] or '-'} "
            f"| {each['n_relevant']} | {'-'.join(each['detectors'])} | {each['k']} |"
            for each in per_query
        ),
    ]
    return "\n".join(lines)
