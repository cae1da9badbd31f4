import pytest
from hypothesis import given
from hypothesis import strategies as st

from contracts.config import North
from geo.headings import true_heading_deg, wrapped_360


@pytest.mark.parametrize(
    ("heading", "north", "convergence", "declination", "expected"),
    [
        (90.0, "grid", -0.47, None, 89.53),
        (0.1, "grid", -0.47, None, 359.63),
        (359.9, "grid", 0.5, None, 0.4),
        (90.0, "true", -0.47, None, 90.0),
        (-90.0, "true", 0.0, None, 270.0),
        (90.0, "magnetic", -0.47, 1.5, 91.5),
        (90.0, "magnetic", -0.47, None, None),
        (None, "grid", -0.47, None, None),
    ],
)
def test_headings_turn_to_true_north(
    heading: float | None,
    north: North,
    convergence: float,
    declination: float | None,
    expected: float | None,
) -> None:
    found = true_heading_deg(heading, north, convergence, declination)
    assert found == (None if expected is None else pytest.approx(expected))


@given(st.floats(-1e6, 1e6))
def test_a_wrapped_angle_is_less_than_a_turn(angle_deg: float) -> None:
    assert 0.0 <= wrapped_360(angle_deg) < 360.0


def test_a_hair_left_of_north_is_north() -> None:
    assert wrapped_360(-1e-20) == 0.0
