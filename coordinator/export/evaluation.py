"""The page of an evaluation: every judged query beside the best of its ranking.

It opens from the disk and asks no network for anything, as the result page does.
"""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from coordinator.export.files import write_whole
from coordinator.export.sheets import SheetMatch, match_html, picture_html
from coordinator.export.template import filled, own_text
from retrieval.evaluation import QueryResult


@dataclass(frozen=True, slots=True)
class JudgedSheet:
    """One judged query as shown; photo_jpeg : None where the photo is gone."""

    result: QueryResult
    photo_jpeg: bytes | None
    matches: tuple[SheetMatch, ...]


def write_evaluation_page(
    out: Path,
    title: str,
    means: Mapping[str, float],
    notes: Sequence[str],
    sheets: Sequence[JudgedSheet],
) -> None:
    """Write the page, whole or not at all.

    Parameters
    ----------
    out : the .html file. means : shown in the header, by name, to 3 decimals.
    notes : lines of plain text below the means.
    sheets : the queries to show, in the order they first stand in.

    Raises
    ------
    WrongInput : `out` cannot be written.
    """
    script = own_text("evaluation.js")
    parts = {
        "title": html.escape(title),
        "means": "".join(
            f"<div><dt>{html.escape(name)}</dt><dd>{mean:.3f}</dd></div>"
            for name, mean in means.items()
        ),
        "notes": "".join(f"<p>{html.escape(note)}</p>" for note in notes),
        "page_css": own_text("page.css") + own_text("evaluation.css"),
        "sheets": "\n".join(_sheet(sheet) for sheet in sheets),
        "script": script,
    }
    write_whole(out, filled("evaluation.html", parts, script))


def _sheet(sheet: JudgedSheet) -> str:
    result = sheet.result
    name = html.escape(result.query)
    first = "nowhere" if result.first_hit_rank is None else f"at rank {result.first_hit_rank:,}"
    used = f"{' + '.join(result.detectors)}, k = {result.k}"
    matches = "\n".join(match_html(match) for match in sheet.matches)
    # 0: no hit at all; the script sorts and filters by these.
    return (
        f'<article class="sheet" data-query="{name}" data-ap="{result.ap:.6f}" '
        f'data-first="{result.first_hit_rank or 0}">'
        f'<div class="query">{picture_html(sheet.photo_jpeg, "the photo")}<div>'
        f'<h2>{name}</h2><span class="verdict">AP <b>{result.ap:.3f}</b> · first hit '
        f'<b class="{"yes" if result.first_hit_rank == 1 else "no"}">{first}</b></span>'
        f"<span>{result.n_relevant:,} relevant · AP@10 {result.ap_10:.3f}</span>"
        f"<span>{html.escape(used)} · {result.seconds:.2f} s</span>"
        f"<span>{html.escape(result.choice)}</span></div></div>\n"
        f'<ol class="matches">\n{matches}\n</ol></article>'
    )
