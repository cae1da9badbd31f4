"""What the doctor says of positions, coordinate systems, heights and spacing."""

from pathlib import Path

import numpy as np
import pytest
from doctored_survey import (
    EAST_M,
    NORTH_M,
    NOW,
    Row,
    at,
    good_rows,
    of_camera,
    write_pictures,
    write_table,
)

from survey import ReadOptions
from survey.doctor import Examination, Finding, examine

LAMBERT = ReadOptions(crs="EPSG:2154")
DEGREES = ReadOptions(crs="EPSG:4326")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("survey")
    write_pictures(folder, good_rows())
    return folder


@pytest.fixture
def rows() -> list[Row]:
    return good_rows()


def examined(folder: Path, rows: list[Row], options: ReadOptions = LAMBERT) -> Examination:
    return examine(write_table(folder / "poses.csv", rows), options, NOW)


def shifted(rows: list[Row], x: float, y: float) -> list[Row]:
    """The same survey with its first position at x, y."""
    return [
        {**row, "x": float(row["x"]) - EAST_M + x, "y": float(row["y"]) - NORTH_M + y}
        for row in rows
    ]


def found(examination: Examination, check: str) -> Finding:
    """The one finding of a check."""
    (finding,) = [each for each in examination.findings if each.check == check]
    return finding


def test_a_good_survey_has_nothing_worse_than_notes(folder: Path, rows: list[Row]) -> None:
    examination = examined(folder, rows)
    assert [each for each in examination.findings if each.severity != "note"] == []
    figures = examination.figures
    assert (figures.images, figures.posed, figures.skipped) == (240, 240, 0)
    assert figures.cameras == ("ahead", "back", "left", "right")
    assert figures.first_day == figures.last_day == "2020-06-01"
    assert figures.spacing_m == pytest.approx(5.0, abs=0.1)


def test_swapped_axes_are_told_by_where_the_swap_lies(folder: Path, rows: list[Row]) -> None:
    for row in rows:
        row["x"], row["y"] = row["y"], row["x"]
    finding = found(examined(folder, rows), "swapped-axes")
    assert finding.severity == "error"
    assert "with x and y swapped all 240 lie within France" in finding.what
    assert "--mapping" in finding.mend


def test_swapped_degrees_are_told_by_the_sea(folder: Path, rows: list[Row]) -> None:
    degrees = at(rows, 2.35, 48.85)
    for row in degrees:
        row["x"], row["y"] = row["y"], row["x"]
    examination = examined(folder, degrees, DEGREES)
    finding = found(examination, "swapped-axes")
    assert finding.severity == "warning"
    assert "France" in finding.what


@pytest.mark.parametrize(
    "place",
    [(2.35, 48.85), (-0.12, 51.5), (-74.0, 40.7), (139.7, 35.7), (151.2, -33.9), (18.4, -33.9),
     (-46.6, -23.5), (103.8, 1.35), (178.4, -18.1), (-157.8, 21.3)],
)  # fmt: skip
def test_cities_are_not_taken_for_swapped(
    folder: Path, rows: list[Row], place: tuple[float, float]
) -> None:
    few = at(of_camera(rows, "ahead")[:15], *place)
    checks = {each.check for each in examined(folder, few, DEGREES).findings}
    assert "swapped-axes" not in checks


def test_the_right_system_is_suggested_for_a_wrong_one(folder: Path, rows: list[Row]) -> None:
    finding = found(examined(folder, rows, ReadOptions(crs="EPSG:2056")), "wrong-crs")
    assert finding.severity == "error"
    assert "EPSG:2154 (RGF93 v1 / Lambert-93)" in finding.what
    assert finding.mend.startswith("--crs EPSG:2154")


def test_the_right_system_is_suggested_where_none_is_given(folder: Path, rows: list[Row]) -> None:
    examination = examined(folder, rows, ReadOptions())
    assert "without a coordinate system" in found(examination, "refused").what
    assert found(examination, "wrong-crs").mend.startswith("--crs EPSG:2154")


def test_metres_called_degrees_are_examined_though_no_image_can_be_used(
    folder: Path, rows: list[Row]
) -> None:
    examination = examined(folder, rows, DEGREES)
    assert "EPSG:2154" in found(examination, "wrong-crs").what
    assert found(examination, "not-checked").severity == "note"


def test_degrees_called_metres_are_told(folder: Path, rows: list[Row]) -> None:
    finding = found(examined(folder, at(rows, 2.35, 48.85)), "wrong-crs")
    assert "EPSG:4326" in finding.mend


def test_rows_far_outside_are_named(folder: Path, rows: list[Row]) -> None:
    rows[7]["x"] = 9e6
    finding = found(examined(folder, rows), "outside-area")
    assert finding.uris == (rows[7]["file"],)


def test_a_position_that_jumps_away_and_back_is_named(folder: Path, rows: list[Row]) -> None:
    rows[40]["x"] = float(rows[40]["x"]) + 90.0
    finding = found(examined(folder, rows), "position-jump")
    assert finding.uris == (rows[40]["file"],)
    assert "by 8" in finding.what or "by 9" in finding.what


def test_a_speed_no_car_has_is_told_once(folder: Path, rows: list[Row]) -> None:
    for row in rows[120:]:
        row["x"] = float(row["x"]) + 1500.0
    finding = found(examined(folder, rows), "speed")
    assert len(finding.uris) == 4  # a camera each


def test_another_place_is_far_away(folder: Path, rows: list[Row]) -> None:
    for row in rows[-8:]:
        row["y"] = float(row["y"]) - 80_000.0
    finding = found(examined(folder, rows), "far-away")
    assert set(finding.uris) == {row["file"] for row in rows[-8:]}


