"""Evaluating: judged queries become the report of `flaneur evaluate`."""

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from contracts.config import SearchConfig
from contracts.errors import UnusableImage
from contracts.progress import Progress
from coordinator.export.evaluation import JudgedSheet, write_evaluation_page
from coordinator.export.sheets import SheetMatch, thumbnail_jpeg
from coordinator.export.tables import Table, markdown
from coordinator.truth import JudgedQuery
from index.catalogue import Catalogue, CatalogueRow
from index.opened import OpenedIndex
from retrieval.evaluation import QueryResult, summarise

Json = dict[str, Any]
_RESULT = TypeAdapter(QueryResult)
TITLE = "Flaneur: evaluation"
MEANS = ("mAP", "mAP@10", "R@1", "R@5", "R@10", "MRR", "seconds_per_query")
"""What a report shows to people, by its keys."""
MAX_SHEETS = 200
"""Queries on a page: some 100 kB each."""
PHOTO_PX, MATCH_PX = 256, 176


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
            "n_images": index.n_live,
            "generation": index.generation.number,
        },
        "per_query": [asdict(result) for result in results],
    }


def table_of(report: Json) -> str:
    """The report as Markdown: the means, then a line a query, worst first."""
    means = Table("means", "Means", MEANS, (tuple(report[name] for name in MEANS),))
    per_query = Table(
        "queries",
        "Queries",
        ("query", "AP", "first hit", "relevant", "detectors", "k"),
        tuple(
            (
                each["query"],
                each["ap"],
                each["first_hit_rank"],
                each["n_relevant"],
                "-".join(each["detectors"]),
                each["k"],
            )
            for each in sorted(report["per_query"], key=_worst_first)
        ),
    )
    return "\n\n".join((_counts(report), markdown(means), markdown(per_query)))


def write_sheets(
    out: Path,
    report: Json,
    answers: Sequence[Json],
    queries: Sequence[JudgedQuery],
    index: OpenedIndex,
    progress: Progress,
) -> None:
    """Write the page of an evaluation: the worst 200 queries beside the best of their rankings.

    answers : as judged, in the order of `queries`. report : made of them.

    Raises
    ------
    WrongInput : `out` cannot be written.
    """
    judged = [
        (query, answer)
        for query, answer in zip(queries, answers, strict=True)
        if "error" not in answer and "excluded" not in answer
    ]
    judged.sort(key=lambda pair: _worst_first(pair[1]))
    shown = judged[:MAX_SHEETS]
    search = report["config"]["search"]
    weights = ", ".join(search["weights"]) or "no weights"
    notes = [_counts(report), f"Vote: {search['vote']}. Weights: {weights}."]
    if len(judged) > len(shown):
        notes.append(f"Only the {len(shown)} worst of {len(judged):,} queries are shown.")
    notes += [f"Unreadable: {each['query']}: {each['error']}" for each in report["unreadable"]]
    pictures = _Pictures(index.catalogue)
    sheets = []
    progress.begin("sheets", len(shown), 0)
    for query, answer in shown:
        sheets.append(pictures.sheet(query, answer))
        progress.advance("sheets")
    write_evaluation_page(out, TITLE, {name: report[name] for name in MEANS}, notes, sheets)


class _Pictures:
    """Thumbnails, made once for an image that several queries found."""

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue
        self._made: dict[int, bytes | None] = {}

    def sheet(self, query: JudgedQuery, answer: Json) -> JudgedSheet:
        top = answer["top"]
        rows = self._catalogue.rows([each["image_id"] for each in top])
        matches = []
        rank = 0
        for each, row in zip(top, rows, strict=True):
            rank += not each["junk"]
            matches.append(
                SheetMatch(
                    image=row.uri,
                    rank=None if each["junk"] else rank,
                    score=each["score"],
                    thumbnail_jpeg=self._of(row),
                    hit=None if each["junk"] else each["hit"],
                )
            )
        photo = _picture(lambda: thumbnail_jpeg(str(query.path), PHOTO_PX, box=query.box))
        return JudgedSheet(_RESULT.validate_python(answer), photo, tuple(matches))

    def _of(self, row: CatalogueRow) -> bytes | None:
        if row.image_id not in self._made:
            self._made[row.image_id] = _picture(
                lambda: thumbnail_jpeg(
                    row.path, MATCH_PX, fragment=row.fragment, quarter_turns=row.quarter_turns
                )
            )
        return self._made[row.image_id]


def _picture(made: Callable[[], bytes]) -> bytes | None:
    try:
        return made()
    except UnusableImage:
        return None


def _counts(report: Json) -> str:
    return (
        f"{report['n_queries']:,} queries against {report['config']['n_images']:,} images; "
        f"{report['n_excluded']:,} without a relevant image left out, "
        f"{len(report['unreadable']):,} unreadable."
    )


def _worst_first(result: Json) -> tuple[float, str]:
    return result["ap"], result["query"]
