import functools
import html
import io
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from coordinator.export.page import write_page
from coordinator.export.sheets import QuerySheet, SheetMatch
from geo.geojson import (
    FeatureCollection,
    PlacedEstimate,
    PlacedMatch,
    PlacedTarget,
    estimate_feature,
    feature_collection,
    match_feature,
    target_feature,
)

HOSTILE = 'a"><script>document.title="owned"</script><!--<script>&amp;.jpg'
TRACK = [(2.3365 + i * 1e-4, 48.8490 + i * 2e-5) for i in range(20)]
PLAIN = "photos/été 1910.jpg"


@functools.cache
def jpeg() -> bytes:
    image = io.BytesIO()
    Image.new("RGB", (32, 24), (180, 160, 120)).save(image, "JPEG")
    return image.getvalue()


def matches_of(query: str) -> list[PlacedMatch]:
    first = PlacedMatch(
        query, 1, 2.5, HOSTILE, "file:///s", 0, *TRACK[0], 10.0, 0.0, 0.0, 60.0, None,
        ("hesaff", "star"), 2, None, 1,
    )  # fmt: skip
    return [
        replace(first, rank=rank, lon_deg=lon, lat_deg=lat)
        for rank, (lon, lat) in enumerate([TRACK[4], TRACK[4], TRACK[5], TRACK[15]], 1)
    ]


def collection(*queries: str) -> FeatureCollection:
    features = [match_feature(match) for query in queries for match in matches_of(query)]
    estimates = [
        PlacedEstimate(query, *TRACK[4], 12.0, 3, ("hesaff", "star"), 2) for query in queries
    ]
    targets = [PlacedTarget(query, *TRACK[9], 20.0, 3) for query in queries]
    return feature_collection(
        [*features, *map(estimate_feature, estimates), *map(target_feature, targets)]
    )


def sheet(query: str, hit: bool | None = None) -> QuerySheet:
    shown = tuple(SheetMatch(HOSTILE, rank, 1 / rank, jpeg(), hit) for rank in range(1, 5))
    return QuerySheet(query, jpeg(), "faded print", ("hesaff", "star"), 2, shown, None, None)


def page_of(tmp_path: Path) -> Path:
    out = tmp_path / "page.html"
    truth = {PLAIN: (2.3369, 48.8491)}
    sheets = [sheet(PLAIN, True), sheet(HOSTILE)]
    write_page(out, HOSTILE, collection(PLAIN, HOSTILE), sheets, HOSTILE, TRACK, truth)
    return out


def test_hostile_names_are_text_everywhere(tmp_path: Path) -> None:
    text = page_of(tmp_path).read_text("utf-8")
    assert '<script>document.title="owned"' not in text
    assert html.escape(HOSTILE) in text
    # The data block, the library and the page's own script; nothing closes or opens another.
    assert text.count("</script>") == 3
    assert len(re.findall(r"<script[ >]", text)) == 3


def test_the_data_in_the_page_are_the_results(tmp_path: Path) -> None:
    text = page_of(tmp_path).read_text("utf-8")
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.S)
    assert found is not None
    data = json.loads(found.group(1))
    assert data["collection"] == json.loads(json.dumps(collection(PLAIN, HOSTILE)))
    assert data["queries"] == [PLAIN, HOSTILE]
    assert data["truth"] == [[2.3369, 48.8491], None]
    assert data["track"] == [list(place) for place in TRACK]


def test_the_page_names_nothing_to_load(tmp_path: Path) -> None:
    text = page_of(tmp_path).read_text("utf-8")
    markup = re.sub(r"<(script|style)\b.*?</\1>", "", text, flags=re.S)
    sources = re.findall(r'\b(?:src|href)="([^"]*)"', markup)
    assert sources
    assert all(source.startswith("data:") for source in sources)
    assert "default-src &#x27;none&#x27;" in markup
    assert "sourceMappingURL" not in text


@pytest.mark.parametrize(
    ("hit", "shown", "hidden"),
    [(True, "✓ hit", "✗ miss"), (False, "✗ miss", "✓ hit"), (None, "faded print", "✓ hit")],
)
def test_hits_and_misses_are_marked_where_the_truth_is_known(
    hit: bool | None, shown: str, hidden: str, tmp_path: Path
) -> None:
    out = tmp_path / "page.html"
    write_page(out, "t", collection(PLAIN), [sheet(PLAIN, hit)])
    text = out.read_text("utf-8")
    assert shown in text
    assert hidden not in text


