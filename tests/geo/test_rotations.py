import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from geo.rotations import (
    FRD_FROM_RDF,
    PHOTOGRAMMETRIC_FROM_RDF,
    are_rotations,
    hpr_from_rotations,
    interpolated,
    rotations_from_hpr,
    rotations_from_opk,
    rotations_from_quaternions,
)

angles = arrays(np.float64, 5, elements=st.floats(-720.0, 720.0))
pitches = arrays(np.float64, 5, elements=st.floats(-89.9, 89.9))
quaternions = arrays(np.float64, (4, 5), elements=st.floats(-1.0, 1.0))


@given(angles, pitches, angles)
def test_heading_pitch_and_roll_survive_their_matrices(
    heading: np.ndarray, pitch: np.ndarray, roll: np.ndarray
) -> None:
    rotations = rotations_from_hpr(heading, pitch, roll)
    found = hpr_from_rotations(rotations)
    assert ((found[0] >= 0.0) & (found[0] < 360.0)).all()
    assert ((found[2] > -180.0) & (found[2] <= 180.0)).all()
    np.testing.assert_allclose(found[1], pitch, atol=1e-6)
    np.testing.assert_allclose(rotations_from_hpr(*found), rotations, atol=1e-9)
    assert are_rotations(rotations).all()


@given(angles, angles, angles)
def test_omega_phi_and_kappa_survive_heading_pitch_and_roll(
    omega: np.ndarray, phi: np.ndarray, kappa: np.ndarray
) -> None:
    rotations = rotations_from_opk(omega, phi, kappa)
    again = rotations_from_hpr(*hpr_from_rotations(rotations))
    np.testing.assert_allclose(again, rotations, atol=1e-7)
    world_from_camera = rotations @ PHOTOGRAMMETRIC_FROM_RDF.T
    found_phi = np.arcsin(np.clip(world_from_camera[:, 0, 2], -1.0, 1.0))
    np.testing.assert_allclose(np.sin(found_phi), np.sin(np.radians(phi)), atol=1e-9)


@given(quaternions)
def test_a_quaternion_turns_vectors_as_its_product_does(parts: np.ndarray) -> None:
    lengths = np.linalg.norm(parts, axis=0)
    rotations = rotations_from_quaternions(*parts)
    for (w, x, y, z), length, rotation in zip(parts.T, lengths, rotations, strict=True):
        if length < 1e-6:
            continue
        # v' = q v q*, written out: Hamilton's rules alone.
        axis = np.array([x, y, z]) / length
        for vector in np.eye(3):
            cross = np.cross(axis, vector)
            turned = vector + 2 * w / length * cross + 2 * np.cross(axis, cross)
            np.testing.assert_allclose(rotation @ vector, turned, atol=1e-9)


def by_nasa(omega: float, phi: float, kappa: float) -> np.ndarray:
    """Rx Ry Rz written out: Henderson, Euler Angles, Quaternions, and Transformation Matrices,
    NASA TM-74839 (1977), appendix A, sequence X-Y-Z."""
    s1, s2, s3 = (math.sin(math.radians(angle)) for angle in (omega, phi, kappa))
    c1, c2, c3 = (math.cos(math.radians(angle)) for angle in (omega, phi, kappa))
    return np.array(
        [
            [c2 * c3, -c2 * s3, s2],
            [s1 * s2 * c3 + c1 * s3, -s1 * s2 * s3 + c1 * c3, -s1 * c2],
            [-c1 * s2 * c3 + s1 * s3, c1 * s2 * s3 + s1 * c3, c1 * c2],
        ]
    )


@given(st.floats(-360.0, 360.0), st.floats(-360.0, 360.0), st.floats(-360.0, 360.0))
def test_omega_phi_kappa_are_nasa_s_sequence_x_y_z(omega: float, phi: float, kappa: float) -> None:
    found = rotations_from_opk([omega], [phi], [kappa])[0] @ PHOTOGRAMMETRIC_FROM_RDF.T
    np.testing.assert_allclose(found, by_nasa(omega, phi, kappa), atol=1e-9)


@pytest.mark.parametrize(
    ("opk", "matrix", "tolerance"),
    [
        # Luhmann, Robson, Kyle and Boehm, Close-Range Photogrammetry and 3D Imaging, section 2.2.
        (
            (-13.0567, -4.4369, 0.7782),
            [
                [0.996911, -0.013541, -0.077361],
                [0.030706, 0.973820, 0.225238],
                [0.072285, -0.226918, 0.971228],
            ],
            2e-6,
        ),
        # The program poser, which turns bundle adjustments into angles (tests of its converter).
        (
            (-12.4170, -19.0871, -178.4477),
            [
                [-0.9447, 0.0256, -0.3270],
                [-0.0967, -0.9743, 0.2032],
                [-0.3134, 0.2236, 0.9229],
            ],
            1e-4,
        ),
    ],
)
def test_omega_phi_kappa_agree_with_published_matrices(
    opk: tuple[float, float, float], matrix: list[list[float]], tolerance: float
) -> None:
    found = rotations_from_opk(*([angle] for angle in opk))[0] @ PHOTOGRAMMETRIC_FROM_RDF.T
    np.testing.assert_allclose(found, matrix, atol=tolerance)


