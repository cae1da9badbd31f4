"""The page of `flaneur evaluate --out`: made by the command from real rankings, and looked at."""

import base64
import html
import io
import json
import re
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from shutil import copyfile
from typing import Any

import numpy as np
import pytest
from PIL import Image
from test_export_page import browse, needs_browser
from typer.testing import CliRunner

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig, SearchConfig
from coordinator.cli import main
from coordinator.cli.show import Bars
from coordinator.engine.running import Engine
from coordinator.evaluating import MAX_SHEETS, report_of, write_sheets
from coordinator.export.evaluation import JudgedSheet, write_evaluation_page
from coordinator.export.sheets import BOX_RGB, SheetMatch, thumbnail_jpeg
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from coordinator.querying import judge_queries
from coordinator.truth import JudgedQuery, read_truth
from index.opened import OpenedIndex
from retrieval.evaluation import QueryResult
from survey import ReadOptions

HOSTILE = 'a"><script>document.title="owned"<!--&amp;.jpg'
UNICODE = "été 日本.jpg"
NAMES = [*(f"{number:02d}.jpg" for number in range(8)), UNICODE, HOSTILE]
CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff", "mser"), max_frames=150),
    codebooks=CodebookConfig(max_words=200),
)
RESULT = QueryResult("q", 0.25, 0.2, 2, 3, ("hesaff", "star"), 5, 0.1, "given")


@pytest.fixture(scope="module")
def opened(
    small_survey: Path, tmp_path_factory: pytest.TempPathFactory, engine: Engine
) -> OpenedIndex:
    """Ten images, one of which is deleted once it is indexed."""
    root = tmp_path_factory.mktemp("evaluated")
    (root / "survey").mkdir()
    for number, name in enumerate(NAMES):
        copyfile(small_survey / f"{number:02d}.jpg", root / "survey" / name)
    intake = read_surveys([("", root / "survey")], ReadOptions(no_pose=True))
    job, plan = make_plan(root / "index", intake, CONFIG, 4)
    run_job(job, plan, intake, nullcontext(engine), Bars(None))
    (root / "survey" / "07.jpg").unlink()
    return OpenedIndex(root / "index")


@pytest.fixture(scope="module")
def truth(
    small_survey: Path, tmp_path_factory: pytest.TempPathFactory, opened: OpenedIndex
) -> Path:
    """Photos that are right, wrong, indexed too, of a name that bites, and unreadable."""
    folder = tmp_path_factory.mktemp("photos")
    for name, shown in ((HOSTILE, "09.jpg"), ("right.png", "03.jpg"), ("wrong.png", "04.jpg")):
        picture = Image.open(small_survey / shown).crop((0, 0, 280, 200)).resize((560, 400))
        picture.save(folder / name, "JPEG", quality=60)
    copyfile(small_survey / "05.jpg", folder / "indexed.jpg")
    (folder / "bad.jpg").write_text("no picture", "utf-8")
    relevant = {
        HOSTILE: [HOSTILE],
        "right.png": ["03.jpg"],
        "wrong.png": ["07.jpg"],
        "indexed.jpg": ["05.jpg", UNICODE],
        "bad.jpg": ["00.jpg"],
    }
    (folder / "truth.json").write_text(json.dumps(relevant), "utf-8")
    return folder / "truth.json"


