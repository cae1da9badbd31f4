"""What the doctor says of headings against the track, and of pitch and roll."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from doctored_survey import NOW, Row, at, good_rows, of_camera, write_pictures, write_table
from hypothesis import given, settings
from hypothesis import strategies as st

from contracts.config import North
from contracts.records import Camera, Pose, PosedImage
from geo.magnetic import declination_deg
from survey import ReadOptions, read_survey
from survey.doctor import Finding, examine
from survey.doctor.circular import circular_mean, main_direction, wrapped
from survey.doctor.headings import check_headings
from survey.doctor.norths import check_norths
from survey.doctor.track import Track, track_of

LAMBERT = ReadOptions(crs="EPSG:2154")
NEW_YORK = (-74.0, 40.7)


@pytest.fixture
def rows() -> list[Row]:
    return good_rows()


def images_of(rows: list[Row], crs: str = "EPSG:2154", north: North = "grid") -> list[PosedImage]:
    """The images as a reader gives them; none is opened."""
    return [
        PosedImage(
            uri=str(row["file"]),
            path=str(row["file"]),
            pose=Pose(
                float(row["x"]), float(row["y"]), crs, float(row["z"]),
                float(row["heading"]) % 360.0, float(row["pitch"]), float(row["roll"]), north,
            ),
            camera=Camera(str(row["camera"])),
            captured_at=str(row["time"]) or None,
        )
        for row in rows
    ]  # fmt: skip


def track(rows: list[Row], crs: str = "EPSG:2154", north: North = "grid") -> Track:
    return track_of(sorted(images_of(rows, crs, north), key=lambda image: image.uri), crs)


def turned(rows: list[Row], turn: Callable[[float], float]) -> list[Row]:
    return [{**row, "heading": turn(float(row["heading"]))} for row in rows]


def worse_than_notes(findings: list[Finding]) -> list[Finding]:
    return [each for each in findings if each.severity != "note"]


def test_good_headings_give_the_mounting_of_each_camera(rows: list[Row]) -> None:
    (finding,) = check_headings(track(rows))
    assert finding.severity == "note"
    for camera, offset in (("ahead", "+0."), ("right", "+90."), ("left", "-90.")):
        assert (
            f"{camera} {offset}" in finding.what
            or f"{camera} {offset}".replace("+0.", "-0.")
            .replace("+90.", "+89.")
            .replace("-90.", "-89.")
            in finding.what
        )


@pytest.mark.parametrize(
    ("turn", "check", "mend"),
    [(lambda degrees: degrees / 0.9, "headings-grads", 'unit = "grad"'),
     (math.radians, "headings-radians", 'unit = "rad"'),
     (lambda degrees: -degrees, "headings-mirrored", "counterclockwise"),
     (lambda degrees: 90.0 - degrees, "headings-mirrored", "counterclockwise")],
)  # fmt: skip
def test_another_unit_or_sense_is_told(
    rows: list[Row], turn: Callable[[float], float], check: str, mend: str
) -> None:
    (finding,) = worse_than_notes(list(check_headings(track(turned(rows, turn)))))
    assert (finding.check, finding.severity) == (check, "error")
    assert mend in finding.mend


@pytest.mark.parametrize(
    ("turn", "check"),
    [(lambda degrees: degrees, None),
     (lambda degrees: degrees / 0.9 % 360.0, "headings-grads"),
     (math.radians, "headings-radians"),
     (lambda degrees: -degrees % 360.0, "headings-mirrored")],
)  # fmt: skip
def test_another_unit_or_sense_is_told_of_a_real_survey(
    test_data: Path, turn: Callable[[float], float], check: str | None
) -> None:
    """Stereopolis: one street, one corner."""
    images = [
        replace(image, pose=replace(image.pose, heading_deg=turn(image.pose.heading_deg)))
        for image in read_survey(test_data / "stereopolis-paris6", ReadOptions()).images
        if image.pose and image.pose.heading_deg is not None
    ]
    found = worse_than_notes(list(check_headings(track_of(images, "EPSG:2154"))))
    assert [each.check for each in found] == ([check] if check else [])


def test_mirrored_positions_are_told(rows: list[Row]) -> None:
    """Swapped degrees that stay on land: only the headings know."""
    mirrored = [{**row, "x": row["y"], "y": row["x"]} for row in at(rows, 45.0, 46.0)]
    (finding,) = worse_than_notes(list(check_headings(track(mirrored, "EPSG:4326", "true"))))
    assert finding.check == "headings-swapped"
    assert "lon and lat" in finding.mend


def test_some_headings_turned_round_are_named(rows: list[Row]) -> None:
    flipped = {f"ahead-{number:03d}.jpg" for number in (5, 6, 7, 30)}
    for row in rows:
        if row["file"] in flipped:
            row["heading"] = float(row["heading"]) + 180.0
    (finding,) = worse_than_notes(list(check_headings(track(rows))))
    assert finding.check == "headings-flipped"
    assert set(finding.uris) == flipped


def test_a_vehicle_that_reverses_is_not_a_flip(rows: list[Row]) -> None:
    """Stations 20 to 30 driven backwards: the vehicle keeps its heading."""
    order = [*range(20), *range(30, 19, -1), *range(31, 60)]
    ahead = of_camera(rows, "ahead")
    reversing = [
        {**ahead[station], "file": f"ahead-{at:03d}.jpg", "time": ahead[at]["time"]}
        for at, station in enumerate(order)
    ]
    for row in reversing[20:31]:
        row["heading"] = reversing[19]["heading"]
    assert worse_than_notes(list(check_headings(track(reversing)))) == []


def test_the_only_camera_turned_round_is_told(rows: list[Row]) -> None:
    (finding,) = worse_than_notes(list(check_headings(track(of_camera(rows, "back")))))
    assert finding.check == "headings-flipped"
    assert 'heading_zero = "south"' in finding.mend


def test_headings_that_follow_nothing_are_a_warning_for_a_vehicle(rows: list[Row]) -> None:
    rng = np.random.default_rng(0)
    loose = turned(of_camera(rows, "ahead"), lambda _: float(rng.uniform(0.0, 360.0)))
    (finding,) = worse_than_notes(list(check_headings(track(loose))))
    assert finding.check == "headings-track"


def test_headings_that_follow_nothing_are_usual_on_foot(rows: list[Row]) -> None:
    rng = np.random.default_rng(0)
    walked = turned(of_camera(rows, "ahead"), lambda _: float(rng.uniform(0.0, 360.0)))
    for row in walked:
        row["x"] = float(row["x"]) + rng.normal(0.0, 8.0)
        row["y"] = float(row["y"]) + rng.normal(0.0, 8.0)
    findings = list(check_headings(track(walked)))
    assert worse_than_notes(findings) == []
    assert "by hand" in findings[0].what


def test_without_headings_a_note_says_so(rows: list[Row]) -> None:
    bare = [
        replace(image, pose=replace(image.pose, heading_deg=None))
        for image in images_of(rows)
        if image.pose
    ]
    (finding,) = check_headings(track_of(bare, "EPSG:2154"))
    assert (finding.check, finding.severity) == ("headings", "note")


def test_too_few_images_on_the_move_are_said_not_to_tell(rows: list[Row]) -> None:
    (finding,) = check_headings(track(of_camera(rows, "ahead")[:6]))
    assert "cannot be compared" in finding.what


def test_grid_headings_called_true_are_told_by_the_convergence(rows: list[Row]) -> None:
    """In Brest Lambert-93 is turned by 5 degrees; the rows' headings are of the grid."""
    x, y = 145_500.0, 6_837_900.0
    moved = [
        {**row, "x": float(row["x"]) - 652_000.0 + x, "y": float(row["y"]) - 6_862_000.0 + y}
        for row in rows
    ]
    (finding,) = worse_than_notes(list(check_norths(track(moved, north="true"))))
    assert (finding.check, finding.mend) == ("north", "--north grid")
    assert worse_than_notes(list(check_norths(track(moved, north="grid")))) == []