def test_a_photograph_with_angles_of_zero_looks_down_with_north_at_its_top() -> None:
    right, down, axis = rotations_from_opk([0.0], [0.0], [0.0])[0].T
    np.testing.assert_allclose(right, [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(down, [0, -1, 0], atol=1e-12)
    np.testing.assert_allclose(axis, [0, 0, -1], atol=1e-12)


def test_a_photograph_with_omega_90_looks_north_on_the_level() -> None:
    heading, pitch, roll = hpr_from_rotations(rotations_from_opk([90.0], [0.0], [0.0]))
    assert (heading[0], pitch[0], roll[0]) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    # On its side: kappa turns the top of the picture to the left, so its right side is up.
    turned = hpr_from_rotations(rotations_from_opk([90.0], [0.0], [90.0]))
    assert turned[2][0] == pytest.approx(-90.0)
    # Phi turns a level camera to the left: west of north.
    left = hpr_from_rotations(rotations_from_opk([90.0], [30.0], [0.0]))
    assert left[0][0] == pytest.approx(330.0)


def test_straight_up_the_roll_is_zero_and_the_rotation_is_kept() -> None:
    rotations = rotations_from_hpr([40.0, 40.0], [90.0, -90.0], [0.0, 0.0])
    heading, _, roll = hpr_from_rotations(rotations)
    np.testing.assert_allclose(heading, 40.0)
    assert roll.tolist() == [0.0, 0.0]


def test_what_is_not_known_stays_unknown_and_harms_nothing_else() -> None:
    rotations = rotations_from_hpr([math.nan, 10.0], [0.0, 0.0], [0.0, 0.0])
    assert np.isnan(rotations[0]).all()
    heading, pitch, roll = hpr_from_rotations(rotations)
    assert np.isnan([heading[0], pitch[0], roll[0]]).all()
    assert heading[1] == pytest.approx(10.0)
    assert np.isnan(rotations_from_opk([0.0], [math.nan], [0.0])).all()
    turned = rotations_from_quaternions([0.0, math.nan, 2.0], [0.0] * 3, [0.0] * 3, [0.0] * 3)
    assert np.isnan(turned[:2]).all()
    np.testing.assert_allclose(turned[2], np.eye(3))
    assert are_rotations(rotations).tolist() == [False, True]


@pytest.mark.parametrize(
    "call",
    [
        lambda: rotations_from_hpr([1.0, 2.0], [1.0], [1.0, 2.0]),
        lambda: rotations_from_opk([[1.0]], [[1.0]], [[1.0]]),
        lambda: rotations_from_quaternions([1.0], [0.0], [0.0], 0.0),
        lambda: hpr_from_rotations(np.eye(3)),
        lambda: are_rotations(np.ones((2, 3, 4))),
        lambda: interpolated([0.0, 1.0], np.eye(3)[None], [0.5]),
        lambda: interpolated([1.0, 1.0], np.stack([np.eye(3)] * 2), [1.0]),
    ],
)
def test_shapes_that_do_not_match_are_refused(call: object) -> None:
    with pytest.raises(ValueError, match=r"got|ascend"):
        call()  # type: ignore[operator]


def test_no_cameras_are_no_error() -> None:
    assert rotations_from_hpr([], [], []).shape == (0, 3, 3)
    assert hpr_from_rotations(np.zeros((0, 3, 3)))[0].shape == (0,)
    assert rotations_from_quaternions([], [], [], []).shape == (0, 3, 3)
    assert are_rotations(np.zeros((0, 3, 3))).shape == (0,)
    assert np.isnan(interpolated([], np.zeros((0, 3, 3)), [1.0])).all()


def test_mirrors_and_stretched_axes_are_no_rotations() -> None:
    matrices = [np.eye(3), np.diag([1.0, 1.0, -1.0]), 2 * np.eye(3), FRD_FROM_RDF]
    assert are_rotations(np.stack(matrices)).tolist() == [True, False, False, True]


def test_turning_is_steady_between_known_rotations() -> None:
    rotations = rotations_from_hpr([350.0, 30.0], [0.0, 0.0], [0.0, 0.0])
    found = interpolated([10.0, 12.0], rotations, [10.0, 10.5, 11.0, 12.0])
    heading, pitch, _ = hpr_from_rotations(found)
    np.testing.assert_allclose(heading, [350.0, 0.0, 10.0, 30.0], atol=1e-9)
    np.testing.assert_allclose(pitch, 0.0, atol=1e-9)


def test_nothing_is_extrapolated_nor_found_beside_a_gap() -> None:
    rotations = rotations_from_hpr([0.0, 90.0, math.nan, 90.0], [0.0] * 4, [0.0] * 4)
    found = interpolated([0.0, 1.0, 2.0, 3.0], rotations, [-0.1, 0.5, 1.0, 1.5, 2.5, 3.0, 3.1])
    known = ~np.isnan(found).any(axis=(1, 2))
    assert known.tolist() == [False, True, True, False, False, True, False]


def test_a_single_rotation_holds_at_its_own_time_alone() -> None:
    found = interpolated([5.0], np.eye(3)[None], [4.0, 5.0, 6.0])
    np.testing.assert_allclose(found[1], np.eye(3))
    assert np.isnan(found[[0, 2]]).all()


def test_nanoseconds_of_this_century_are_told_apart() -> None:
    start = 1_700_000_000_000_000_000
    rotations = rotations_from_hpr([0.0, 90.0], [0.0, 0.0], [0.0, 0.0])
    found = interpolated(np.array([start, start + 100]), rotations, np.array([start + 10]))
    assert hpr_from_rotations(found)[0][0] == pytest.approx(9.0)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=8))
def test_interpolated_matrices_are_rotations(fractions: list[float]) -> None:
    rotations = rotations_from_hpr([10.0, 200.0], [80.0, -70.0], [5.0, 170.0])
    assert are_rotations(interpolated([0.0, 1.0], rotations, fractions), 1e-9).all()
