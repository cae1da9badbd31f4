"""Where lines of sight meet, and where they do not."""

import math
from dataclasses import astuple
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from geo.frames import LocalMetres
from geo.sightlines import LonLatTarget, target_lon_lat

PANTHEON = LocalMetres(2.3461, 48.8462)
AROUND = [(0, 80), (40, 60), (95, 110), (150, 70), (200, 90), (260, 50), (320, 120)]
"""Bearing from the Pantheon in degrees, and distance in metres, of seven cameras."""

TURNED = (5, -8, 3, 9, -4, 6, -10)
"""Degrees by which each looks past it."""

Mark = tuple[float, float, float, float]
"""x east, y north in metres from the Pantheon, heading and field of view in degrees."""


def looking_at_it(bearing: float, distance: float, off_axis: float = 0.0) -> Mark:
    east = distance * math.sin(math.radians(bearing))
    north = distance * math.cos(math.radians(bearing))
    return east, north, (bearing + 180.0 + off_axis) % 360.0, 60.0


def met(
    marks: list[Mark], scores: list[float], frame: LocalMetres = PANTHEON
) -> LonLatTarget | None:
    east, north, heading, hfov = np.array(marks).T
    return target_lon_lat(*frame.to_lon_lat(east, north), heading, hfov, scores)


def metres_off(found: LonLatTarget | None, frame: LocalMetres = PANTHEON) -> float:
    assert found is not None
    return float(np.hypot(*frame.from_lon_lat([found.lon_deg], [found.lat_deg]))[0])


def test_seven_of_ten_marks_around_the_pantheon_give_the_pantheon() -> None:
    right = [looking_at_it(*mark, off) for mark, off in zip(AROUND, TURNED, strict=True)]
    wrong = [(-240.0, 200.0, 300.0, 60.0), (220.0, -210.0, 120.0, 60.0), (10.0, 250.0, 0.0, 60.0)]
    marks = [right[0], wrong[0], *right[1:3], wrong[1], *right[3:], wrong[2]]
    found = met(marks, np.linspace(1.0, 0.6, 10).tolist())
    assert metres_off(found) < 12.0
    assert found is not None
    assert found.support == 7
    assert found.radius_m < 40.0


def test_cameras_that_look_straight_at_it_are_right_to_the_centimetre() -> None:
    found = met([looking_at_it(*mark) for mark in AROUND], [1.0] * 7)
    assert metres_off(found) < 0.01


@given(st.lists(st.integers(-250, 250), min_size=4, max_size=4), st.integers(0, 359))
@settings(max_examples=40, deadline=None)
def test_a_wrong_minority_does_not_move_it_out_of_its_radius(place: list[int], turn: int) -> None:
    right = [looking_at_it(*mark) for mark in AROUND]
    wrong = [
        (float(place[0]), float(place[1]), float(turn), 60.0),
        (float(place[2]), float(place[3]), float(turn * 7 % 360), 60.0),
    ]
    found = met([*right, *wrong], [1.0] * 9)
    assert found is not None
    assert metres_off(found) < found.radius_m
    assert found.support >= 7


@given(st.randoms(), st.lists(st.floats(-20, 20), min_size=7, max_size=7))
@settings(max_examples=40, deadline=None)
def test_the_order_of_the_lines_does_not_matter(random: Random, off: list[float]) -> None:
    marks = [looking_at_it(*mark, turn) for mark, turn in zip(AROUND, off, strict=True)]
    pairs = list(zip(marks, np.linspace(1.0, 0.4, 7).tolist(), strict=True))
    shuffled = list(pairs)
    random.shuffle(shuffled)
    here, there = (met([m for m, _ in each], [s for _, s in each]) for each in (pairs, shuffled))
    assert here == there


def test_parallel_lines_give_no_target() -> None:
    street = [(8.0 * n, 0.0, 0.0, 82.0) for n in range(10)]
    assert met(street, [1.0] * 10) is None


def test_nearly_parallel_lines_give_no_target() -> None:
    street = [(8.0 * n, 0.0, (1.5 - n) % 360.0, 82.0) for n in range(4)]
    assert met(street, [1.0] * 4) is None


def test_cameras_that_face_each_other_do_not_tell_where_between() -> None:
    faced = [(8.0 * n, 0.0, 90.0, 60.0) for n in range(3)]
    faced += [(60.0 + 8.0 * n, 0.0, 270.0, 60.0) for n in range(3)]
    assert met(faced, [1.0] * 6) is None


def test_lines_that_meet_behind_the_cameras_give_no_target() -> None:
    away = [
        (x, y, (heading + 180.0) % 360.0, hfov)
        for x, y, heading, hfov in (looking_at_it(*mark) for mark in AROUND[:3])
    ]
    assert met(away, [1.0] * 3) is None


def test_several_cameras_of_one_place_give_no_target() -> None:
    assert met([(0.0, 0.0, turn, 60.0) for turn in (0.0, 30.0, 350.0)], [1.0] * 3) is None


def test_two_lines_are_not_enough() -> None:
    assert met([looking_at_it(*mark) for mark in AROUND[:2]], [1.0, 1.0]) is None


def test_a_match_without_heading_or_with_a_view_all_round_gives_no_line() -> None:
    marks = [looking_at_it(*mark) for mark in AROUND[:3]]
    blind = [(50.0, 50.0, math.nan, 60.0), (-50.0, 40.0, 17.0, 360.0)]
    scores = [1.0, 0.9, 0.8]
    # Ranks below the three that see it, so that their weights stay what they are.
    assert met([*marks, *blind], [*scores, 0.5, 0.4]) == met(marks, scores)
    assert met([*marks[:2], *blind], [1.0] * 4) is None


def test_an_unknown_field_of_view_is_that_of_an_ordinary_lens() -> None:
    marks = [looking_at_it(*mark, 5.0) for mark in AROUND]
    unknown = [(x, y, heading, math.nan) for x, y, heading, _ in marks]
    assert met(unknown, [1.0] * 7) == met(marks, [1.0] * 7)


@pytest.mark.parametrize("centre", [(180.0, -17.0), (-179.9999, 65.0), (25.0, 89.99)])
def test_it_is_the_same_across_longitude_180_and_near_the_pole(
    centre: tuple[float, float],
) -> None:
    frame = LocalMetres(*centre)
    marks = [looking_at_it(*mark) for mark in AROUND]
    east, north, heading, hfov = np.array(marks).T
    lon, lat = frame.to_lon_lat(east, north)
    # A heading is clockwise from the meridian of its own camera.
    ahead = frame.to_lon_lat(
        east + np.sin(np.radians(heading)), north + np.cos(np.radians(heading))
    )
    own = [
        math.degrees(math.atan2(*(part[0] for part in LocalMetres(x, y).from_lon_lat([a], [b]))))
        for x, y, a, b in zip(lon, lat, *ahead, strict=True)
    ]
    found = target_lon_lat(lon, lat, own, hfov, [1.0] * 7)
    assert metres_off(found, frame) < 0.1


def test_a_wrong_score_is_refused() -> None:
    with pytest.raises(ValueError, match="finite score"):
        target_lon_lat([0.0], [0.0], [0.0], [60.0], [math.nan])


def test_the_radius_grows_with_the_distance() -> None:
    near, far = (
        met([looking_at_it(bearing, distance) for bearing in (0, 60, 120, 200)], [1.0] * 4)
        for distance in (20.0, 60.0)
    )
    assert near is not None
    assert far is not None
    assert astuple(near)[2] == pytest.approx(astuple(far)[2] / 3, rel=1e-3)
