"""The demo's pixels: drawn where the poses say, the same for the same seed."""

import csv
import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic_town import demo_town

from contracts.errors import BadConfig
from survey.synthetic import DemoSurvey, render_survey
from survey.synthetic.camera import Floats, Panel, View, project
from survey.synthetic.render import render
from survey.synthetic.shots import ShotOptions
from survey.synthetic.sprites import shrink
from survey.synthetic.street import UP, StreetPlan, lay_out
from survey.synthetic.styles import STYLES, postcard, restyle
from survey.synthetic.town import Decal, House, Town

SMALL = ShotOptions(width_px=160, height_px=120, n_queries=8, max_stops=3)


def _digests(folder: Path) -> dict[str, str]:
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, DemoSurvey]:
    folder = tmp_path_factory.mktemp("demo")
    return folder, render_survey(folder, 3, options=SMALL)


@pytest.fixture(scope="module")
def town() -> Town:
    return demo_town()


def _facing(
    eye: Floats, aim: Floats, angles_deg: tuple[float, float, float], size_px: tuple[int, int]
) -> View:
    """A view from `eye` along `aim`, with pitch, roll and horizontal field of view."""
    heading = float(np.degrees(np.arctan2(aim[0], aim[1])))
    return View(float(eye[0]), float(eye[1]), float(eye[2]), heading, *angles_deg, *size_px)


def _marked(town: Town, house: House) -> Town:
    """The town with nothing but one house, black, with a white square metre at its left foot."""
    size = (round(house.facade.panel.height_m * 40), round(house.facade.panel.width_m * 40))
    wall = np.zeros((*size, 3), dtype=np.uint8)
    wall[-40:, :40] = 255
    alone = House(house.facade, Decal(house.facade.panel, shrink(wall)), ())
    black = np.zeros_like(town.skies[0])
    return Town(town.plan, (alone,), (), (), town.sprites, (black,))


@pytest.mark.parametrize("roll_deg", [0.0, 8.0])
@pytest.mark.parametrize("inner", [True, False])
def test_a_corner_of_known_position_is_drawn_where_it_projects(
    town: Town, roll_deg: float, inner: bool
) -> None:
    house = next(h for h in town.houses if h.facade.inner == inner)
    panel: Panel = house.facade.panel
    eye = house.facade.middle + 9 * house.facade.outward + 2 * UP
    aim = panel.point(1.0, 1.0) - eye
    view = _facing(eye, aim, (3.0, roll_deg, 70.0), (640, 480))
    picture = render(_marked(town, house), view)
    corners = project(view, np.stack([panel.point(x, y) for x in (0, 1) for y in (0, 1)]))
    rows, cols = np.nonzero(picture[..., 0] > 200)
    assert cols.min() == pytest.approx(corners[:, 0].min(), abs=1.5)
    assert cols.max() == pytest.approx(corners[:, 0].max(), abs=1.5)
    assert rows.min() == pytest.approx(corners[:, 1].min(), abs=1.5)
    assert rows.max() == pytest.approx(corners[:, 1].max(), abs=1.5)


def test_the_inner_block_hides_what_stands_behind_it(town: Town) -> None:
    house = next(h for h in town.houses if h.facade.inner and h.facade.street == 0)
    eye = house.facade.middle + 6 * house.facade.outward + 1.6 * UP
    aim = -house.facade.outward
    view = _facing(eye, aim, (0.0, 0.0, 40.0), (160, 120))
    alone = Town(town.plan, (house,), town.road, (), town.sprites, town.skies)
    everything = Town(town.plan, town.houses, town.road, (), town.sprites, town.skies)
    assert np.array_equal(render(alone, view)[:90], render(everything, view)[:90])


def test_the_same_seed_writes_the_same_bytes_and_counts_every_picture(
    rendered: tuple[Path, DemoSurvey], tmp_path: Path
) -> None:
    folder, _ = rendered
    told: list[tuple[int, int]] = []
    render_survey(tmp_path, 3, lambda done, total: told.append((done, total)), SMALL)
    assert _digests(tmp_path) == _digests(folder)
    n_pictures = sum(1 for name in _digests(folder) if name.endswith(".jpg"))
    assert told == [(done, n_pictures) for done in range(1, n_pictures + 1)]


def test_another_seed_makes_another_town() -> None:
    first, second = (lay_out(StreetPlan(), seed) for seed in (3, 4))
    kinds = [[facade.template.name for facade in town] for town in (first, second)]
    assert kinds[0] != kinds[1]
    assert [facade.seed for facade in first] != [facade.seed for facade in second]


