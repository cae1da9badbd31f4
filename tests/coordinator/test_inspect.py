"""`flaneur inspect`: a panel a detector, the pair marked, numbers that say what is drawn."""

import io
import json
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from typer.testing import CliRunner, Result

from contracts.config import DETECTORS, CodebookConfig, FeatureConfig, IndexConfig, SearchConfig
from contracts.records import Frames
from coordinator.cli import main
from coordinator.cli.show import Bars
from coordinator.engine.running import Engine
from coordinator.export.inspection import CHOSEN_RGB, picture
from coordinator.indexing import run_job
from coordinator.inspecting import Inspection, NoIndex, Seen, coverage
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from index.models import read_model, write_model
from index.opened import OpenedIndex
from survey import DecodedImage, ReadOptions
from workers.stages.choose import choose
from workers.stages.retrieve import Chosen, read_photo

FEW = ("--max-frames", "60")


def inspect(*arguments: str | Path) -> Result:
    answer = CliRunner().invoke(main, ["inspect", *map(str, arguments)])
    assert answer.exception is None or isinstance(answer.exception, SystemExit)
    return answer


def report_of(*arguments: str | Path) -> dict[str, Any]:
    answer = inspect(*arguments, "--json")
    assert answer.exit_code == 0, answer.stderr
    report: dict[str, Any] = json.loads(answer.stdout)
    return report


def pixels(out: Path) -> NDArray[np.uint8]:
    with Image.open(out) as drawn:
        return np.asarray(drawn.convert("RGB"))


def marked_borders(picture: NDArray[np.uint8]) -> list[int]:
    """Columns where a marked panel's border runs down half of the photo's height or more."""
    in_colour = (picture == CHOSEN_RGB).all(axis=2)
    tall = in_colour.sum(axis=0) >= 120
    return [int(x) for x in np.flatnonzero(tall[1:] & ~tall[:-1]) + 1]


@pytest.fixture(scope="module")
def photo(small_survey: Path) -> Path:
    return small_survey / "03.jpg"


