"""The part of the result page that shows each query beside what was found, as HTML text."""

import base64
import html
import statistics
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SheetMatch:
    """One match as shown: `hit` is whether it is relevant, None when no truth is known."""

    image: str
    rank: int
    score: float
    thumbnail_jpeg: bytes
    hit: bool | None


@dataclass(frozen=True, slots=True)
class QuerySheet:
    """One query as shown, with what is known of its truth; None: not known.

    `query` is the path as given, as in the features' property of that name. `style` says what
    kind of picture the photo is. `right_facade` is whether the best match shows the same facade.
    """

    query: str
    photo_jpeg: bytes
    style: str | None
    detectors: tuple[str, ...]
    k: int
    matches: tuple[SheetMatch, ...]
    metres_from_truth: float | None
    right_facade: bool | None


def sheets_html(sheets: Sequence[QuerySheet]) -> str:
    """All sheets, every name escaped."""
    return "\n".join(_sheet(sheet) for sheet in sheets)


def summary_html(sheets: Sequence[QuerySheet]) -> str:
    """One line over all queries: how many, how many found first, how far from the truth."""
    parts = [f"{len(sheets)} {'query' if len(sheets) == 1 else 'queries'}"]
    firsts = [
        match.hit
        for sheet in sheets
        for match in sheet.matches
        if match.rank == 1 and match.hit is not None
    ]
    if firsts:
        parts.append(f"best match right for {sum(firsts)} of {len(firsts)}")
    metres = [s.metres_from_truth for s in sheets if s.metres_from_truth is not None]
    if metres:
        parts.append(f"median {_metres(statistics.median(metres))} from the truth")
    return " · ".join(parts)


def _sheet(sheet: QuerySheet) -> str:
    chosen = f"{' + '.join(sheet.detectors)}, k = {sheet.k}"
    lines = [sheet.style, chosen] if sheet.style else [chosen]
    described = "".join(f"<span>{html.escape(line)}</span>" for line in lines)
    matches = "\n".join(_match(match) for match in sheet.matches)
    return (
        '<article class="sheet"><button class="query" type="button">'
        f'<img alt="the photo" src="{_jpeg_uri(sheet.photo_jpeg)}">'
        f"<div><h2>{html.escape(sheet.query)}</h2>{described}{_verdict(sheet)}</div></button>\n"
        f'<ol class="matches">\n{matches}\n</ol></article>'
    )


def _verdict(sheet: QuerySheet) -> str:
    parts = []
    if sheet.metres_from_truth is not None:
        parts.append(f"{_metres(sheet.metres_from_truth)} from the truth")
    if sheet.right_facade is not None:
        parts.append(
            '<b class="yes">right facade</b>'
            if sheet.right_facade
            else '<b class="no">wrong facade</b>'
        )
    return f'<span class="verdict">{" · ".join(parts)}</span>' if parts else ""


def _match(match: SheetMatch) -> str:
    css, mark = {
        True: ("hit", ' <b class="yes">✓ hit</b>'),
        False: ("miss", ' <b class="no">✗ miss</b>'),
        None: ("", ""),
    }[match.hit]
    name = html.escape(match.image)
    # The isolate keeps a name whole where the style cuts its beginning instead of its end.
    return (
        f'<li class="{css}"><img alt="match {match.rank}" loading="lazy" '
        f'src="{_jpeg_uri(match.thumbnail_jpeg)}"><b>{match.rank}</b>{mark} {match.score:.3g}'
        f'<span class="name" title="{name}"><bdi>{name}</bdi></span></li>'
    )


def _metres(metres: float) -> str:
    if metres >= 10_000:
        return f"{metres / 1000:,.0f} km"
    return f"{metres:.1f} m" if metres < 100 else f"{metres:,.0f} m"


def _jpeg_uri(jpeg: bytes) -> str:
    return "data:image/jpeg;base64," + base64.b64encode(jpeg).decode("ascii")
