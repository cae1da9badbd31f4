from dataclasses import replace
from pathlib import Path

import numpy as np
import pyproj
import pytest
from hypothesis import given
from hypothesis import strategies as st

from contracts.records import Camera, Pose, PosedImage
from survey import ReadOptions, read_survey
from survey.fragments import Fragment, Message
from survey.track import sequences, travel_direction_deg, with_track_headings

LAMBERT_93, DEGREES, FEET = "EPSG:2154", "EPSG:4326", "EPSG:2263"


def image(
    name: str,
    x: float,
    y: float,
    second: int | None = None,
    crs: str = LAMBERT_93,
    heading_deg: float | None = None,
    camera: str = "",
) -> PosedImage:
    clock = None if second is None else f"2024-02-29T10:{second // 60:02d}:{second % 60:02d}Z"
    pose = Pose(x, y, crs, heading_deg=heading_deg)
    return PosedImage(name, f"/s/{name}", pose=pose, camera=Camera(camera), captured_at=clock)


def drive(count: int = 5, step_m: float = 5.0, first_second: int = 0) -> list[PosedImage]:
    """Eastwards along a street."""
    return [
        image(f"d/{at}.jpg", 652_000 + step_m * at, 6_862_000, first_second + at)
        for at in range(count)
    ]


def headings(images: tuple[PosedImage, ...]) -> list[float | None]:
    return [shown.pose.heading_deg for shown in images if shown.pose is not None]


@pytest.mark.parametrize("direction", [0.0, 45.0, 90.0, 200.0, 359.5])
def test_a_straight_track_has_its_direction_everywhere(direction: float) -> None:
    along = np.arange(6) * 4.0
    turn = np.radians(direction)
    got = travel_direction_deg(along * np.sin(turn), along * np.cos(turn))
    np.testing.assert_allclose(got, direction, atol=1e-9)


def test_the_direction_on_a_circle_is_its_tangent() -> None:
    angle = np.radians(np.array([0.0, 4.0, 6.0, 12.0, 20.0, 23.0]))
    x, y = 100.0 * np.sin(angle), 100.0 * np.cos(angle)
    got = travel_direction_deg(x, y)
    np.testing.assert_allclose(got[1:-1], 90.0 + np.degrees(angle[1:-1]), atol=0.05)


def test_jitter_of_a_slow_camera_does_not_turn_its_heading() -> None:
    rng = np.random.default_rng(0)
    along = np.arange(40) * 0.25
    got = travel_direction_deg(rng.normal(0, 0.02, 40), along + rng.normal(0, 0.02, 40))
    off = (got + 180.0) % 360.0 - 180.0
    assert np.abs(off).max() < 6.0


def test_a_camera_that_stands_still_has_no_direction() -> None:
    rng = np.random.default_rng(0)
    jitter = rng.uniform(-0.3, 0.3, (30, 2))
    assert np.isnan(travel_direction_deg(*jitter.T)).all()
    assert np.isnan(travel_direction_deg([3.0], [4.0])).all()
    assert travel_direction_deg([], []).shape == (0,)


def test_before_and_after_a_long_stop_the_direction_is_kept() -> None:
    y = np.concatenate([np.arange(5) * 3.0, np.full(40, 12.0), 12.0 + np.arange(1, 5) * 3.0])
    got = travel_direction_deg(np.zeros_like(y), y)
    assert np.isnan(got[20:30]).all()
    np.testing.assert_array_equal(got[:5], 0.0)
    np.testing.assert_array_equal(got[-4:], 0.0)


def test_where_the_camera_turns_back_there_is_no_direction() -> None:
    got = travel_direction_deg([0.0, 5.0, 10.0, 5.0, 0.0], np.zeros(5))
    np.testing.assert_array_equal(got, [90.0, 90.0, np.nan, 270.0, 270.0])


@given(
    st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(1.1, 50.0)), min_size=1, max_size=30),
    st.floats(0.0, 360.0),
)
def test_directions_turn_with_the_track(steps: list[tuple[float, float]], turn: float) -> None:
    """A track of ever new legs, none turned by more than 115 degrees from the one before."""
    bends, lengths = np.array(steps).T
    heading = np.cumsum(bends * 2.0)
    x, y = np.cumsum(lengths * np.sin(heading)), np.cumsum(lengths * np.cos(heading))
    before = travel_direction_deg(x, y)
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    after = travel_direction_deg(c * x + s * y, -s * x + c * y)
    if len(x) > 1:
        assert ((before >= 0.0) & (before < 360.0)).all()
        off = (after - before - turn + 180.0) % 360.0 - 180.0
        np.testing.assert_allclose(off, 0.0, atol=1e-6)


