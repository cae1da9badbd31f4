import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from contracts.config import North
from geo.headings import true_headings_deg, wrapped_180, wrapped_360


@pytest.mark.parametrize(
    ("heading", "north", "convergence", "declination", "expected"),
    [
        (90.0, "grid", -0.47, math.nan, 89.53),
        (0.1, "grid", -0.47, math.nan, 359.63),
        (359.9, "grid", 0.5, math.nan, 0.4),
        (90.0, "true", -0.47, math.nan, 90.0),
        (-90.0, "true", 0.0, math.nan, 270.0),
        (90.0, "magnetic", -0.47, 1.5, 91.5),
        (90.0, "magnetic", -0.47, math.nan, math.nan),
        (math.nan, "grid", -0.47, math.nan, math.nan),
    ],
)
def test_headings_turn_to_true_north(
    heading: float,
    north: North,
    convergence: float,
    declination: float,
    expected: float,
) -> None:
    found = true_headings_deg([heading], north, convergence, declination)
    np.testing.assert_allclose(found, [expected])


@given(st.floats(-1e6, 1e6))
def test_a_wrapped_angle_is_less_than_a_turn(angle_deg: float) -> None:
    assert 0.0 <= wrapped_360(angle_deg) < 360.0


def test_a_hair_left_of_north_is_north() -> None:
    assert wrapped_360(-1e-20) == 0.0


def test_many_headings_of_several_norths_turn_at_once() -> None:
    found = true_headings_deg(
        [10.0, 10.0, 10.0, math.nan, 359.9],
        ["true", "grid", "magnetic", "grid", "grid"],
        [1.0, 1.0, 1.0, 1.0, 0.2],
        [math.nan, math.nan, -3.0, 0.0, 0.0],
    )
    np.testing.assert_allclose(found, [10.0, 11.0, 7.0, math.nan, 0.1])


def test_an_unknown_declination_leaves_true_and_grid_headings_alone() -> None:
    assert true_headings_deg([5.0], "true", math.nan, math.nan).tolist() == [5.0]
    assert true_headings_deg([5.0], "grid", 1.0, math.nan).tolist() == [6.0]
    assert math.isnan(true_headings_deg([5.0], "magnetic", 1.0, math.nan)[0])


def test_no_headings_are_no_error() -> None:
    assert true_headings_deg([], "grid", [], []).shape == (0,)


@pytest.mark.parametrize(
    ("heading", "north", "convergence"),
    [([1.0, 2.0], "grid", [1.0]), ([1.0], ["grid", "true"], 0.0), (1.0, "grid", 0.0)],
)
def test_lengths_that_differ_are_refused(
    heading: list[float], north: North, convergence: float
) -> None:
    with pytest.raises(ValueError, match="headings, but norths"):
        true_headings_deg(heading, north, convergence, 0.0)


def test_an_unknown_north_is_refused() -> None:
    with pytest.raises(ValueError, match="'up'"):
        true_headings_deg([1.0], "up", 0.0, 0.0)  # type: ignore[arg-type]


@given(arrays(np.float64, 4, elements=st.floats(-1e6, 1e6) | st.just(math.nan)))
def test_angles_are_wrapped_alike_alone_and_together(angles: np.ndarray) -> None:
    np.testing.assert_array_equal(wrapped_360(angles), [wrapped_360(a) for a in angles.tolist()])
    np.testing.assert_array_equal(wrapped_180(angles), [wrapped_180(a) for a in angles.tolist()])
    known = wrapped_180(angles)[~np.isnan(angles)]
    assert ((known > -180.0) & (known <= 180.0)).all()
