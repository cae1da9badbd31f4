import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contracts.errors import UnknownCrs
from contracts.records import Pose
from geo.crs import ToWgs84
from geo.reprojection import reproject

# IGN's Lambert II extended to Lambert-93 by its shift grid, from PROJ's test_cs2cs_ignf.yaml
# ("calculated by other means"): easting and northing in each.
IGN = [
    ((600000.0, 2600545.4523), (652760.737, 7033791.243)),
    ((135638.3592, 2418760.4094), (187194.062, 6855928.882)),
    ((998137.3947, 2413822.2844), (1049052.258, 6843776.562)),
    ((600000.0, 2200000.0), (649398.872, 6633524.191)),
    ((311552.5340, 1906457.4840), (358799.172, 6342652.486)),
    ((960488.4138, 1910172.8812), (1007068.686, 6340907.237)),
]


def test_the_old_french_zones_are_taken_into_lambert_93_as_well_as_is_said() -> None:
    poses = [Pose(*zone_2, "EPSG:27572") for zone_2, _ in IGN]
    found = reproject(poses, "EPSG:2154")
    operation = found.operations["EPSG:27572"]
    assert operation.accuracy_m is not None
    for pose, (_, lambert_93) in zip(found.poses, IGN, strict=True):
        off = math.dist((pose.easting, pose.northing), lambert_93)
        # Stated accuracies are of one deviation; PROJ has seven-parameter shifts at 2 m and 1 m.
        assert off <= 2.0 * operation.accuracy_m
    if operation.missing_grids:
        assert operation.missing_grids == ("fr_ign_gr3df97a.tif",)
        assert operation.accuracy_m == 3.0


def test_a_grid_heading_becomes_a_true_one_by_the_convergence_of_where_it_was_measured() -> None:
    pose = Pose(652_000.0, 6_861_000.0, "EPSG:2154", heading_deg=0.2)
    found = reproject([pose], "EPSG:32631").poses[0]
    convergence = ToWgs84("EPSG:2154").convergence_deg([652_000.0], [6_861_000.0])[0]
    assert found.north == "true"
    assert found.heading_deg == pytest.approx(360.2 + convergence)


@pytest.mark.parametrize("north", ["true", "magnetic"])
def test_true_and_magnetic_headings_stay(north: str) -> None:
    pose = Pose(652e3, 6.861e6, "EPSG:2154", heading_deg=90.0, north=north)  # type: ignore[arg-type]
    found = reproject([pose], "EPSG:32631").poses[0]
    assert (found.heading_deg, found.north) == (90.0, north)


def test_what_else_is_known_of_a_pose_stays() -> None:
    pose = Pose(
        652e3,
        6.861e6,
        "EPSG:2154",
        pitch_deg=3.0,
        roll_deg=-2.0,
        heading_derived=True,
        position_error_m=4.0,
    )
    found = reproject([pose], "EPSG:4326").poses[0]
    assert (found.pitch_deg, found.roll_deg) == (3.0, -2.0)
    assert found.heading_deg is None
    assert found.heading_derived
    assert found.position_error_m == 4.0
    assert found.crs == "EPSG:4326"


@pytest.mark.parametrize(
    ("former", "crs", "kept"),
    [
        ("EPSG:2154", "EPSG:32631", True),  # neither says from what
        ("EPSG:2154+5720", "EPSG:32631+5720", True),
        ("EPSG:2154+5720", "EPSG:32631", False),
        ("EPSG:2154", "EPSG:32631+5720", False),
        ("EPSG:2154+5720", "EPSG:32631+5773", False),
    ],
)
def test_an_altitude_is_kept_only_if_both_systems_count_it_from_the_same(
    former: str, crs: str, kept: bool
) -> None:
    pose = Pose(652_000.0, 6_861_000.0, former, altitude_m=35.0)
    found = reproject([pose], crs)
    assert found.poses[0].altitude_m == (35.0 if kept else None)
    assert found.altitudes_dropped == (0 if kept else 1)


def test_rows_of_several_systems_come_out_in_one_and_in_order() -> None:
    lon, lat = 2.35, 48.85
    systems = ["EPSG:4326", "EPSG:2154", "EPSG:32631", "EPSG:4326", "EPSG:3857"]
    poses = [
        Pose(*(float(v[0]) for v in ToWgs84(crs).from_lon_lat([lon], [lat + row * 1e-4])), crs)
        for row, crs in enumerate(systems)
    ]
    found = reproject(poses, "EPSG:2154")
    assert {pose.crs for pose in found.poses} == {"EPSG:2154"}
    assert set(found.operations) == {"EPSG:4326", "EPSG:32631", "EPSG:3857"}
    assert found.poses[1] is poses[1]
    east, north = ToWgs84("EPSG:2154").from_lon_lat([lon] * 5, lat + np.arange(5) * 1e-4)
    np.testing.assert_allclose([p.easting for p in found.poses], east, atol=1e-3)
    np.testing.assert_allclose([p.northing for p in found.poses], north, atol=1e-3)


def test_poses_already_there_are_untouched() -> None:
    poses = [Pose(652e3, 6.861e6, "EPSG:2154", heading_deg=5.0, altitude_m=1.0)]
    found = reproject(poses, "EPSG:2154")
    assert found.poses == tuple(poses)
    assert found.operations == {}
    assert reproject([], "EPSG:2154").poses == ()


def test_a_place_that_the_other_system_does_not_have_is_named() -> None:
    with pytest.raises(UnknownCrs, match=r"easting 0, northing -90"):
        reproject([Pose(0.0, -90.0, "EPSG:4326")], "EPSG:2154")


def test_a_ballpark_conversion_is_refused_unless_it_is_allowed() -> None:
    nameless = "+proj=utm +zone=31 +ellps=intl +units=m"
    pose = Pose(452e3, 5.411e6, nameless)
    with pytest.raises(UnknownCrs, match="allow-ballpark"):
        reproject([pose], "EPSG:2154")
    found = reproject([pose], "EPSG:2154", allow_ballpark=True)
    assert found.operations[nameless].ballpark


@settings(max_examples=30)
@given(st.floats(2.0, 3.0), st.floats(48.0, 49.0), st.floats(0.0, 359.9))
def test_there_and_back_is_the_same_place_and_direction(
    lon: float, lat: float, heading: float
) -> None:
    x, y = ToWgs84("EPSG:2154").from_lon_lat([lon], [lat])
    pose = Pose(float(x[0]), float(y[0]), "EPSG:2154", heading_deg=heading, north="true")
    back = reproject(reproject([pose], "EPSG:3949").poses, "EPSG:2154").poses[0]
    assert math.dist((back.easting, back.northing), (pose.easting, pose.northing)) < 1e-4
    assert back.heading_deg == heading
