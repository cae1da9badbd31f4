import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from geo.attitude import Attitude, camera_attitude, enu_from_frd, enu_from_rdf, is_rotation

angles = st.floats(-720.0, 720.0)


def test_a_level_vehicle_heading_east_looks_east_with_south_on_its_right() -> None:
    forward, right, down = enu_from_frd(Attitude(90.0, 0.0, 0.0)).T
    np.testing.assert_allclose(forward, [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(right, [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(down, [0, 0, -1], atol=1e-12)


def test_positive_pitch_raises_the_nose() -> None:
    forward = enu_from_frd(Attitude(0.0, 30.0, 0.0))[:, 0]
    np.testing.assert_allclose(forward, [0, math.sqrt(3) / 2, 0.5], atol=1e-12)


def test_positive_roll_lowers_the_right_side_and_keeps_the_nose() -> None:
    forward, right, _ = enu_from_frd(Attitude(0.0, 0.0, 30.0)).T
    np.testing.assert_allclose(forward, [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(right, [math.sqrt(3) / 2, 0, -0.5], atol=1e-12)


def test_pitch_is_applied_about_the_turned_vehicle_and_roll_last() -> None:
    forward, right, _ = enu_from_frd(Attitude(90.0, 90.0, 90.0)).T
    np.testing.assert_allclose(forward, [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(right, [1, 0, 0], atol=1e-12)


def test_a_camera_is_a_body_that_looks_forward() -> None:
    attitude = Attitude(33.0, -12.0, 7.0)
    forward, right, down = enu_from_frd(attitude).T
    np.testing.assert_allclose(enu_from_rdf(attitude).T, [right, down, forward])


@given(angles, st.floats(-89.9, 89.9), angles)
def test_a_camera_attitude_survives_its_rotation(heading: float, pitch: float, roll: float) -> None:
    rotation = enu_from_rdf(Attitude(heading, pitch, roll))
    found = camera_attitude(rotation)
    assert 0.0 <= found.heading_deg < 360.0
    assert -180.0 < found.roll_deg <= 180.0
    assert found.pitch_deg == pytest.approx(pitch, abs=1e-6)
    np.testing.assert_allclose(enu_from_rdf(found), rotation, atol=1e-9)


@pytest.mark.parametrize("pitch", [90.0, -90.0])
def test_at_the_zenith_roll_is_zero_and_the_rotation_is_kept(pitch: float) -> None:
    rotation = enu_from_rdf(Attitude(40.0, pitch, 0.0))
    found = camera_attitude(rotation)
    assert found.heading_deg == pytest.approx(40.0)
    assert found.roll_deg == 0.0
    np.testing.assert_allclose(enu_from_rdf(found), rotation, atol=1e-9)


@pytest.mark.parametrize(
    "matrix", [np.diag([1.0, 1.0, -1.0]), 2 * np.eye(3), np.full((3, 3), np.nan), np.eye(2)]
)
def test_what_is_no_rotation_is_refused(matrix: np.ndarray) -> None:
    with pytest.raises(ValueError, match="rotation"):
        camera_attitude(matrix)


def test_a_mirror_is_no_rotation() -> None:
    assert is_rotation(np.eye(3))
    assert not is_rotation(np.diag([-1.0, 1.0, 1.0]))