def test_images_are_ordered_by_time_and_split_at_gaps_and_jumps() -> None:
    early, late = drive(3), drive(3, first_second=120)
    far = [replace(shown, uri=f"d/far{at}.jpg") for at, shown in enumerate(drive(2, 1.0, 123))]
    far = [replace(shown, pose=Pose(653_000 + at, 0, LAMBERT_93)) for at, shown in enumerate(far)]
    mixed = [late[2], early[1], far[0], early[0], late[0], early[2], late[1], far[1]]
    assert [found.tolist() for found in sequences(mixed)] == [[4, 6, 0], [3, 1, 5], [2, 7]]


def test_without_times_numbers_in_names_are_counted() -> None:
    images = [image(f"d/{name}.jpg", 0, 0) for name in ("img10", "img9", "img1", "img2")]
    assert [found.tolist() for found in sequences(images)] == [[2, 3, 1, 0]]


def test_cameras_folders_and_topics_are_sequences_of_their_own() -> None:
    images = [
        image("a/1.jpg", 0, 0),
        image("b/1.jpg", 0, 0),
        image("a/2.jpg", 0, 0, camera="left"),
        image("a/3.jpg", 0, 0),
        replace(image("x.mcap#1", 0, 0), fragment=str(Fragment(Message("/a", 1, 8)))),
        replace(image("x.mcap#2", 0, 0), fragment=str(Fragment(Message("/b", 1, 8)))),
        PosedImage("a/4.jpg", "/s/a/4.jpg"),
    ]
    found = [sequence.tolist() for sequence in sequences(images)]
    assert found == [[0, 3], [1], [2], [4], [5]]


def test_names_in_order_of_coordinates_are_no_track() -> None:
    images = [image(f"d/@{at}@0@.jpg", 652_000 + at, 0) for at in range(5)]
    assert sequences(images) == []


def test_images_without_heading_look_where_the_track_leads() -> None:
    derived = with_track_headings(drive(), LAMBERT_93)
    assert headings(derived) == [90.0] * 5
    assert all(shown.pose and shown.pose.heading_derived for shown in derived)
    assert {shown.pose.north for shown in derived if shown.pose} == {"grid"}
    assert {shown.pose.pitch_deg for shown in derived if shown.pose} == {None}


def test_a_heading_that_is_there_is_kept() -> None:
    images = drive()
    images[2] = image("d/2.jpg", 652_010, 6_862_000, 2, heading_deg=17.0)
    derived = with_track_headings(images, LAMBERT_93)
    assert headings(derived) == [90.0, 90.0, 17.0, 90.0, 90.0]
    assert derived[2] == images[2]


def test_two_photographs_are_no_track() -> None:
    assert with_track_headings(drive(2), LAMBERT_93) == tuple(drive(2))


def test_a_metre_is_a_metre_in_a_survey_in_feet() -> None:
    crawling = [image(f"{at}.jpg", 987_000 + 0.15 * at, 211_000, at, FEET) for at in range(20)]
    assert headings(with_track_headings(crawling, FEET)) == [None] * 20


@pytest.mark.parametrize(
    ("lon", "lat", "azimuth"), [(2.3, 48.8, 77.0), (179.9999, -17.0, 90.0), (10.0, 89.99, 300.0)]
)
def test_a_track_in_degrees_has_its_true_azimuth(lon: float, lat: float, azimuth: float) -> None:
    geod = pyproj.Geod(ellps="WGS84")
    distance = np.arange(8) * 5.0
    count = len(distance)
    x, y, back = geod.fwd(np.full(count, lon), np.full(count, lat), [azimuth] * count, distance)
    images = [image(f"{at}.jpg", x[at], y[at], at, DEGREES) for at in range(count)]
    derived = with_track_headings(images, DEGREES)
    forward = (np.asarray(back)[1:-1] + 180.0) % 360.0
    got = np.array(headings(derived), np.float64)[1:-1]
    np.testing.assert_allclose(got, forward, atol=0.15)  # a curve, 1.1 km from the pole
    assert {shown.pose.north for shown in derived if shown.pose} == {"true"}


def test_photos_of_a_walk_along_a_street_look_along_it(test_data: Path) -> None:
    """29 photos without times or headings; all look ahead, as the pictures show."""
    survey = read_survey(test_data / "gps-photos" / "lund", ReadOptions())
    poses = [shown.pose for shown in survey.images if shown.pose is not None]
    ends = [(pose.easting, pose.northing) for pose in (poses[0], poses[-1])]
    street, _, _ = pyproj.Geod(ellps="WGS84").inv(*ends[0], *ends[1])
    off = np.array([pose.heading_deg for pose in poses], np.float64) - street
    off = (off + 180.0) % 360.0 - 180.0
    assert all(pose.heading_derived and pose.north == "true" for pose in poses)
    assert abs(np.median(off)) < 10.0
    assert np.abs(off).max() < 50.0
