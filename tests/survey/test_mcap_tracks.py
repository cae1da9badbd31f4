"""Interpolation and the tree of frames, against slow and obvious ways."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from survey.mcap.frames import FrameTree, frame_tree
from survey.mcap.levers import moved_by
from survey.mcap.tracks import Asked, Rigid, Samples, bracket, rigid_at, values_at

T0 = 1_700_000_000_000_000_000
TIMES = st.lists(st.integers(0, 10**10), min_size=1, max_size=20)


def samples(times: list[int], rng: np.random.Generator) -> Samples:
    found = Samples(7)
    for time in times:
        turn = Rotation.random(rng=rng).as_quat()
        found.add(T0 + time, (*rng.normal(0, 100, 3), *turn))
    return found


@given(TIMES, TIMES, st.floats(0.0, 5.0), st.integers(0, 99))
@settings(max_examples=150, deadline=None)
def test_between_messages_positions_are_linear_and_rotations_slerp(times, at, max_gap_s, seed):
    track = samples(times, np.random.default_rng(seed)).track()
    found = rigid_at(track, Asked(T0 + np.array(at, np.int64), max_gap_s))
    known = (track.times_ns - T0).tolist()
    for number, moment in enumerate(at):
        before = [time for time in known if time <= moment]
        after = [time for time in known if time >= moment]
        reach = bool(before and after) and (min(after) - max(before)) / 1e9 <= max_gap_s
        assert np.isfinite(found.position[number]).all() == reach
        assert np.isfinite(found.rotation[number]).all() == reach
        if not reach:
            continue
        first, second = known.index(max(before)), known.index(min(after))
        for axis in range(3):
            meant = np.interp(moment, known, track.values[:, axis])
            assert found.position[number, axis] == pytest.approx(meant, abs=1e-6)
        turns = Rotation.from_quat(track.values[[first, second], 3:])
        meant_turn = turns[0]
        if first != second:
            meant_turn = Slerp([known[first], known[second]], turns)(moment)
        off = (meant_turn.inv() * Rotation.from_matrix(found.rotation[number])).magnitude()
        assert off < 1e-6


def test_of_repeated_moments_the_first_message_counts():
    found = Samples(1)
    for time, value in ((5, 1.0), (3, 2.0), (5, 3.0), (3, 4.0)):
        found.add(time, (value,))
    track = found.track()
    assert track.times_ns.tolist() == [3, 5]
    assert track.values.ravel().tolist() == [2.0, 1.0]


def test_a_gap_is_told_in_seconds():
    found = Samples(1)
    for time in (0, 10):
        found.add(T0 + time * 10**9, (float(time),))
    around = bracket(found.track().times_ns, Asked(T0 + np.array([4, -1, 11, 10]) * 10**9, 5.0))
    assert around.gap_s.tolist() == [10.0, np.inf, np.inf, 0.0]
    assert around.within.tolist() == [False, False, False, True]
    assert np.isnan(values_at(found.track(), around)[:3]).all()


@given(st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=12))
@settings(max_examples=200, deadline=None)
def test_any_graph_of_frames_ends_and_joins_both_ways(edges):
    rng = np.random.default_rng(1)
    transforms = {(str(child), str(parent)): samples([0], rng) for child, parent in edges}
    tree = frame_tree(transforms, set())
    asked = Asked(np.array([T0]), 1.0)
    for outer in map(str, range(7)):
        for inner in map(str, range(7)):
            there, back = tree.between(outer, inner, asked), tree.between(inner, outer, asked)
            assert (there is None) == (back is None)
            if there is not None and back is not None:
                round_trip = there.after(back)
                np.testing.assert_allclose(round_trip.rotation[0], np.eye(3), atol=1e-9)
                np.testing.assert_allclose(round_trip.position[0], 0.0, atol=1e-6)


def test_a_chain_of_frames_is_the_product_of_its_transforms():
    rng = np.random.default_rng(2)
    names = ["map", "odom", "base", "camera"]
    transforms = {(child, parent): samples([0], rng) for parent, child in itertools.pairwise(names)}
    found = frame_tree(transforms, set()).between("map", "camera", Asked(np.array([T0]), 1.0))
    meant = np.eye(4)
    for moved in transforms.values():
        step = np.eye(4)
        values = moved.track().values[0]
        step[:3, :3], step[:3, 3] = Rotation.from_quat(values[3:]).as_matrix(), values[:3]
        meant = meant @ step
    assert found is not None
    np.testing.assert_allclose(found.rotation[0], meant[:3, :3], atol=1e-12)
    np.testing.assert_allclose(found.position[0], meant[:3, 3], atol=1e-9)


def test_frames_that_nothing_joins_are_not_joined():
    assert FrameTree({}).between("a", "b", Asked(np.array([T0]), 1.0)) is None


def test_a_child_of_two_parents_keeps_the_one_stated_most_often():
    rng = np.random.default_rng(3)
    transforms = {("c", "rare"): samples([0], rng), ("c", "often"): samples([0, 1, 2], rng)}
    assert frame_tree(transforms, set()).chain("c") == ("c", "often")


def test_an_unknown_turn_does_not_lose_a_place_without_a_lever():
    unknown = Rigid(np.full((1, 3, 3), np.nan), np.array([[1.0, 2.0, 3.0]]))
    mounted = Rigid(np.eye(3)[None], np.zeros((1, 3)))
    assert unknown.after(mounted).position.tolist() == [[1.0, 2.0, 3.0]]


def test_a_lever_arm_is_metres_on_the_ellipsoid():
    place = np.array([[2.35, 48.85, 80.0], [2.35, 48.85, np.nan], [2.35, 48.85, 80.0]])
    offset = np.array([[0.0, 111.2, 1.0], [0.0, 0.0, 2.0], [np.nan, 0.0, 0.0]])
    moved = moved_by(place, offset)
    # One degree of latitude at 48.85 N is 111 207 m (IAU/GRS 80 meridian, 111 132.95 - 559.8 cos
    # 2 lat + 1.2 cos 4 lat).
    assert moved[0, 1] - 48.85 == pytest.approx(111.2 / 111207.0, rel=1e-4)
    assert moved[0, 2] == 81.0
    assert np.isnan(moved[1, 2])
    assert moved[2].tolist() == place[2].tolist()