@pytest.fixture(scope="module")
def drawn(photo: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    out = tmp_path_factory.mktemp("drawn") / "frames.png"
    return out, report_of(photo, "--out", out, *FEW)


def test_every_detector_has_a_panel_with_the_photo_at_its_size(
    drawn: tuple[Path, dict[str, Any]],
) -> None:
    picture = pixels(drawn[0])
    columns = -(-len(DETECTORS) // 2)
    assert picture.shape[0] > 2 * 240
    assert columns * 320 < picture.shape[1] < columns * 320 * 1.5


def test_what_is_searched_with_is_marked_and_no_other_panel(
    drawn: tuple[Path, dict[str, Any]],
) -> None:
    out, report = drawn
    columns = -(-len(DETECTORS) // 2)
    marked: list[str] = []
    for row, half in enumerate(np.array_split(pixels(out), 2)):
        borders = marked_borders(half)
        in_column = [int(x // (half.shape[1] / columns)) for x in borders]
        assert in_column == sorted(2 * list(set(in_column)))  # a left and a right border each
        marked += [DETECTORS[row * columns + column] for column in in_column[::2]]
    assert 2 <= len(marked) < len(DETECTORS)
    assert set(marked) == set(report["pair"])


def test_the_report_counts_the_frames_and_gives_the_choice_of_locate(
    drawn: tuple[Path, dict[str, Any]], photo: Path
) -> None:
    _, report = drawn
    asked = NoIndex(IndexConfig(features=FeatureConfig(max_frames=60)))
    read = read_photo(asked, str(photo))
    chosen = choose(asked, read, SearchConfig())
    assert tuple(each["detector"] for each in report["detectors"]) == DETECTORS
    for each in report["detectors"]:
        frames = read.frames(each["detector"])
        assert each["n_frames"] == len(frames) > 0
        assert each["chosen"] == (each["detector"] in chosen.detectors)
        assert 0 < each["coverage"] <= min(1, len(frames) / 100)
        assert each["seconds"] >= 0
    assert (tuple(report["pair"]), report["k"]) == (chosen.detectors, chosen.k)
    assert report["choice"] == chosen.choice
    assert (report["width_px"], report["height_px"]) == (320, 240)


def test_radii_are_in_pixels_of_the_full_photo(photo: Path, tmp_path: Path) -> None:
    with Image.open(photo) as small:
        small.resize((1024, 768), Image.Resampling.BICUBIC).save(tmp_path / "1024.png")
    with Image.open(tmp_path / "1024.png") as reduced:
        reduced.resize((4096, 3072), Image.Resampling.NEAREST).save(tmp_path / "4096.png")
    once, fourfold = (
        report_of(tmp_path / name, "--out", tmp_path / "out.png", "--detectors", "star", *FEW)
        for name in ("1024.png", "4096.png")
    )
    assert (fourfold["width_px"], fourfold["inspected_width_px"]) == (4096, 1024)
    expected = 4 * once["detectors"][0]["median_radius_px"]
    assert fourfold["detectors"][0]["median_radius_px"] == pytest.approx(expected, rel=1e-6)


def test_a_frame_is_drawn_as_what_its_shape_makes_of_the_unit_circle() -> None:
    shape = np.array([[[40, 10], [0, 20]]], np.float32)
    frames = Frames(np.array([[150, 100]], np.float32), shape, np.ones(1, np.float32))
    black = np.zeros((200, 400, 3), np.uint8)
    inspection = Inspection(
        "black.png",
        DecodedImage(black, 400, 200, 1.0, ""),
        None,
        (Seen("star", frames, 0.01, 28.3, 0.0),),
        Chosen((("orb",),), 2, None, "given"),
    )
    with Image.open(io.BytesIO(picture(inspection, ".png"))) as drawn:
        sheet = np.asarray(drawn, np.int64)
    rows, columns = np.nonzero(sheet[:, :, 2] - sheet[:, :, 0] > 80)  # no text is that blue
    assert np.ptp(columns) == pytest.approx(2 * np.hypot(40, 10), abs=2)
    assert np.ptp(rows) == pytest.approx(2 * 20, abs=2)


def test_coverage_is_the_share_of_a_hundred_cells() -> None:
    corners = np.array([[0, 0], [199, 0], [0, 99], [199, 99], [1, 1]], np.float32)
    assert coverage(corners, 200, 100) == 0.04
    every = np.stack(np.meshgrid(np.arange(10) * 20, np.arange(10) * 10), axis=-1)
    assert coverage(every.reshape(-1, 2).astype(np.float32), 200, 100) == 1.0
    assert coverage(np.empty((0, 2), np.float32), 200, 100) == 0.0


@pytest.mark.parametrize("size", [(300, 200), (1, 1)])
def test_a_blank_photo_has_panels_without_frames(tmp_path: Path, size: tuple[int, int]) -> None:
    Image.new("RGB", size, "white").save(tmp_path / "blank.png")
    report = report_of(tmp_path / "blank.png", "--out", tmp_path / "new" / "out.jpg")
    assert [each["n_frames"] for each in report["detectors"]] == [0] * len(DETECTORS)
    assert {each["median_radius_px"] for each in report["detectors"]} == {None}
    with Image.open(tmp_path / "new" / "out.jpg") as drawn:
        assert drawn.format == "JPEG"


def test_no_frame_lies_where_the_mask_is_bright(photo: Path, tmp_path: Path) -> None:
    Image.new("L", (320, 240), 255).save(tmp_path / "all.png")
    left = Image.new("L", (320, 240))
    left.paste(255, (0, 0, 160, 240))
    left.save(tmp_path / "left.png")
    out = tmp_path / "out.png"
    nothing = report_of(photo, "--out", out, *FEW, "--mask", tmp_path / "all.png")
    assert {each["n_frames"] for each in nothing["detectors"]} == {0}
    half = report_of(photo, "--out", out, "--mask", tmp_path / "left.png")
    assert all(0 < each["coverage"] <= 0.5 for each in half["detectors"])


def test_without_json_a_table_is_printed(photo: Path, tmp_path: Path) -> None:
    answer = inspect(photo, "--out", tmp_path / "o.png", "--detectors", "orb,star", *FEW)
    assert answer.exit_code == 0
    assert "orb" in answer.stdout
    assert "Searched with star + orb, k = 2" in answer.stdout
    assert "o.png" in answer.stderr


def test_with_an_index_its_detectors_and_its_model_decide(
    small_survey: Path, photo: Path, tmp_path: Path, engine: Engine
) -> None:
    shipped = read_model(tmp_path)
    assert shipped is not None
    config = IndexConfig(
        features=FeatureConfig(detectors=shipped.detectors, max_frames=50),
        codebooks=CodebookConfig(max_words=20),
    )
    intake = read_surveys([("", small_survey)], ReadOptions(crs="EPSG:2154"))
    job, plan = make_plan(tmp_path / "index", intake, config, shard_size=10)
    run_job(job, plan, intake, nullcontext(engine), Bars(None))
    best = shipped.fixed[-1].model_copy(update={"mean_ap": 1.0})
    own = shipped.model_copy(update={"fixed": (best, *shipped.fixed[:-1]), "n_joined": 1})
    write_model(tmp_path / "index", own)
    report = report_of(photo, "--out", tmp_path / "o.png", "--index", tmp_path / "index")
    opened = OpenedIndex(tmp_path / "index")
    chosen = choose(opened, read_photo(opened, str(photo)), SearchConfig())
    assert tuple(each["detector"] for each in report["detectors"]) == shipped.detectors
    assert all(0 < each["n_frames"] <= 50 for each in report["detectors"])
    assert (tuple(report["pair"]), report["k"]) == (chosen.detectors, chosen.k)
    assert report["choice"] == chosen.choice
    assert not report["choice"].startswith("default")
    assert (tuple(report["pair"]), report["k"]) == (best.pair, best.k)


def test_a_name_that_no_font_has_is_drawn_all_the_same(photo: Path, tmp_path: Path) -> None:
    odd = tmp_path / ("\N{ESCAPE}[31m" + "日" * 60 + ".jpg")
    odd.write_bytes(photo.read_bytes())
    report = report_of(odd, "--out", tmp_path / "o.png", "--detectors", "star", *FEW)
    assert report["photo"] == str(odd)


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("missing.jpg", "--out", "o.png"), "missing.jpg: cannot be opened"),
        (("text.jpg", "--out", "o.png"), "text.jpg: is not a supported image"),
        (("{photo}", "--out", "o.png", "--mask", "text.jpg"), "text.jpg: is not a supported"),
        (("{photo}", "--out", "o.gif"), "ends in .png or .jpg; got 'o.gif'"),
        (("{photo}", "--out", "{photo}"), "one of the inputs"),
        (("{photo}", "--out", "text.jpg/o.png"), "is a file, not a folder"),
        (("{photo}", "--out", "/proc/none/o.png"), "cannot write /proc/none/o.png"),
        (("{photo}", "--out", "o.png", "--detectors", "x"), "--detectors takes any of"),
        (("{photo}", "--out", "o.png", "--max-frames", "0"), "max_frames"),
        (("{photo}", "--out", "o.png", "--max-frames", "9,orbs=5"), "got 'orbs=5'"),
        (("{photo}", "--out", "o.png", "--max-frames", "orb=many"), "got 'orb=many'"),
        (("{photo}", "--out", "o.png", "--index", "none"), "none"),
        (("{photo}", "--out", "o.png", "--index", ".", *FEW), "--index brings its own"),
    ],
)
def test_what_cannot_be_done_is_said_and_nothing_is_written(
    photo: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    says: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("text.jpg").write_text("no picture", "utf-8")
    answer = inspect(*(each.format(photo=photo) for each in arguments))
    assert answer.exit_code == 2
    assert says in answer.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["text.jpg"]
