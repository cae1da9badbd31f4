from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from contracts.errors import BadSurvey
from contracts.records import Pose
from survey import utm_names
from survey.options import Reading, ReadOptions

# UTM coordinates by the `utm` package, from the latitude and longitude beside them.
SF_XL = (
    "@0549129.78@4179235.87@10@S@037.75912@-122.44224@gTI5kVb_hBtC0SGPkxrMGw@@90@@@@201311@@.jpg"
)
PITTS30K = "@0589113.14@4477140.37@17@T@040.44014@-079.94926@001042@46@@@@@@pitch2_yaw23@.jpg"
SYDNEY = "@0334370.54@6251369.91@56@H@-33.86500@0151.20940@a@@12@-5@3@@20240229_101112@@.png"


def named(folder: Path, *names: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        Image.new("RGB", (8, 6)).save(folder / name)
    return folder


def read(folder: Path, **options: object) -> Reading:
    return utm_names.READER.read(folder, ReadOptions(**options), lambda _uri: True)


def only_pose(reading: Reading) -> Pose:
    (image,) = reading.images
    assert image.pose is not None
    return image.pose


def test_the_pose_is_read_from_the_name(tmp_path: Path) -> None:
    reading = read(named(tmp_path / "images" / "test" / "database", SF_XL).parents[1])
    pose = only_pose(reading)
    assert (pose.easting, pose.northing, pose.crs) == (549_129.78, 4_179_235.87, "EPSG:32610")
    assert (pose.heading_deg, pose.north) == (90.0, "true")
    assert (pose.pitch_deg, pose.roll_deg, pose.altitude_m) == (None, None, None)
    assert reading.crs == "EPSG:32610"
    assert reading.images[0].uri == f"test/database/{SF_XL}"
    assert reading.images[0].captured_at is None


def test_the_southern_hemisphere_has_its_own_systems(tmp_path: Path) -> None:
    pose = only_pose(read(named(tmp_path, SYDNEY)))
    assert pose.crs == "EPSG:32756"
    assert (pose.heading_deg, pose.pitch_deg, pose.roll_deg) == (12.0, -5.0, 3.0)


def test_zones_are_joined_in_degrees(tmp_path: Path) -> None:
    reading = read(named(tmp_path, SF_XL, PITTS30K, SYDNEY))
    assert reading.crs == "EPSG:4326"
    places = sorted(
        (image.pose.easting, image.pose.northing) for image in reading.images if image.pose
    )
    # Longitude and latitude as the names themselves give them.
    expected = [(-122.44224, 37.75912), (-79.94926, 40.44014), (151.20940, -33.86500)]
    for place, stated in zip(places, expected, strict=True):
        assert place == pytest.approx(stated, abs=2e-5)
    assert "3 UTM zones (EPSG:32610, EPSG:32617, EPSG:32756)" in reading.notes[0]


@pytest.mark.parametrize("options", [{"crs": "EPSG:32610"}, {"north": "grid"}])
def test_one_grid_for_several_zones_is_refused(tmp_path: Path, options: dict[str, object]) -> None:
    with pytest.raises(BadSurvey, match="2 UTM zones"):
        read(named(tmp_path, SF_XL, PITTS30K), **options)


def test_another_datum_can_be_named(tmp_path: Path) -> None:
    reading = read(named(tmp_path, PITTS30K), crs="EPSG:26917", north="grid")
    pose = only_pose(reading)
    assert (reading.crs, pose.crs, pose.north) == ("EPSG:26917", "EPSG:26917", "grid")


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("plain.jpg", "its name is not 14 fields between @"),
        ("@1@2@3@.jpg", "its name is not 14 fields between @"),
        (SF_XL.replace("@0549129.78", "@"), "its name has no UTM position"),
        (SF_XL.replace("0549129.78", "east"), "UTM easting is 'east', expected a number"),
        (SF_XL.replace("0549129.78", "inf"), "UTM easting is 'inf', expected a number"),
        (SF_XL.replace("@10@S@", "@61@S@"), "UTM zone is '61', expected 1 to 60"),
        (SF_XL.replace("@10@S@", "@@S@"), "UTM zone is '', expected 1 to 60"),
        (SF_XL.replace("@10@S@", "@²@S@"), "UTM zone is '²', expected 1 to 60"),
        (SF_XL.replace("@10@S@", "@10@O@"), "UTM band is 'O'"),
        (SF_XL.replace("@10@S@", "@10@H@"), "two hemispheres"),
        (SF_XL.replace("@S@037.75912", "@@"), "which hemisphere"),
        (SF_XL.replace("@@90@", "@@north@"), "heading is 'north', expected a number"),
        (SF_XL.replace("@@90@@", "@@90@120@"), "pitch is 120 degrees"),
    ],
)
def test_a_name_that_does_not_hold_is_skipped_with_its_reason(
    tmp_path: Path, name: str, reason: str
) -> None:
    reading = read(named(tmp_path, PITTS30K, name))
    assert only_pose(reading).crs == "EPSG:32617"
    (skip,) = reading.skipped
    assert skip.uri == name
    assert reason in skip.reason


def test_without_a_band_the_latitude_says_the_hemisphere(tmp_path: Path) -> None:
    assert only_pose(read(named(tmp_path, SYDNEY.replace("@H@", "@@")))).crs == "EPSG:32756"


def test_the_first_images_of_a_folder_tell_the_format(tmp_path: Path) -> None:
    assert not utm_names.READER.recognises(tmp_path)
    named(tmp_path / "b", "plain.jpg")
    assert not utm_names.READER.recognises(tmp_path)
    named(tmp_path / "a" / "database", SF_XL, "plain.jpg")
    (tmp_path / "a" / "readme@.txt").write_text("")
    assert utm_names.READER.recognises(tmp_path)
    assert not utm_names.READER.recognises(tmp_path / "a" / "database" / SF_XL)


@given(st.lists(st.text(max_size=12), min_size=12, max_size=18), st.integers(0, 14))
def test_any_name_is_a_pose_or_a_reason(fields: list[str], keep: int) -> None:
    good = SF_XL.split("@")
    name = "@".join(good[:keep] + fields[keep:])
    pose = utm_names._pose(name, "true")
    assert isinstance(pose, Pose) or pose != ""