def test_every_image_has_a_pose_and_every_pose_an_image(
    rendered: tuple[Path, DemoSurvey],
) -> None:
    demo = rendered[1]
    with (demo.survey / "poses.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    files = {f"images/{path.name}" for path in (demo.survey / "images").iterdir()}
    assert {row["file"] for row in rows} == files == set(demo.facades_seen)
    assert all(0 <= float(row["heading"]) < 360 for row in rows)
    assert "EPSG:2154" in (demo.survey / "README.txt").read_text(encoding="utf-8")


def test_the_truth_names_queries_that_exist_and_images_that_see_their_facade(
    rendered: tuple[Path, DemoSurvey],
) -> None:
    demo = rendered[1]
    relevant = json.loads((demo.queries / "ground_truth.json").read_text(encoding="utf-8"))
    assert set(relevant) == {query.file for query in demo.truth}
    for query in demo.truth:
        assert (demo.queries / query.file).is_file()
        assert all(query.facade in demo.facades_seen[uri] for uri in relevant[query.file])
    truth = json.loads((demo.queries / "truth.json").read_text(encoding="utf-8"))
    assert [row["file"] for row in truth] == [query.file for query in demo.truth]


def test_every_style_adds_photos_and_leaves_the_dealt_ones_as_they_are(
    rendered: tuple[Path, DemoSurvey], tmp_path: Path
) -> None:
    folder, dealt = rendered
    demo = render_survey(tmp_path, 3, options=replace(SMALL, every_style=True))
    before, after = _digests(folder), _digests(tmp_path)
    assert len(demo.truth) == len(STYLES) * SMALL.n_queries
    assert set(dealt.truth) < set(demo.truth)
    assert {name for name in after if name.endswith(".jpg")} - set(before) == {
        f"queries/{query.file}" for query in set(demo.truth) - set(dealt.truth)
    }
    for name in before:
        assert name.endswith("truth.json") or before[name] == after[name]
    relevant = json.loads((demo.queries / "ground_truth.json").read_text(encoding="utf-8"))
    assert set(relevant) == {query.file for query in demo.truth}


@pytest.fixture(scope="module")
def photo(town: Town) -> np.ndarray:
    house = town.houses[4]
    eye = house.facade.middle + 11 * house.facade.outward + 2 * UP
    aim = -house.facade.outward
    return render(town, _facing(eye, aim, (8.0, 0.0, 65.0), (320, 240)))


@pytest.mark.parametrize("style", STYLES)
def test_a_style_is_repeatable_keeps_the_size_and_changes_the_photo(
    photo: np.ndarray, style: str
) -> None:
    before = photo.copy()
    styled = restyle(photo, style, 5)
    assert styled.shape == photo.shape
    assert styled.dtype == np.uint8
    assert np.array_equal(styled, restyle(photo, style, 5))
    assert any(not np.array_equal(styled, restyle(photo, style, seed)) for seed in range(6, 12))
    assert np.array_equal(photo, before)
    assert np.abs(styled.astype(int) - photo.astype(int)).mean() > 12


def test_night_is_dark_and_sepia_is_brown(photo: np.ndarray) -> None:
    assert restyle(photo, "night", 0).mean() < 0.75 * photo.mean()
    sepia = restyle(photo, "sepia", 0).reshape(-1, 3).mean(axis=0)
    assert sepia[0] > sepia[1] > sepia[2]


def test_sepia_pales_towards_the_top_or_the_foot() -> None:
    bars = np.zeros((320, 320, 3), dtype=np.uint8)
    bars[:, np.arange(320) % 40 < 20] = 255
    towards_foot = set()
    for seed in range(6):
        rows = restyle(bars, "sepia", seed)[..., 1].astype(float)
        # Averaged down a strip, grain and scratches leave the bars alone.
        top, foot = (strip.mean(axis=0).std() for strip in (rows[10:70], rows[-70:-10]))
        assert max(top, foot) > 1.3 * min(top, foot)
        towards_foot.add(top > foot)
    assert towards_foot == {True, False}


@pytest.mark.parametrize("style", STYLES)
def test_any_photo_can_be_restyled(style: str) -> None:
    odd = np.random.default_rng(0).integers(0, 256, (97, 131, 3), dtype=np.uint8)
    assert restyle(odd, style, 1).shape == odd.shape
    plain = np.full((64, 64, 3), 128, dtype=np.uint8)
    assert restyle(plain, style, 1).shape == plain.shape


def test_an_unknown_style_is_refused_by_name(photo: np.ndarray) -> None:
    with pytest.raises(BadConfig, match="fresco"):
        restyle(photo, "fresco", 0)


def test_a_postcard_keeps_the_size_and_has_a_pale_border(photo: np.ndarray) -> None:
    card = postcard(photo, "12. - Rue haute")
    assert card.shape == photo.shape
    assert card[0].min() > 190
