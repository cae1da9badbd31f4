"""Matches become features on the map, and what they say together."""

import math
from dataclasses import replace

import numpy as np
import pytest

from contracts.config import SearchConfig, Where
from contracts.records import Match
from geo.confidence import DENSITY
from geo.crs import ToWgs84
from geo.frames import LocalMetres
from geo.magnetic import declination_deg
from index.catalogue import CatalogueRow
from index.models import placing_model
from index.opened import OpenedIndex
from retrieval.fusion import Scores, rank
from workers.stages.place import Finding, find, finding_features, place
from workers.stages.retrieve import Chosen
from workers.stages.spots import Ground, ground_of, spots_of

CHOSEN = Chosen((("hesaff", "star"),), 2, None, "given")
N_IMAGES = 200


@pytest.fixture
def ground(small_index: OpenedIndex) -> Ground:
    found = ground_of(small_index)
    assert found is not None
    return found


@pytest.fixture
def rows(small_index: OpenedIndex) -> list[CatalogueRow]:
    """Ten cameras 4 m apart, all heading 90 degrees from grid north."""
    return small_index.catalogue.rows(range(10))


def scores_of(values: list[float]) -> Scores:
    array = np.array(values)
    return Scores(array, array > 0)


def ranked(second: float) -> tuple[list[Match], Scores]:
    """A ranking of the ten cameras among many unrelated images; the first scores 1."""
    others = np.random.default_rng(1).uniform(0.0, 0.9 * second, N_IMAGES - 10)
    scores = scores_of([1.0, *np.linspace(second, 0.95 * second, 9), *others])
    return list(rank(scores, 10)), scores


def kinds(features: list) -> list[str]:
    return [feature["properties"]["kind"] for feature in features]