@pytest.mark.parametrize("stated", ["true", "magnetic"])
def test_magnetic_and_true_are_told_apart_by_the_declination(
    rows: list[Row], stated: North
) -> None:
    """In New York a compass points 13 degrees west."""
    declination = float(declination_deg([-74.0], [40.7], [0.0], [2020.4])[0])
    assert declination < -12.0
    turn = -declination if stated == "true" else 0.0
    wrong = turned(at(rows, *NEW_YORK), lambda heading: heading + turn)
    (finding,) = worse_than_notes(list(check_norths(track(wrong, "EPSG:4326", stated))))
    assert finding.mend == f"--north {'magnetic' if stated == 'true' else 'true'}"
    assert "all cameras" in finding.what


def test_a_rig_that_looks_left_and_right_alike_tells_its_north(rows: list[Row]) -> None:
    to = {"ahead": 0.0, "right": 79.0 - 90.0, "left": 281.0 - 270.0}
    rig = [
        {**row, "heading": float(row["heading"]) + to[str(row["camera"])]}
        for row in at(rows, *NEW_YORK)
        if row["camera"] in to
    ]
    (finding,) = worse_than_notes(list(check_norths(track(rig, "EPSG:4326", "magnetic"))))
    assert finding.mend == "--north true"


def test_an_uneven_rig_is_said_not_to_tell(rows: list[Row]) -> None:
    to = {"ahead": 10.0, "right": 25.0, "left": 3.0, "back": 0.0}
    rig = [{**row, "heading": float(row["heading"]) + to[str(row["camera"])]} for row in rows]
    (finding,) = check_norths(track(rig))
    assert (finding.severity, "how the cameras are mounted" in finding.what) == ("note", True)


