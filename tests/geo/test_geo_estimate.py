import math
from itertools import product
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geo.crs import ToWgs84
from geo.estimate import REACH_M, consensus, consensus_lon_lat

Ranking = list[tuple[tuple[int, int], int]]

# Whole metres and powers of two: their sums are exact wherever they are moved.
places = st.tuples(st.integers(-200, 200), st.integers(-200, 200))
rankings = st.lists(st.tuples(places, st.integers(1, 16)), min_size=1, max_size=10)


def columns(ranking: Ranking) -> tuple[list[float], ...]:
    return (
        [float(x) for (x, _), _ in ranking],
        [float(y) for (_, y), _ in ranking],
        [float(score) for _, score in ranking],
    )


@given(rankings, st.randoms())
@settings(max_examples=60, deadline=None)
def test_the_order_of_the_matches_does_not_matter(ranking: Ranking, random: Random) -> None:
    shuffled = list(ranking)
    random.shuffle(shuffled)
    assert consensus(*columns(shuffled)) == consensus(*columns(ranking))


@given(rankings, st.integers(-(2**20), 2**20), st.integers(0, 2**23))
@settings(max_examples=60, deadline=None)
def test_moving_every_camera_moves_the_estimate(ranking: Ranking, east: int, north: int) -> None:
    x, y, score = columns(ranking)
    here = consensus(x, y, score)
    there = consensus([v + east for v in x], [v + north for v in y], score)
    assert here is not None
    assert there is not None
    assert there.easting - east == pytest.approx(here.easting, abs=1e-6)
    assert there.northing - north == pytest.approx(here.northing, abs=1e-6)
    assert (there.support, there.share) == (here.support, here.share)


@given(rankings)
@settings(max_examples=60, deadline=None)
def test_the_supporting_cameras_lie_within_reach_of_one_of_them(ranking: Ranking) -> None:
    x, y, score = columns(ranking)
    found = consensus(x, y, score)
    assert found is not None
    apart = np.hypot(np.array(x) - found.easting, np.array(y) - found.northing)
    assert (apart <= 2 * REACH_M).sum() >= found.support >= 1
    assert 0.0 < found.share <= 1.0


def test_scattered_wrong_matches_do_not_move_the_place() -> None:
    right = [(0.0, 0.0), (4.0, 0.0), (-4.0, 0.0), (0.0, 0.0)]
    wrong = [(900.0, 40.0), (-700.0, 300.0), (150.0, -800.0), (400.0, 400.0)]
    x, y = np.array([*right, *wrong]).T
    scores = np.linspace(1.0, 0.6, 8)
    found = consensus(x, y, scores)
    assert found is not None
    assert math.hypot(found.easting, found.northing) < 4.0
    assert found.support == 4
    weights = scores / np.arange(1, 9)
    assert found.share == pytest.approx(weights[:4].sum() / weights.sum())


def test_the_best_match_stands_against_two_that_agree_below_it() -> None:
    found = consensus([0.0, 500.0, 500.0], [0.0] * 3, [1.0, 0.9, 0.9])
    assert found is not None
    assert (found.easting, found.support) == (0.0, 1)
    assert found.share == pytest.approx(1.0 / (1.0 + 0.9 / 2 + 0.9 / 2))


def test_many_agreeing_matches_overrule_a_lone_best_one() -> None:
    found = consensus([0.0, *[500.0] * 6], [0.0] * 7, [1.0, *np.linspace(0.95, 0.9, 6)])
    assert found is not None
    assert (found.easting, found.support) == (500.0, 6)


def test_the_place_is_the_weighted_geometric_median() -> None:
    x, y = np.array([(0.0, 0.0), (12.0, 1.0), (3.0, 11.0), (-9.0, 5.0), (2.0, -10.0)]).T
    scores = np.array([1.0, 0.98, 0.97, 0.96, 0.95])
    weights = scores / np.arange(1, 6)
    found = consensus(x, y, scores)
    assert found is not None

    def cost(east: float, north: float) -> float:
        return float((weights * np.hypot(x - east, y - north)).sum())

    best = min(
        (cost(east, north), east, north)
        for east, north in product(np.linspace(-12, 12, 241), np.linspace(-12, 12, 241))
    )
    assert cost(found.easting, found.northing) <= best[0] + 1e-6
    assert (found.easting, found.northing) == pytest.approx(best[1:], abs=0.15)


def test_four_equal_matches_around_a_place_put_it_in_their_middle() -> None:
    found = consensus([0.0, 6.0, 0.0, 6.0], [0.0, 0.0, 6.0, 6.0], [1.0] * 4)
    assert found is not None
    assert (found.easting, found.northing) == pytest.approx((3.0, 3.0), abs=1e-4)


def test_matches_without_pose_keep_their_rank_but_have_no_place() -> None:
    nan = math.nan
    assert consensus([nan, nan], [nan, nan], [2.0, 1.0]) is None
    assert consensus([], [], []) is None
    found = consensus([nan, 5.0], [nan, 6.0], [2.0, 1.0])
    assert found is not None
    assert (found.easting, found.northing, found.support) == (5.0, 6.0, 1)


def test_scores_below_zero_support_only_where_none_is_above() -> None:
    found = consensus([0.0, 1.0], [0.0, 0.0], [1.0, -1.0])
    assert found is not None
    assert found.support == 1
    hopeless = consensus([0.0, 1.0], [0.0, 0.0], [-1.0, -2.0])
    assert hopeless is not None
    assert (hopeless.easting, hopeless.support) == (0.0, 2)


@pytest.mark.parametrize("scores", [[1.0], [1.0, math.nan], [1.0, math.inf]])
def test_a_wrong_score_is_refused(scores: list[float]) -> None:
    with pytest.raises(ValueError, match="finite score"):
        consensus([0.0, 1.0], [0.0, 1.0], scores)


def test_in_lon_lat_the_place_is_the_same_as_in_a_metric_grid() -> None:
    easting = 652000.0 + np.array([0.0, 6.0, 11.0, 400.0])
    northing = 6861000.0 + np.array([0.0, 5.0, -3.0, 90.0])
    scores = [1.0, 0.9, 0.8, 0.7]
    in_grid = consensus(easting, northing, scores)
    in_degrees = consensus_lon_lat(*ToWgs84("EPSG:2154").lon_lat(easting, northing), scores)
    assert in_grid is not None
    assert in_degrees is not None
    east, north = ToWgs84("EPSG:2154").from_lon_lat([in_degrees.lon_deg], [in_degrees.lat_deg])
    assert (east[0], north[0]) == pytest.approx((in_grid.easting, in_grid.northing), abs=0.01)
    assert in_degrees.share == pytest.approx(in_grid.share)
    assert in_degrees.support == in_grid.support == 3


def test_neighbours_across_longitude_180_agree() -> None:
    found = consensus_lon_lat([179.99999, -179.99999], [-17.0, -17.0], [1.0, 0.9])
    assert found is not None
    assert found.support == 2
    assert abs(abs(found.lon_deg) - 180.0) < 2e-5


def test_no_pose_in_lon_lat_is_no_estimate() -> None:
    assert consensus_lon_lat([math.nan], [math.nan], [1.0]) is None
