"""The result page: one HTML file with a map and every query beside its matches.

It opens from the disk and asks no network for anything: the map library, the pictures and the
data are inside, and a content security policy forbids the rest.
"""

import html
import importlib.util
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from contracts.errors import FlaneurError
from coordinator.export.files import write_whole
from coordinator.export.sheets import QuerySheet, sheets_html, summary_html
from coordinator.export.template import filled, own_text
from geo.geojson import FeatureCollection

LonLat = tuple[float, float]
"""WGS 84 longitude and latitude, degrees."""


def write_page(
    out: Path,
    title: str,
    collection: FeatureCollection,
    sheets: Sequence[QuerySheet],
    attribution: str = "",
    track: Sequence[LonLat] = (),
    truth: Mapping[str, LonLat] | None = None,
) -> None:
    """Write the page, whole or not at all.

    Parameters
    ----------
    out : the .html file.
    collection : the results, as `geo.geojson.feature_collection` builds them.
    sheets : the queries to show, in order; their `query` is that of the features.
    attribution : whose survey and pictures are shown; plain text.
    track : positions of the survey's images.
    truth : query -> where it was really taken.

    Raises
    ------
    FlaneurError : the map library is not installed, or `out` cannot be written (WrongInput).
    ValueError : a number of the collection is not finite.
    """
    places = truth or {}
    targets = any(each["properties"]["kind"] == "target" for each in collection["features"])
    data = {
        "collection": collection,
        "queries": [sheet.query for sheet in sheets],
        "track": list(track),
        "truth": [places.get(sheet.query) for sheet in sheets],
    }
    page_js, library_js = own_text("page.js"), _library("maplibre-gl.js")
    parts = {
        "title": html.escape(title),
        "summary": summary_html(sheets),
        "library_css": _library("maplibre-gl.css"),
        "page_css": own_text("page.css"),
        "target_key": '<li><i class="key target">★</i>what it shows</li>' if targets else "",
        "truth_key": '<li><i class="key truth"></i>true position</li>' if places else "",
        "sheets": sheets_html(sheets),
        "attribution": html.escape(attribution),
        "data": _json_for_script(data),
        "library_js": library_js,
        "page_js": page_js,
    }
    write_whole(out, filled("page.html", parts, library_js, page_js))


def _json_for_script(data: object) -> str:
    """JSON that no text in it can end early: `<` is written as its escape."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _library(name: str) -> str:
    """A file of MapLibre GL JS, from the `maplibre` package, which need not be imported."""
    spec = importlib.util.find_spec("maplibre")
    folders = spec.submodule_search_locations if spec is not None else None
    paths = [Path(folder, "srcjs", name) for folder in folders or ()]
    found = next((path for path in paths if path.is_file()), None)
    if found is None:
        raise FlaneurError(
            f"the map library's {name} was looked for in {[str(path) for path in paths]} and not "
            "found; install the package maplibre again"
        )
    # The hash in the policy is of the text that a browser reads, which knows no CR LF.
    text = found.read_text("utf-8").replace("\r\n", "\n")
    return re.sub(r"\n//# sourceMappingURL=.*", "", text)
