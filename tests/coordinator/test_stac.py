"""Images as STAC items, held against PROJ, the magnetic model and published numbers."""

import math
from dataclasses import replace
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pygeomag
import pyproj
import pytest
from made_catalogue import ROW, ROWS, item

from coordinator.export.stac import FIRST_PHOTOGRAPH, item_id, utc_time


def test_an_azimuth_is_from_true_north() -> None:
    """The bearing by PROJ's geodesic of one metre along the grid."""
    heading = 90.0
    to_wgs84 = pyproj.Transformer.from_crs("EPSG:2154", "EPSG:4326", always_xy=True)
    here = to_wgs84.transform(652000.0, 6862000.0)
    there = to_wgs84.transform(652001.0, 6862000.0)
    azimuth, _, _ = pyproj.Geod(ellps="WGS84").inv(*here, *there)
    made = item(replace(ROW, heading_deg=heading))
    assert made["properties"]["view:azimuth"] == pytest.approx(azimuth, abs=1e-4)
    assert made["geometry"]["coordinates"] == pytest.approx(list(here), abs=1e-7)


def test_a_magnetic_heading_is_turned_by_the_declination_of_its_day() -> None:
    to_wgs84 = pyproj.Transformer.from_crs("EPSG:2154", "EPSG:4326", always_xy=True)
    lon, lat = to_wgs84.transform(652000.0, 6862000.0)
    field = pygeomag.GeoMag(base_year=2014.46).calculate(lat, lon, 0.04, 2014.46)
    azimuth = item(replace(ROW, north="magnetic"))["properties"]["view:azimuth"]
    assert azimuth == pytest.approx(90.0 + field.d, abs=0.05)


@pytest.mark.parametrize(("pitch", "off_nadir"), [(0.0, 90.0), (-90.0, 0.0), (-12.5, 77.5)])
def test_off_nadir_counts_from_straight_down(pitch: float, off_nadir: float) -> None:
    assert item(replace(ROW, pitch_deg=pitch))["properties"]["view:off_nadir"] == off_nadir


def test_a_camera_that_looks_up_has_no_off_nadir() -> None:
    """The extension ends at 90 degrees, the horizon."""
    assert "view:off_nadir" not in item(replace(ROW, pitch_deg=0.1))["properties"]


# The example item of the perspective imagery extension, v1.0.0: pers:rotation_matrix, and the
# omega, phi and kappa beside it.
PUBLISHED_MATRIX = np.array(
    [
        [-0.0008093675610926118, -0.9999994330272062, 0.0006920039141392195],
        [0.8193167887061168, -0.0002663743499306684, 0.5733410231171339],
        [-0.5733405137162795, 0.0010310140502592662, 0.8193165397705461],
    ]
)


def heading_pitch_roll(matrix: np.ndarray) -> tuple[float, float, float]:
    """Of a camera whose rows are right, up and back: by angles between directions."""
    right, axis = matrix[0], -matrix[2]
    heading = math.degrees(math.atan2(axis[0], axis[1]))
    pitch = math.degrees(math.asin(axis[2]))
    level_right = np.cross(axis, [0.0, 0.0, 1.0])
    level_right /= np.linalg.norm(level_right)
    level_down = np.cross(axis, level_right)
    roll = math.degrees(math.atan2(right @ level_down, right @ level_right))
    return heading % 360.0, pitch, roll


def test_a_rotation_matrix_is_that_of_the_extension_s_own_example() -> None:
    heading, pitch, roll = heading_pitch_roll(PUBLISHED_MATRIX)
    assert (round(heading), round(pitch)) == (90, -55)
    row = replace(
        ROW,
        easting=574271.56,
        northing=6223944.96,
        altitude_m=996.12,
        heading_deg=heading,
        pitch_deg=pitch,
        roll_deg=roll,
    )
    properties = item(row, "EPSG:25832")["properties"]
    assert np.allclose(
        np.reshape(properties["pers:rotation_matrix"], (3, 3)), PUBLISHED_MATRIX, atol=1e-9
    )
    assert properties["pers:crs"] == 25832
    assert properties["pers:perspective_center"] == [574271.56, 6223944.96, 996.12]


def test_a_true_heading_is_turned_into_the_axes_of_the_grid() -> None:
    to_wgs84 = pyproj.Proj("EPSG:2154")
    lon, lat = to_wgs84(652000.0, 6862000.0, inverse=True)
    convergence = to_wgs84.get_factors(lon, lat).meridian_convergence
    grid, true = (
        item(replace(ROW, heading_deg=heading, north=north))["properties"]
        for heading, north in ((90.0, "grid"), (90.0 + convergence, "true"))
    )
    assert true["pers:rotation_matrix"] == pytest.approx(grid["pers:rotation_matrix"], abs=1e-9)
    assert true["view:azimuth"] == pytest.approx(grid["view:azimuth"], abs=1e-6)


@pytest.mark.parametrize(
    "unknown", [{"altitude_m": None}, {"roll_deg": math.nan}, {"heading_deg": None}]
)
def test_a_pose_that_is_not_all_known_has_no_rotation(unknown: dict[str, float | None]) -> None:
    properties = item(replace(ROW, **unknown))["properties"]  # type: ignore[arg-type]
    assert "pers:rotation_matrix" not in properties
    assert properties["pers:perspective_center"][:2] == [652000.0, 6862000.0]


def test_a_system_without_a_code_is_written_out() -> None:
    crs = "+proj=tmerc +lat_0=48 +lon_0=2 +ellps=GRS80 +towgs84=0,0,0 +units=m"
    properties = item(replace(ROW, easting=100.0, northing=200.0), crs)["properties"]
    assert pyproj.CRS.from_json_dict(properties["pers:crs"]).is_projected


def test_an_image_has_no_projection_of_its_own() -> None:
    properties = item(ROW)["properties"]
    assert properties["proj:code"] is None
    assert properties["proj:shape"] == [1080, 1920]


def test_an_asset_leads_to_the_image(tmp_path: Path) -> None:
    path = tmp_path / "a #1 % 明.jpg"
    path.touch()
    asset = item(replace(ROW, path=str(path)))["assets"]["image"]
    assert asset["type"] == "image/jpeg"
    parts = urlsplit(asset["href"])
    assert (parts.scheme, parts.netloc, parts.fragment) == ("file", "", "")
    assert Path(unquote(parts.path)).is_file()
    message = item(ROWS[4])["assets"]["image"]
    assert message["href"] == "file:///survey/drive.mcap#topic=%2Fcam&time_ns=17&record=9"
    assert "type" not in message


def test_a_time_is_in_utc_and_without_one_the_interval_is_true() -> None:
    assert item(ROW)["properties"]["datetime"] == "2014-06-16T08:00:00.000000Z"
    times = item(replace(ROW, captured_at=None))["properties"]
    assert times["datetime"] is None
    assert (times["start_datetime"], times["end_datetime"]) == (
        FIRST_PHOTOGRAPH,
        "2024-02-29T12:00:00.000000Z",
    )


@pytest.mark.parametrize("text", ["", "yesterday", "2014-06-16T10:00:00", "0001-01-01T00:00+05:00"])
def test_what_is_no_moment_with_a_zone_is_none(text: str) -> None:
    assert utc_time(text) is None


def test_ids_are_names_of_files_whatever_the_uri() -> None:
    uris = ["a.jpg", "b/a.jpg", "x" * 5000, "明信片", "\udce9.jpg", "../../etc/passwd"]
    ids = {item_id(uri) for uri in uris}
    assert len(ids) == len(uris)
    assert all(len(each) == 32 and int(each, 16) >= 0 for each in ids)