def test_the_first_matches_come_first_and_the_estimate_after_them(
    small_index: OpenedIndex,
) -> None:
    scores = scores_of([10.0, 9.0, 8.0, 7.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
    found = place(small_index, "q.jpg", CHOSEN, rank(scores, 10), SearchConfig(top=3), scores)
    assert kinds(found) == ["match", "match", "match", "estimate"]
    estimate = found[-1]["properties"]
    assert 0.0 < estimate["radius_m"] <= estimate["radius_95_m"]
    # Ten images have no bulk that a match could stand out from.
    assert (estimate["confidence"], estimate["in_survey"]) == (None, None)


def test_the_estimate_stands_between_the_cameras_that_agree(small_index: OpenedIndex) -> None:
    scores = scores_of([10.0, 10.0, *[0.1] * 8])
    found = place(small_index, "q.jpg", CHOSEN, rank(scores, 10), SearchConfig(top=1), scores)
    lon, lat = found[-1]["geometry"]["coordinates"][:2]
    east, north = ToWgs84("EPSG:2154").from_lon_lat([lon], [lat])
    assert 652000.0 <= east[0] <= 652004.1
    assert north[0] == pytest.approx(6862000.0, abs=0.02)


def test_a_grid_heading_is_turned_by_the_convergence(
    rows: list[CatalogueRow], ground: Ground
) -> None:
    # Lambert-93: convergence = (lon - 3 degrees) * 0.7256077650532670.
    spots = spots_of(rows, ground)
    assert spots.heading_deg == pytest.approx(
        90.0 + (spots.lon_deg - 3.0) * 0.72560776505, abs=1e-5
    )


def test_each_row_is_turned_from_its_own_north(rows: list[CatalogueRow], ground: Ground) -> None:
    mixed = [replace(rows[0], north="true"), replace(rows[1], north="magnetic"), rows[2]]
    spots = spots_of(mixed, ground)
    day = declination_deg(spots.lon_deg[1:2], spots.lat_deg[1:2], [0.0], [2020.33])
    assert spots.heading_deg[0] == 90.0
    assert spots.heading_deg[1] == pytest.approx(90.0 + float(day[0]), abs=0.05)
    assert spots.heading_deg[2] == pytest.approx(89.53, abs=0.02)


def test_a_magnetic_heading_of_an_unknown_day_is_not_known(
    rows: list[CatalogueRow], ground: Ground
) -> None:
    undated = replace(rows[0], north="magnetic", captured_at=None)
    assert math.isnan(spots_of([undated], ground).heading_deg[0])


def test_a_row_without_pose_has_no_place(rows: list[CatalogueRow], ground: Ground) -> None:
    lost = replace(rows[0], easting=None, northing=None, altitude_m=None, heading_deg=None)
    spots = spots_of([lost, rows[1]], ground)
    assert np.isnan(spots.lon_deg[0])
    assert np.isfinite(spots.lon_deg[1])


def test_a_height_is_known_only_where_the_survey_says_from_what_it_counts(
    rows: list[CatalogueRow], ground: Ground
) -> None:
    assert np.isnan(spots_of(rows, ground).height_m).all()
    in_space = Ground(ToWgs84("EPSG:4979"), ground.lon_deg, ground.lat_deg)
    high = replace(rows[0], easting=2.3, northing=48.8, altitude_m=81.5)
    assert spots_of([high], in_space).height_m[0] == pytest.approx(81.5, abs=1e-6)


def test_an_answer_that_stands_out_is_of_the_survey_and_a_flat_one_is_not(
    rows: list[CatalogueRow], ground: Ground
) -> None:
    clear, flat = (found_in(rows, ground, second) for second in (0.3, 0.99))
    sure, unsure = (
        placing_model().certainty(each.evidence, each.distances_m) for each in (clear, flat)
    )
    assert (sure.in_survey, unsure.in_survey) == (True, False)


def test_what_cameras_around_a_square_see_is_the_target(
    rows: list[CatalogueRow], ground: Ground
) -> None:
    around = facing(rows, (652100.0, 6862100.0), derived=False)
    found = found_in(around, ground)
    assert found.target is not None
    lon, lat = ToWgs84("EPSG:2154").lon_lat([652100.0], [6862100.0])
    off = LocalMetres(float(lon[0]), float(lat[0])).from_lon_lat(
        [found.target.lon_deg], [found.target.lat_deg]
    )
    assert np.hypot(*off)[0] < 0.5
    assert found.target.support == 10


def test_a_photo_of_elsewhere_gets_no_target(rows: list[CatalogueRow], ground: Ground) -> None:
    around = facing(rows, (652100.0, 6862100.0), derived=False)
    clear, flat = (
        finding_features("q.jpg", CHOSEN, found_in(around, ground, second))
        for second in (0.3, 0.99)
    )
    assert kinds(clear) == ["estimate", "target"]
    assert kinds(flat) == ["estimate"]


def test_a_heading_derived_from_the_track_is_no_line_of_sight(
    rows: list[CatalogueRow], ground: Ground
) -> None:
    around = facing(rows, (652100.0, 6862100.0), derived=True)
    found = found_in(around, ground)
    assert found.target is None


def test_the_stated_error_of_positions_widens_the_radii(
    rows: list[CatalogueRow], ground: Ground
) -> None:
    rough = [replace(row, position_error_m=15.0) for row in rows]
    found = found_in(rough, ground)
    assert found.position_error_m == 15.0


def test_the_ground_of_a_search_is_that_of_its_candidates(small_index: OpenedIndex) -> None:
    everywhere = ground_of(small_index)
    east = ground_of(small_index, Where(uris=("0[89].jpg",)))
    assert everywhere is not None
    assert east is not None
    np.testing.assert_array_equal(east.lon_deg, everywhere.lon_deg[8:])
    assert ground_of(small_index, Where(since="2021")) is None


def facing(
    rows: list[CatalogueRow], square: tuple[float, float], *, derived: bool
) -> list[CatalogueRow]:
    """The rows moved around a place, 40 m from it, looking at its middle."""
    turns = np.arange(len(rows)) * 36.0
    return [
        replace(
            row,
            easting=square[0] + 40.0 * math.sin(math.radians(turn)),
            northing=square[1] + 40.0 * math.cos(math.radians(turn)),
            heading_deg=(turn + 180.0) % 360.0,
            hfov_deg=60.0,
            heading_derived=derived,
        )
        for row, turn in zip(rows, turns, strict=True)
    ]


def found_in(rows: list[CatalogueRow], ground: Ground, second: float = 0.3) -> Finding:
    """What the ten rows say together as the first of a ranking."""
    matches, scores = ranked(second)
    found = find(matches, rows, spots_of(rows, ground), ground, scores, DENSITY)
    assert found is not None
    return found