def test_the_summary_counts_firsts_and_takes_the_median_of_metres(tmp_path: Path) -> None:
    sheets = [
        replace(sheet("a", True), metres_from_truth=4.0, right_facade=True),
        replace(sheet("b", False), metres_from_truth=25_000.0, right_facade=False),
        replace(sheet("c"), metres_from_truth=8.0),
    ]
    out = tmp_path / "page.html"
    write_page(out, "t", collection("a"), sheets)
    text = out.read_text("utf-8")
    assert "3 queries · best match right for 1 of 2 · median 8.0 m from the truth" in text
    assert "25 km from the truth" in text
    assert "right facade" in text
    assert "wrong facade" in text


@pytest.mark.parametrize("in_survey", [True, False])
def test_a_sheet_says_how_sure_its_place_is(in_survey: bool, tmp_path: Path) -> None:
    estimate = estimate_feature(
        PlacedEstimate(
            PLAIN, *TRACK[4], 12.0, 3, ("hesaff",), 2,
            radius_95_m=140.0, confidence=0.72, in_survey=in_survey,
        )
    )  # fmt: skip
    out = tmp_path / "page.html"
    write_page(out, "t", collection(PLAIN), [replace(sheet(PLAIN), estimate=estimate)])
    text = out.read_text("utf-8")
    assert "within 12.0 m (68 %), 140 m (95 %) · confidence 72 %" in text
    assert ("perhaps of another place" in text) is not in_survey


def test_a_file_name_that_is_no_utf_8_can_be_shown(tmp_path: Path) -> None:
    name = b"caf\xe9.jpg".decode("utf-8", "surrogateescape")
    out = tmp_path / "page.html"
    write_page(out, "t", collection(name), [sheet(name)])
    assert "caf?.jpg" in out.read_text("utf-8")


# In a real browser: Debian's chromium, its software WebGL.

CHROMIUM = next((p for p in map(shutil.which, ("chromium", "chromium-browser")) if p), None)
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")


def browse(page: Path, folder: Path) -> tuple[str, list[str], list[str]]:
    """The document after it ran, what it said on the console, what it asked the network for."""
    netlog = folder / "net.json"
    command = [
        str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run",
        "--disable-background-networking", "--disable-component-update", "--disable-sync",
        "--host-resolver-rules=MAP * ~NOTFOUND", "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader", f"--user-data-dir={folder / 'profile'}",
        "--virtual-time-budget=10000", "--window-size=1280,900", "--enable-logging=stderr",
        f"--log-net-log={netlog}", "--dump-dom", page.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    console = [
        line
        for line in done.stderr.splitlines()
        if "CONSOLE" in line and "GPU stall due to ReadPixels" not in line
    ]
    events = json.loads(netlog.read_text("utf-8"))["events"]
    asked = [
        event["params"]["url"]
        for event in events
        # The browser's own errands have no origin; a page's have one, even if it is opaque.
        if event.get("params", {}).get("initiator", "not an origin") != "not an origin"
    ]
    return done.stdout, console, asked


@needs_browser
def test_in_a_browser_the_map_is_drawn_without_errors_or_network(tmp_path: Path) -> None:
    document, console, asked = browse(page_of(tmp_path), tmp_path)
    assert 'data-map="drawn"' in document
    drawn = re.search(r'data-drawn="(\d+)"', document)
    assert drawn is not None
    assert int(drawn.group(1)) >= len(TRACK) / 2
    assert "<title>owned" not in document
    assert re.findall(r'class="pin match[^"]*"|class="[^"]*\bpin match', document)
    assert 'title="what it shows, within 20 m"' in document
    assert "1·2" in document  # two images of one panorama share a pin
    assert console == []
    assert asked == []


@needs_browser
def test_a_page_that_fails_and_asks_the_network_would_be_caught(tmp_path: Path) -> None:
    page = tmp_path / "bad.html"
    page.write_text('<img src="http://127.0.0.1:9/x.png"><script>nowhere()</script>', "utf-8")
    _, console, asked = browse(page, tmp_path)
    assert any("nowhere" in line for line in console)
    assert asked == ["http://127.0.0.1:9/x.png"]


@needs_browser
def test_in_a_browser_without_any_place_the_sheets_remain(tmp_path: Path) -> None:
    out = tmp_path / "page.html"
    write_page(out, "t", feature_collection([]), [sheet(PLAIN)])
    document, console, asked = browse(out, tmp_path)
    assert 'data-map="failed"' in document
    assert PLAIN in document
    assert console == []
    assert asked == []