def test_null_island_is_an_error(folder: Path, rows: list[Row]) -> None:
    degrees = at(rows, 2.35, 48.85)
    degrees[11] |= {"x": 0.0, "y": 0.0}
    finding = found(examined(folder, degrees, DEGREES), "null-island")
    assert finding.severity in {"error", "warning"}
    assert finding.uris[0].endswith(str(degrees[11]["file"]))


def test_a_height_of_zero_throughout_was_not_measured(folder: Path, rows: list[Row]) -> None:
    finding = found(examined(folder, [{**row, "z": 0.0} for row in rows]), "height")
    assert (finding.severity, "hardly measured" in finding.what) == ("warning", True)


def test_single_heights_of_zero_are_named(folder: Path, rows: list[Row]) -> None:
    rows[50]["z"] = 0.0
    finding = found(examined(folder, rows), "height")
    assert finding.uris == (rows[50]["file"],)


def test_heights_far_below_the_sea_are_told(folder: Path, rows: list[Row]) -> None:
    finding = found(
        examined(folder, [{**row, "z": float(row["z"]) - 90.0} for row in rows]), "height"
    )
    assert "below -30 m" in finding.what


def test_a_height_that_jumps_is_told(folder: Path, rows: list[Row]) -> None:
    for row in rows[100:]:
        row["z"] = float(row["z"]) + 60.0
    finding = found(examined(folder, rows), "height-jump")
    assert len(finding.uris) == 4


def test_an_unknown_vertical_datum_is_a_note(folder: Path, rows: list[Row]) -> None:
    finding = found(examined(folder, rows), "height-datum")
    assert (finding.severity, finding.mend[:20]) == ("note", "--crs EPSG:2154+5720")


@pytest.mark.parametrize(
    ("crs", "place", "mend"),
    [("EPSG:4326", (2.35, 48.85), "--crs EPSG:4979, if"),
     ("EPSG:27700", (530_000.0, 180_000.0), "--crs with the heights' system"),
     ("EPSG:32631", (452_000.0, 5_411_000.0), "--crs with the heights' system"),
     ("EPSG:3949", (1_652_000.0, 8_180_000.0), "--crs EPSG:3949+5720, if")],
)  # fmt: skip
def test_the_height_system_that_is_advised_fits_the_place(
    folder: Path, rows: list[Row], crs: str, place: tuple[float, float], mend: str
) -> None:
    few = of_camera(rows, "ahead")
    few = at(few, *place) if abs(place[0]) < 180.0 else shifted(few, *place)
    finding = found(examined(folder, few, ReadOptions(crs=crs)), "height-datum")
    assert finding.mend.startswith(mend)
    assert "2154" not in finding.what + finding.mend


def test_no_option_tells_from_what_the_heights_of_photographs_count(test_data: Path) -> None:
    examination = examine(test_data / "gps-photos" / "lund", ReadOptions(), NOW)
    assert found(examination, "height-datum").mend == ""


@pytest.mark.parametrize(
    ("crs", "place", "grid", "severity"),
    [("EPSG:4267", (-74.0, 40.7), "us_noaa_conus.tif", "warning"),
     ("EPSG:27700", (530_000.0, 180_000.0), "uk_os_OSTN15_NTv2_OSGBtoETRS.tif", "note")],
)  # fmt: skip
def test_missing_grids_are_told_with_what_they_would_bring(
    folder: Path, rows: list[Row], crs: str, place: tuple[float, float], grid: str, severity: str
) -> None:
    """Grids that pyproj's wheel does not bring: NAD27 lies 10 m off without, OSGB36 2 m."""
    degrees = abs(place[0]) < 180.0
    few = of_camera(rows, "ahead")
    few = at(few, *place) if degrees else shifted(few, *place)
    finding = found(examined(folder, few, ReadOptions(crs=crs)), "datum-grids")
    assert finding.severity == severity
    assert grid in finding.what
    assert finding.mend == f"pyproj sync --file {grid}"


def test_a_conversion_nobody_knows_is_an_error_or_as_allowed_a_warning(
    folder: Path, rows: list[Row]
) -> None:
    """A system on a sphere of its own, with no shift to WGS 84."""
    few = shifted(of_camera(rows, "ahead"), 0.0, 0.0)
    crs = "+proj=tmerc +lat_0=48 +lon_0=2 +ellps=airy +units=m +no_defs +type=crs"
    refused = examined(folder, few, ReadOptions(crs=crs))
    assert found(refused, "refused").severity == "error"
    assert "wrong-crs" not in {each.check for each in refused.findings}
    allowed = examined(folder, few, ReadOptions(crs=crs, allow_ballpark=True))
    assert found(allowed, "datum").severity == "warning"


def test_uneven_spacing_is_a_note(folder: Path, rows: list[Row]) -> None:
    few = [row for number, row in enumerate(rows) if number < 80 or number % 32 < 4]
    assert "uneven" in found(examined(folder, few), "spacing").what
    assert "uneven" not in found(examined(folder, rows), "spacing").what


def test_nothing_depends_on_the_order_of_the_rows(folder: Path, rows: list[Row]) -> None:
    rows[40]["x"] = float(rows[40]["x"]) + 90.0
    rows[33]["heading"] = (float(rows[33]["heading"]) + 180.0) % 360.0
    rows[90]["time"] = "2030-01-01T00:00:00Z"
    first = examined(folder, rows)
    shuffled = [rows[at] for at in np.random.default_rng(1).permutation(len(rows))]
    second = examined(folder, shuffled)
    assert second.findings == first.findings
    assert second.figures == first.figures
