"""Whatever a survey holds, the doctor answers in sentences."""

from datetime import UTC, datetime, timedelta

from hypothesis import given, settings
from hypothesis import strategies as st

from contracts.records import Camera, Pose, PosedImage, Skipped
from survey.doctor.duplicates import check_files_twice
from survey.doctor.examination import CHECKS_OF_TRACK
from survey.doctor.figures import figures_of
from survey.doctor.heights import check_heights
from survey.doctor.pairing import check_skipped
from survey.doctor.systems import likely_systems
from survey.doctor.times import check_times
from survey.doctor.track import track_of

NOW = datetime(2024, 1, 1, tzinfo=UTC)

ANGLE = st.none() | st.sampled_from([0.0, 90.0, 359.9]) | st.floats(0.0, 359.9)
TIME = st.none() | st.builds(
    lambda seconds: (datetime(2020, 1, 1, tzinfo=UTC) + timedelta(seconds=seconds)).isoformat(),
    st.integers(-2_000_000_000, 2_000_000_000) | st.integers(0, 30),
)
POSE = st.builds(
    Pose,
    easting=st.floats(-180.0, 180.0) | st.floats(2.0, 2.001) | st.just(0.0),
    northing=st.floats(-90.0, 90.0) | st.floats(48.0, 48.001) | st.just(0.0),
    crs=st.just("EPSG:4326"),
    altitude_m=st.none() | st.floats(-1000.0, 9000.0) | st.just(0.0),
    heading_deg=ANGLE,
    pitch_deg=st.none() | st.floats(-90.0, 90.0),
    roll_deg=st.none() | st.floats(-180.0, 180.0),
    north=st.sampled_from(["grid", "true", "magnetic"]),
    heading_derived=st.booleans(),
)
PARTS = st.tuples(POSE, st.sampled_from(["", "a", "b"]), TIME)


@given(st.lists(PARTS, min_size=1, max_size=40))
@settings(max_examples=60, deadline=None)
def test_any_survey_is_examined(parts: list[tuple[Pose, str, str | None]]) -> None:
    images = [
        PosedImage(
            uri=f"{at // 15}/{at:03d}.jpg",
            path="/nowhere.jpg",
            pose=pose,
            camera=Camera(name),
            captured_at=time,
        )
        for at, (pose, name, time) in enumerate(parts)
    ]
    track = track_of(images, "EPSG:4326")
    figures_of(images, 0, track)
    found = [finding for check in CHECKS_OF_TRACK for finding in check(track)]
    found += check_heights(track, "table")
    found += [*check_times(images, NOW), *check_files_twice(images)]
    uris = {image.uri for image in images}
    assert all(finding.what and set(finding.uris) <= uris for finding in found)


@given(st.lists(st.builds(Skipped, st.text(), st.text()), max_size=30))
def test_no_skipped_image_is_lost_whatever_its_reason(skipped: list[Skipped]) -> None:
    findings = list(check_skipped((), skipped, no_pose=False))
    assert sum(len(finding.uris) for finding in findings) == len(skipped)


@given(st.floats(-1e8, 1e8), st.floats(-1e8, 1e8))
@settings(max_examples=20, deadline=None)
def test_any_numbers_may_be_asked_for_their_system(x: float, y: float) -> None:
    assert all(code.startswith("EPSG:") for code in likely_systems(x, y))
