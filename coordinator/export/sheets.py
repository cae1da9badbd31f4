"""The part of a page that shows each query beside what was found, as HTML text."""

import base64
import html
import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2

from geo.geojson import Feature
from survey import decode_image

BOX_RGB = (255, 196, 46)
_JPEG_QUALITIES = (80, 65, 50, 35, 20)


@dataclass(frozen=True, slots=True)
class SheetMatch:
    """One match as shown.

    rank : None for junk, which has none. thumbnail_jpeg : None where the file is gone.
    hit : whether it is relevant, None when no truth is known.
    """

    image: str
    rank: int | None
    score: float
    thumbnail_jpeg: bytes | None
    hit: bool | None


@dataclass(frozen=True, slots=True)
class QuerySheet:
    """One query as shown, with what is known of its truth; None: not known.

    `query` is the path as given, as in the features' property of that name. `style` says what
    kind of picture the photo is. `right_facade` is whether the best match shows the same facade.
    `estimate` is the feature of its place.
    """

    query: str
    photo_jpeg: bytes
    style: str | None
    detectors: tuple[str, ...]
    k: int
    matches: tuple[SheetMatch, ...]
    metres_from_truth: float | None
    right_facade: bool | None
    estimate: Feature | None = None


def thumbnail_jpeg(
    path: str | Path,
    side_px: int,
    *,
    fragment: str = "",
    quarter_turns: int = 0,
    box: tuple[float, float, float, float] | None = None,
    max_bytes: int = 15_000,
) -> bytes:
    """A small JPEG of an image, upright.

    Parameters
    ----------
    fragment : what within the file is the image; "" = all of it.
    quarter_turns : counter-clockwise, after EXIF orientation.
    box : x1 y1 x2 y2, pixels of the upright original; outlined.
    max_bytes : the quality is lowered until it is met, or no lower is worth a look.

    Raises
    ------
    UnusableImage : it is gone or cannot be read.
    """
    decoded = decode_image(
        path, fragment=fragment, quarter_turns=quarter_turns, max_side_px=side_px
    )
    rgb = decoded.rgb.copy()
    if box is not None:
        # OpenCV's integers have 32 bits, and a truth may hold any number.
        x1, y1, x2, y2 = (round(min(max(each / decoded.scale, -9), 9999)) for each in box)
        cv2.rectangle(rgb, (x1, y1), (x2, y2), BOX_RGB, 2)
    jpeg = b""
    for quality in _JPEG_QUALITIES:
        _, encoded = cv2.imencode(".jpg", rgb[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
        jpeg = encoded.tobytes()
        if len(jpeg) <= max_bytes:
            break
    return jpeg


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
    certainty = "" if sheet.estimate is None else _certainty(sheet.estimate["properties"])
    lines = filter(None, [sheet.style, chosen, certainty])
    described = "".join(f"<span>{html.escape(line)}</span>" for line in lines)
    matches = "\n".join(match_html(match) for match in sheet.matches)
    return (
        '<article class="sheet"><button class="query" type="button">'
        f"{picture_html(sheet.photo_jpeg, 'the photo')}"
        f"<div><h2>{html.escape(sheet.query)}</h2>{described}{_verdict(sheet)}</div></button>\n"
        f'<ol class="matches">\n{matches}\n</ol></article>'
    )


def _certainty(estimate: Mapping[str, Any]) -> str:
    """How sure the place is, in one line."""
    text = f"within {_metres(estimate['radius_m'])} (68 %)"
    if estimate["radius_95_m"] is not None:
        text += f", {_metres(estimate['radius_95_m'])} (95 %)"
    if estimate["confidence"] is not None:
        text += f" · confidence {estimate['confidence']:.0%}".replace("%", " %")
    return text + (" · perhaps of another place" if estimate["in_survey"] is False else "")


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


def match_html(match: SheetMatch) -> str:
    """One item of a list of matches, its name escaped."""
    css, mark = {
        True: ("hit", ' <b class="yes">✓ hit</b>'),
        False: ("miss", ' <b class="no">✗ miss</b>'),
        None: ("", ""),
    }[match.hit]
    standing = "junk" if match.rank is None else str(match.rank)
    name = html.escape(match.image)
    # The isolate keeps a name whole where the style cuts its beginning instead of its end.
    return (
        f'<li class="{css if match.rank else "junk"}">'
        f"{picture_html(match.thumbnail_jpeg, f'match {standing}')}"
        f"<b>{standing}</b>{mark} {_score(match.score)}"
        f'<span class="name" title="{name}"><bdi>{name}</bdi></span></li>'
    )


def picture_html(jpeg: bytes | None, described: str) -> str:
    """The picture inside the page, or a square that says that it is gone."""
    if jpeg is None:
        return '<div class="gone">no picture</div>'
    uri = "data:image/jpeg;base64," + base64.b64encode(jpeg).decode("ascii")
    return f'<img alt="{html.escape(described)}" loading="lazy" src="{uri}">'


def _score(score: float) -> str:
    return f"{score:,.0f}" if abs(score) >= 1000 else f"{score:.3g}"


def _metres(metres: float) -> str:
    if metres >= 10_000:
        return f"{metres / 1000:,.0f} km"
    return f"{metres:.1f} m" if metres < 100 else f"{metres:,.0f} m"