@pytest.fixture(scope="module")
def report(opened: OpenedIndex, truth: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that the command wrote."""
    out = tmp_path_factory.mktemp("report") / "new"
    arguments = ("--index", opened.root, "--truth", truth, "--out", out, "--workers", "1")
    given = ("--pair", "hesaff,mser", "--k", "2", "--json")
    answer = CliRunner().invoke(main, ["evaluate", *map(str, arguments), *given])
    assert answer.exit_code == 3, answer.stderr  # one photo cannot be read
    assert json.loads(answer.stdout) == json.loads((out / "report.json").read_text("utf-8"))
    return out


@pytest.fixture(scope="module")
def page(report: Path) -> str:
    return (report / "index.html").read_text("utf-8")


def sheets_of(page: str) -> list[str]:
    return re.findall(r'<article class="sheet".*?</article>', page, re.S)


def sheet_of(page: str, query: str) -> str:
    (sheet,) = (s for s in sheets_of(page) if f"<h2>{html.escape(query)}</h2>" in s)
    return sheet


def items_of(sheet: str) -> list[str]:
    return re.findall(r"<li class=.*?</li>", sheet, re.S)


def pictures_in(text: str) -> list[bytes]:
    found = re.findall(r'src="data:image/jpeg;base64,([^"]*)"', text)
    return [base64.b64decode(each, validate=True) for each in found]


def test_the_json_has_what_was_promised_and_no_list_of_matches(report: Path) -> None:
    found: dict[str, Any] = json.loads((report / "report.json").read_text("utf-8"))
    keys = {"query", "ap", "ap_10", "first_hit_rank", "n_relevant", "detectors", "k", "seconds"}
    assert all(set(each) == keys | {"choice"} for each in found["per_query"])
    assert {each["choice"] for each in found["per_query"]} == {"given"}
    assert [each["query"] for each in found["unreadable"]] == ["bad.jpg"]


def test_the_worst_query_comes_first_and_every_one_has_its_ten(report: Path, page: str) -> None:
    found = json.loads((report / "report.json").read_text("utf-8"))
    worst_first = sorted(found["per_query"], key=lambda each: (each["ap"], each["query"]))
    assert worst_first != found["per_query"]  # which is in the order of the truth
    titles = [re.search(r"<h2>(.*?)</h2>", sheet) for sheet in sheets_of(page)]
    assert [title and title.group(1) for title in titles] == [
        html.escape(each["query"]) for each in worst_first
    ]
    assert all(len(items_of(sheet)) == 10 for sheet in sheets_of(page))
    for each in worst_first:
        assert f"AP <b>{each['ap']:.3f}</b>" in sheet_of(page, each["query"])
        assert f"at rank {each['first_hit_rank']}<" in sheet_of(page, each["query"])
    assert f"<dt>mAP</dt><dd>{found['mAP']:.3f}</dd>" in page


def test_hits_are_marked_at_their_rank(report: Path, page: str) -> None:
    first = items_of(sheet_of(page, "right.png"))[0]
    assert "<b>1</b>" in first
    assert "✓ hit" in first
    assert "<bdi>03.jpg</bdi>" in first
    found = json.loads((report / "report.json").read_text("utf-8"))
    (wrong,) = (each for each in found["per_query"] if each["query"] == "wrong.png")
    items = items_of(sheet_of(page, "wrong.png"))
    assert "✗ miss" in items[0]
    marked = [rank for rank, item in enumerate(items, 1) if "✓ hit" in item]
    assert marked == [rank for rank in (wrong["first_hit_rank"],) if rank <= 10]


def test_junk_is_named_and_has_no_rank(page: str) -> None:
    items = items_of(sheet_of(page, "indexed.jpg"))
    assert "<bdi>05.jpg</bdi>" in items[0]  # the photo itself is the best match of itself
    assert "<b>junk</b>" in items[0]
    assert "hit" not in re.sub(r'src="[^"]*"', "", items[0])
    ranks = [re.findall(r"<b>(\d+)</b>", item) for item in items]
    assert ranks == [[], *([str(rank)] for rank in range(1, 10))]


def test_an_image_whose_file_is_gone_is_its_name(page: str) -> None:
    gone = [item for item in items_of(page) if "<bdi>07.jpg</bdi>" in item]
    assert gone
    assert all("no picture" in item and "<img" not in item for item in gone)
    assert all("<img" in item for item in items_of(page) if item not in gone)


def test_pictures_are_small(page: str) -> None:
    pictures = pictures_in(page)
    assert len(pictures) >= 4
    assert max(map(len, pictures)) <= 15_000
    assert all(max(Image.open(io.BytesIO(each)).size) <= 256 for each in pictures)


def test_hostile_names_are_text_everywhere(page: str) -> None:
    assert HOSTILE not in page
    assert html.escape(HOSTILE) in page
    assert page.count("</script>") == page.count("<script") == 1
    assert f"<bdi>{UNICODE}</bdi>" in page
    assert "Unreadable: bad.jpg: is not a supported image" in page


@needs_browser
def test_in_a_browser_nothing_fails_and_nothing_is_asked_for(report: Path, tmp_path: Path) -> None:
    document, console, asked = browse(report / "index.html", tmp_path)
    assert "4 of 4 shown" in document
    assert "<title>Flaneur: evaluation</title>" in document
    assert console == []
    assert asked == []


def browsed(tmp_path: Path, order: str, show: str, name: str) -> list[str]:
    """The queries that are shown, in order, once somebody has chosen; the policy is put aside."""
    results = [
        replace(RESULT, query=query, ap=ap, first_hit_rank=first)
        for query, ap, first in (
            ("c", 0.1, 40), ("A<", 0.2, 3), ("b", 0.2, None), ("d", 0.9, 1), ("e", 0.3, None)
        )
    ]  # fmt: skip
    out = tmp_path / "page.html"
    write_evaluation_page(out, "t", {}, (), [JudgedSheet(each, None, ()) for each in results])
    choosing = (
        f"const f = document.querySelector('.controls'); f.elements.order.value = '{order}';"
        f"f.elements.show.value = '{show}'; f.elements.name.value = '{name}';"
        "f.dispatchEvent(new Event('input'));"
    )
    text = re.sub(r"<meta http-equiv[^>]*>", "", out.read_text("utf-8"))
    out.write_text(text.replace("</body>", f"<script>{choosing}</script></body>"), "utf-8")
    document, console, _ = browse(out, tmp_path)
    assert console == []
    shown = [sheet for sheet in sheets_of(document) if 'hidden=""' not in sheet.split(">")[0]]
    names = [re.search(r"<h2>(.*?)</h2>", sheet) for sheet in shown]
    assert f"{len(shown)} of 5 shown" in document
    return [html.unescape(name.group(1)) for name in names if name]


@needs_browser
@pytest.mark.parametrize(
    ("order", "show", "name", "expected"),
    [
        ("worst", "all", "", ["c", "A<", "b", "e", "d"]),
        ("best", "wrong", "", ["e", "b", "A<", "c"]),
        ("first", "all", "", ["d", "A<", "c", "b", "e"]),
        ("name", "none", "", ["b", "c", "e"]),
        ("worst", "all", "a", ["A<"]),
    ],
)
def test_queries_can_be_ordered_and_filtered(
    tmp_path: Path, order: str, show: str, name: str, expected: list[str]
) -> None:
    assert browsed(tmp_path, order, show, name) == expected


def test_of_very_many_queries_the_worst_are_shown(
    tmp_path: Path, opened: OpenedIndex, truth: Path, engine: Engine
) -> None:
    search = SearchConfig(pair=("hesaff", "mser"), k=2)
    uris = opened.catalogue.column("uri")
    (query,) = (each for each in read_truth(truth, None, uris) if each.query == "right.png")
    (answer,) = judge_queries(opened, [query], search, engine.follower, lambda: None)
    names = [f"{number:03d}" for number in range(MAX_SHEETS + 1)]
    answers = [{**answer, "query": name, "ap": 1 - int(name) / 999} for name in names]
    queries: list[JudgedQuery] = [replace(query, query=name) for name in names]
    report = report_of(answers, opened, search)
    write_sheets(tmp_path / "page.html", report, answers, queries, opened, Bars(None))
    page = (tmp_path / "page.html").read_text("utf-8")
    assert f"Only the {MAX_SHEETS} worst of {MAX_SHEETS + 1} queries are shown." in page
    assert len(sheets_of(page)) == MAX_SHEETS
    assert "<h2>000</h2>" not in page  # the best of them
    assert sheets_of(page)[0].count(f"<h2>{names[-1]}</h2>") == 1
    assert f"{MAX_SHEETS + 1} queries against 10 images" in page


def test_a_name_that_is_no_utf_8_can_be_shown(tmp_path: Path) -> None:
    name = b"caf\xe9.jpg".decode("utf-8", "surrogateescape")
    sheet = JudgedSheet(replace(RESULT, query=name), None, (SheetMatch(name, 1, 2.0, None, True),))
    write_evaluation_page(tmp_path / "page.html", name, {}, (name,), [sheet])
    assert (tmp_path / "page.html").read_text("utf-8").count("caf?.jpg") >= 5


def test_no_hit_at_all_is_said_and_every_text_is_escaped(tmp_path: Path) -> None:
    sheet = JudgedSheet(replace(RESULT, first_hit_rank=None, choice="<b>choice"), None, ())
    write_evaluation_page(
        tmp_path / "page.html", "<b>title", {"<b>mean": 0.5}, ("<b>note",), [sheet]
    )
    page = (tmp_path / "page.html").read_text("utf-8")
    assert "nowhere" in page
    for text in ("title", "mean", "note", "choice"):
        assert f"&lt;b&gt;{text}" in page
        assert f"<b>{text}" not in page


def test_the_box_of_a_query_is_outlined_and_thumbnails_are_upright(tmp_path: Path) -> None:
    picture = np.full((600, 800, 3), 90, np.uint8)
    picture[:300] = 20  # dark above
    Image.fromarray(picture).rotate(180).save(tmp_path / "a.png")

    def shown(box: tuple[float, float, float, float] | None) -> np.ndarray:
        jpeg = thumbnail_jpeg(tmp_path / "a.png", 200, quarter_turns=2, box=box)
        return np.asarray(Image.open(io.BytesIO(jpeg)).convert("RGB")).astype(int)

    plain = shown(None)
    assert plain.shape == (150, 200, 3)
    assert plain[20, 100].max() < 40 < 60 < plain[130, 100].min()
    boxed = np.abs(shown((80, 60, 400, 1e12)) - BOX_RGB).sum(axis=2) < 90
    rows, columns = np.nonzero(boxed)
    assert (columns.min(), columns.max()) == (pytest.approx(20, abs=2), pytest.approx(100, abs=2))
    assert (rows.min(), rows.max()) == (pytest.approx(15, abs=2), 149)


def test_a_picture_full_of_detail_is_still_small(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (600, 600, 3), dtype=np.uint8)
    Image.fromarray(noise).resize((256, 256), Image.Resampling.NEAREST).save(tmp_path / "a.png")
    plain = io.BytesIO()
    Image.open(tmp_path / "a.png").save(plain, "JPEG", quality=80)
    assert len(plain.getvalue()) > 15_000
    assert len(thumbnail_jpeg(tmp_path / "a.png", 256)) <= 15_000
