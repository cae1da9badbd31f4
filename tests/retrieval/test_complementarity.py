"""Complementarity on point sets whose scores are known, and against plain double loops."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from contracts.records import Frames
from retrieval.complementarity import (
    Complementarity,
    all_pairs,
    cluster_purity,
    complementarity,
    contribution,
    spread,
)


def frames(points: list[tuple[float, float]] | NDArray[np.float64]) -> Frames:
    xy = np.asarray(points, dtype=np.float32).reshape(-1, 2)
    shape = np.broadcast_to(np.eye(2, dtype=np.float32), (len(xy), 2, 2))
    return Frames(xy, shape, np.arange(len(xy), 0, -1, dtype=np.float32))


def array(*points: tuple[float, float]) -> NDArray[np.float64]:
    return np.array(points, dtype=np.float64)


def scattered(n: int, seed: int) -> NDArray[np.float64]:
    return np.random.default_rng(seed).uniform(0, 300, (n, 2))


def test_two_points_are_spread_by_their_distance() -> None:
    assert spread(array((0, 0), (30, 40)), 500) == pytest.approx(0.1)


def test_an_equilateral_triangle_is_spread_by_its_side() -> None:
    assert spread(array((0, 0), (10, 0), (5, 75**0.5)), 100) == pytest.approx(0.1)


def test_spread_is_the_harmonic_mean_over_points_of_harmonic_mean_distances() -> None:
    points = scattered(60, 1)
    means = []
    for i, p in enumerate(points):
        others = [math.dist(p, q) / 500 for j, q in enumerate(points) if j != i]
        means.append(len(others) / sum(1 / d for d in others))
    assert spread(points, 500) == pytest.approx(len(means) / sum(1 / m for m in means), rel=1e-5)


def test_points_within_a_pixel_count_once() -> None:
    lone = spread(array((0, 0), (30, 40)), 500)
    assert spread(array((30, 40), (0, 0), (0.6, 0.7), (0, 0)), 500) == pytest.approx(lone)
    assert spread(array((5, 5), (5.5, 5.5)), 500) == 0.0


def test_a_sample_of_many_points_is_spread_like_all_of_them() -> None:
    columns, rows = np.meshgrid(np.arange(0, 1000, 16.0), np.arange(0, 600, 16.0))
    grid = np.stack([columns.ravel(), rows.ravel()], axis=1)
    distances = np.hypot(*(grid[:, None] - grid[None]).transpose(2, 0, 1))
    np.fill_diagonal(distances, np.inf)
    everything = len(grid) * (len(grid) - 1) / (1 / distances).sum()
    assert spread(grid, 1.0) == pytest.approx(everything, rel=0.02)


def test_contribution_is_the_share_of_points_found_by_one_only() -> None:
    a, b = array((0, 0), (50, 50)), array((3, 0), (90, 90), (200, 10))
    assert contribution(a, b, 3.0) == pytest.approx(3 / 5)
    assert contribution(a, b, 2.9) == 1.0
    assert contribution(a, a, 3.0) == 0.0


def test_contribution_equals_comparing_everyone_with_everyone() -> None:
    a, b = scattered(150, 2), scattered(120, 3)
    alone = sum(all(math.dist(p, q) > 9 for q in b) for p in a)
    alone += sum(all(math.dist(p, q) > 9 for q in a) for p in b)
    assert 0 < alone < 270
    assert contribution(a, b, 9.0) == pytest.approx(alone / 270)


def test_clusters_of_one_detector_are_pure_and_evenly_shared_ones_are_not() -> None:
    left, right = array((0, 0), (1, 0)), array((100, 0), (101, 0))
    assert cluster_purity(left, right, 10) == 1.0
    assert cluster_purity(left, left + 0.5, 10) == pytest.approx(0.0)
    mixed = cluster_purity(array((0, 0), (1, 0), (2, 0)), array((3, 0), (100, 0)), 10)
    entropy = -(0.75 * math.log2(0.75) + 0.25 * math.log2(0.25))
    assert mixed == pytest.approx(1 - entropy * 4 / 5)


def test_a_point_joins_the_nearest_leader_and_chains_do_not_merge() -> None:
    # 0 and 12 lead, 12 apart; 8 is within 10 of both and joins 12.
    assert cluster_purity(array((0, 0), (8, 0)), array((12, 0)), 10) == pytest.approx(1 / 3)


def test_features_of_a_pair_put_together() -> None:
    a, b = frames([(0, 0), (300, 400)]), frames([(2, 0)])
    got = complementarity(a, b, 300, 400)
    near_px = 3 * 400 / 1024
    assert near_px < 2
    inverse = 500 / 500 + 500 / 2 + 500 / math.dist((2, 0), (300, 400))
    assert got.kp_thousands == 0.003
    assert got.csdi == pytest.approx(6 / (2 * inverse), rel=1e-5)
    assert got.csco == 1.0
    assert got.cscl == pytest.approx(1 - 2 / 3)
    assert got.as_tuple() == (got.kp_thousands, got.csdi, got.csco, got.cscl)


def test_near_is_three_pixels_of_an_image_1024_wide() -> None:
    a, b = frames([(0, 0)]), frames([(5, 0)])
    assert complementarity(a, b, 1024, 768).csco == 1.0
    assert complementarity(a, b, 2048, 768).csco == 0.0


def test_an_empty_set_complements_nothing() -> None:
    some, none = frames([(0, 0), (30, 40)]), frames([])
    got = complementarity(some, none, 300, 400)
    assert (got.csco, got.cscl) == (0.0, 0.0)
    assert got.csdi == pytest.approx(0.1)
    assert complementarity(none, none, 300, 400) == Complementarity(0.0, 0.0, 0.0, 0.0)
    assert complementarity(frames([(1, 1)]), none, 300, 400).csdi == 0.0


def test_identical_sets_add_nothing_to_each_other() -> None:
    points = frames([(0, 0), (60, 0), (0, 80)])
    got = complementarity(points, points, 300, 400)
    inverse = 500 / 60 + 500 / 80 + 500 / 100
    assert got.csdi == pytest.approx(6 / (2 * inverse), rel=1e-5)  # each point counts once
    assert (got.kp_thousands, got.csco) == (0.006, 0.0)
    assert got.cscl == pytest.approx(0.0)


def test_disjoint_halves_add_everything() -> None:
    left = frames([(x, y) for x in (0, 50, 100) for y in (0, 100)])
    right = frames([(x, y) for x in (200, 250, 300) for y in (0, 100)])
    got = complementarity(left, right, 300, 400)
    assert (got.csco, got.cscl) == (1.0, 1.0)
    alone = complementarity(left, left, 300, 400)
    assert got.csdi > alone.csdi


def test_a_clump_is_little_spread_and_one_cluster() -> None:
    clump = frames([(100, 100), (102, 100), (100, 102), (102, 102)])
    wide = frames([(0, 0), (300, 0), (0, 400), (300, 400)])
    assert complementarity(clump, clump, 300, 400).csdi < 0.01
    together = complementarity(clump, wide, 300, 400)
    assert (together.csco, together.cscl) == (1.0, 1.0)  # five clusters, each of one detector
    mixed = frames([(101, 101), (101, 103), (103, 101), (99, 99)])
    assert complementarity(clump, mixed, 300, 400).cscl == pytest.approx(0.0)


def test_the_order_of_a_pair_does_not_matter() -> None:
    a, b = frames(scattered(90, 4)), frames(scattered(70, 5))
    assert complementarity(a, b, 300, 300) == complementarity(b, a, 300, 300)


def test_all_pairs_are_scored_in_the_order_of_the_detectors() -> None:
    sets = {"hesaff": scattered(20, 6), "star": scattered(30, 7), "orb": scattered(9, 8)}
    found = {name: frames(points) for name, points in sets.items()}
    pairs = all_pairs(found, 300, 300)  # type: ignore[arg-type]
    assert list(pairs) == [("hesaff", "star"), ("hesaff", "orb"), ("star", "orb")]
    expected = complementarity(found["hesaff"], found["orb"], 300, 300)
    assert pairs["hesaff", "orb"] == expected
