"""The demo's town: where its houses stand and what its cameras see of them."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from synthetic_town import demo_town

from survey.synthetic.camera import Lens, Panel, View, project
from survey.synthetic.shots import QueryShot, ShotOptions, SurveyShot, drive, visit
from survey.synthetic.street import UP, Facade, StreetPlan, lay_out
from survey.synthetic.styles import STYLES
from survey.synthetic.templates import TEMPLATES
from survey.synthetic.town import Town
from survey.synthetic.visibility import shares_seen

PLAN = StreetPlan()
OPTIONS = ShotOptions()


@pytest.fixture(scope="module")
def town() -> Town:
    return demo_town()


@pytest.fixture(scope="module")
def survey() -> tuple[SurveyShot, ...]:
    return drive(PLAN, OPTIONS, 0)


@pytest.fixture(scope="module")
def queries(town: Town) -> tuple[QueryShot, ...]:
    return visit(town, OPTIONS, 0)


def test_the_streets_are_600_m_long_and_lie_in_lambert_93() -> None:
    assert PLAN.length_m >= 600
    assert PLAN.crs == "EPSG:2154"
    for easting, northing in PLAN.corners:
        assert 640_000 < easting < 660_000
        assert 6_850_000 < northing < 6_870_000


@pytest.mark.parametrize("seed", [0, 1, 7])
def test_every_template_is_built_at_least_three_times(seed: int) -> None:
    built = Counter(facade.template.name for facade in lay_out(PLAN, seed))
    assert set(built) == {make.name for make in TEMPLATES}
    assert min(built.values()) >= 3


def test_names_are_unique_and_copies_of_a_template_are_not_alike(town: Town) -> None:
    assert len({house.facade.name for house in town.houses}) == len(town.houses)
    copies = [h.wall.levels[3] for h in town.houses if h.facade.template.name == "haussmann"]
    height = min(copy.shape[0] for copy in copies)
    width = min(copy.shape[1] for copy in copies)
    first, second = (copy[-height:, :width].astype(int) for copy in copies[:2])
    assert np.abs(first - second).mean() > 3


def test_houses_of_a_row_stand_wall_to_wall() -> None:
    rows: dict[tuple[int, bool], list[Facade]] = {}
    for facade in lay_out(PLAN, 0):
        rows.setdefault((facade.street, facade.inner), []).append(facade)
    assert len(rows) == 8
    for (_, inner), row in rows.items():
        for one, following in pairwise(row):
            meets = one.panel.point(one.panel.width_m if inner else 0, 0)
            starts = following.panel.point(0 if inner else following.panel.width_m, 0)
            assert np.linalg.norm(meets - starts) < 1e-6


def test_every_front_turns_to_the_middle_of_its_street() -> None:
    for facade in lay_out(PLAN, 0):
        start, end = PLAN.edges()[facade.street]
        ahead = (end - start) / np.linalg.norm(end - start)
        before = facade.middle[:2] + facade.outward[:2] * PLAN.width_m / 2 - start
        assert abs(ahead[0] * before[1] - ahead[1] * before[0]) < 1e-6


def test_a_camera_looking_north_has_east_on_its_right() -> None:
    view = View(100.0, 200.0, 10.0, 0.0, 0.0, 0.0, 90.0, 801, 601)
    ahead, right, above = project(
        view, np.array([[100.0, 210.0, 10.0], [110.0, 210.0, 10.0], [100.0, 210.0, 12.0]])
    )
    assert ahead == pytest.approx((400, 300))
    assert right == pytest.approx((400 + 400.5, 300))
    assert above[0] == pytest.approx(400)
    assert above[1] == pytest.approx(300 - 2 / 10 * 400.5)


def test_heading_90_looks_east_and_pitch_lifts_the_axis() -> None:
    view = View(0.0, 0.0, 0.0, 90.0, 30.0, 0.0, 60.0, 101, 101)
    on_axis = np.array([[np.cos(np.radians(30)), 0.0, np.sin(np.radians(30))]]) * 5
    assert project(view, on_axis)[0] == pytest.approx((50, 50))


def test_roll_lowers_the_right_side_so_that_the_horizon_rises_there() -> None:
    view = View(0.0, 0.0, 0.0, 0.0, 0.0, 10.0, 60.0, 101, 101)
    west, east = project(view, np.array([[-1.0, 5.0, 0.0], [1.0, 5.0, 0.0]]))
    assert east[1] < west[1]
    slope = np.degrees(np.arctan2(west[1] - east[1], east[0] - west[0]))
    assert slope == pytest.approx(10)


def test_what_lies_behind_is_not_projected() -> None:
    view = View(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 60.0, 101, 101)
    assert np.isnan(project(view, np.array([[0.0, -5.0, 0.0]]))).all()


def test_a_panel_behind_the_camera_has_no_outline_and_one_beside_it_is_clipped() -> None:
    lens = Lens.of(View(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 60.0, 101, 101))
    span = (0.0, 0.0, 20.0, 3.0)
    behind = Panel(np.array([-10.0, -4.0, 0.0]), np.array([1.0, 0, 0]), UP, 20.0, 3.0)
    assert len(lens.outline(lens.from_panel(behind), span)) == 0
    beside = Panel(np.array([2.0, -10.0, 0.0]), np.array([0, 1.0, 0]), UP, 20.0, 3.0)
    outline = lens.outline(lens.from_panel(beside), span)
    assert len(outline) == 4
    assert np.isfinite(outline).all()


def test_the_survey_has_150_images_every_few_metres(survey: tuple[SurveyShot, ...]) -> None:
    assert len(survey) >= 150
    assert len({shot.uri for shot in survey}) == len(survey)
    stops = {shot.stop: (shot.view.easting, shot.view.northing) for shot in survey}
    track = np.array([stops[stop] for stop in sorted(stops)])
    steps = np.linalg.norm(np.diff(track, axis=0), axis=1)
    assert steps.min() > 2
    assert steps.max() < 14
    assert {"blurred", "dark", ""} == {shot.wear for shot in survey}


def test_left_and_right_cameras_look_to_either_side_of_the_way(
    survey: tuple[SurveyShot, ...],
) -> None:
    headings = {shot.uri: shot.view.heading_deg for shot in survey}
    for uri, heading in headings.items():
        if uri.endswith("-left.jpg"):
            across = (headings[uri.replace("left", "right")] - heading) % 360
            assert across == pytest.approx(160)


def test_queries_stand_off_the_track_and_show_their_facade(
    town: Town, survey: tuple[SurveyShot, ...], queries: tuple[QueryShot, ...]
) -> None:
    assert len(queries) >= 20
    assert len({query.facade.name for query in queries}) == len(queries)
    assert len({query.facade.template.name for query in queries}) == len(TEMPLATES)
    cameras = np.array([(shot.view.easting, shot.view.northing) for shot in survey])
    for query in queries:
        apart = cameras - (query.view.easting, query.view.northing)
        assert np.linalg.norm(apart, axis=1).min() > 0.5
        seen = shares_seen(town, query.view)
        assert max(seen, key=lambda name: seen[name][0]) == query.facade.name


def test_styles_are_dealt_evenly(queries: tuple[QueryShot, ...]) -> None:
    counts = Counter(query.style for query in queries)
    assert set(counts) == set(STYLES)
    assert max(counts.values()) - min(counts.values()) <= 1


def test_every_style_takes_the_same_views_in_all_four_styles(
    town: Town, queries: tuple[QueryShot, ...]
) -> None:
    shots = visit(town, ShotOptions(n_queries=3, every_style=True), 0)
    names = [f"q{number:02d}-{style}.jpg" for number in (1, 2, 3) for style in STYLES]
    assert [shot.file for shot in shots] == names
    for shot in shots:
        assert shot.view == queries[shot.number - 1].view
        assert shot.facade is queries[shot.number - 1].facade
