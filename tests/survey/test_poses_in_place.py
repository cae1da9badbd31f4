import numpy as np
import pytest

from contracts.records import Pose
from survey.poses import crs_name, is_geographic, outside_area


@pytest.mark.parametrize(
    ("crs", "x", "y"),
    [
        ("EPSG:2154", 652_000.0, 6_861_000.0),
        ("EPSG:2154+5720", 652_000.0, 6_861_000.0),
        ("EPSG:27572", 600_000.0, 2_428_000.0),  # its degrees are grads from Paris
        ("EPSG:4807", 0.0, 54.3),
        ("EPSG:2263", 988_000.0, 192_000.0),
        ("EPSG:3832", 3_400_000.0, 0.0),  # beyond longitude 180
        ("EPSG:32760", 500_000.0, 8_000_000.0),
        ("EPSG:3413", 0.0, 0.0),
        ("EPSG:2053", 71_984.49, 2_847_342.74),
        ("EPSG:4326", 180.0, -16.5),
    ],
)
def test_a_place_inside_a_system_s_area_is_not_outside(crs: str, x: float, y: float) -> None:
    assert outside_area([Pose(x, y, crs)], crs).tolist() == [False]


@pytest.mark.parametrize(
    ("crs", "x", "y"),
    [
        ("EPSG:2154", 6_861_000.0, 652_000.0),  # swapped
        ("EPSG:27572", 2_428_000.0, 600_000.0),
        ("EPSG:2154", 2.35, 48.85),  # degrees
        ("EPSG:4258", 48.85, 2.35),  # latitude first
        ("EPSG:2154", np.nan, 6_861_000.0),
    ],
)
def test_a_place_far_from_a_system_s_area_is_outside(crs: str, x: float, y: float) -> None:
    assert outside_area([Pose(x, y, crs)], crs).tolist() == [True]


def test_each_pose_is_judged_by_itself() -> None:
    poses = [Pose(652e3 + row, 6.861e6, "EPSG:2154") for row in range(3)]
    poses[1] = Pose(0.0, 0.0, "EPSG:2154")
    assert outside_area(poses, "EPSG:2154").tolist() == [False, True, False]


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("epsg:2154", "EPSG:2154"),
        ("EPSG:2154+5720", "EPSG:5698"),  # Lambert-93 and NGF-IGN69 heights, as one code
        ("EPSG:4979", "EPSG:4979"),
        ("urn:ogc:def:crs:EPSG::27572", "EPSG:27572"),
    ],
)
def test_a_system_is_named_with_its_heights(text: str, name: str) -> None:
    assert crs_name(text) == name


def test_whether_coordinates_are_degrees_depends_on_the_horizontal_part() -> None:
    assert is_geographic("EPSG:4326+5773")
    assert is_geographic("EPSG:4979")
    assert not is_geographic("EPSG:5698")