def test_one_camera_mounted_askew_is_no_warning(rows: list[Row]) -> None:
    askew = turned(of_camera(at(rows, *NEW_YORK), "ahead"), lambda heading: heading + 13.0)
    (finding,) = check_norths(track(askew, "EPSG:4326", "true"))
    assert finding.severity == "note"
    assert "askew" in finding.what


def test_a_rig_turned_by_what_no_north_explains_is_a_note(rows: list[Row]) -> None:
    askew = turned(at(rows, *NEW_YORK), lambda heading: heading + 5.0)
    (finding,) = check_norths(track(askew, "EPSG:4326", "true"))
    assert (finding.severity, "no other north explains" in finding.what) == ("note", True)


def test_a_small_difference_of_norths_is_said_not_to_tell(rows: list[Row]) -> None:
    early = [{**row, "time": str(row["time"]).replace("2020", "2012")} for row in rows]
    findings = list(check_norths(track(early)))
    assert ["cannot be told" in each.what for each in findings] == [True]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("survey")
    write_pictures(folder, of_camera(good_rows(), "ahead"))
    return folder


def test_pitch_from_the_nadir_is_told_although_half_is_refused(
    folder: Path, rows: list[Row]
) -> None:
    few = [{**row, "pitch": 90.0 + float(row["pitch"])} for row in of_camera(rows, "ahead")]
    examination = examine(write_table(folder / "poses.csv", few), LAMBERT, NOW)
    findings = [each for each in examination.findings if each.check == "pitch-zero"]
    assert {each.severity for each in findings} == {"error", "warning"}
    assert all('pitch_zero = "nadir"' in each.mend for each in findings)


def test_cameras_upside_down_are_told(folder: Path, rows: list[Row]) -> None:
    few = [{**row, "roll": 180.0} for row in of_camera(rows, "ahead")]
    examination = examine(write_table(folder / "poses.csv", few), LAMBERT, NOW)
    assert [each.severity for each in examination.findings if each.check == "roll"] == ["warning"]


@given(st.floats(-180.0, 180.0), st.floats(0.1, 20.0), st.integers(0, 2**31), st.integers(20, 200))
@settings(max_examples=100, deadline=None)
def test_the_main_direction_is_found_among_strays(
    direction: float, spread: float, seed: int, n: int
) -> None:
    rng = np.random.default_rng(seed)
    crowd = direction + rng.uniform(-spread, spread, n)
    strays = direction + 180.0 + rng.uniform(-10.0, 10.0, n // 4)
    found = main_direction(np.concatenate([crowd, strays]))
    assert abs(float(wrapped(np.array([found - direction]))[0])) <= spread + 1e-6


@given(st.lists(st.floats(-60.0, 60.0), min_size=1, max_size=50), st.floats(-360.0, 360.0))
@settings(max_examples=100, deadline=None)
def test_a_circular_mean_turns_with_its_directions(angles: list[float], turn: float) -> None:
    still = circular_mean(np.array(angles))
    moved = circular_mean(np.array(angles) + turn)
    assert abs(float(wrapped(np.array([moved - still - turn]))[0])) < 1e-6


@pytest.mark.parametrize(("year", "n_lost"), [("2020", 0), ("2005", 240), ("2031", 240)])
def test_magnetic_headings_of_days_without_a_model_are_told(year: str, n_lost: int) -> None:
    rows = [{**row, "time": str(row["time"]).replace("2020", year)} for row in good_rows()]
    lost = [each for each in check_norths(track(rows, north="magnetic"))
            if each.check == "north-unknown"]  # fmt: skip
    assert sum(len(each.uris) for each in lost) == n_lost
