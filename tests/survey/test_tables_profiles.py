"""Tables of other makes, written here by the csv and json modules as their makers document them."""

import csv
import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pictured import AS_IT_IS, L93, pictured, pose_of, reasons
from pyproj import Transformer
from scipy.spatial.transform import Rotation

from contracts.errors import BadSurvey, UnknownCrs
from survey import Survey, read_survey


def written(
    folder: Path,
    header: Sequence[str] | None,
    *rows: Sequence[object],
    name: str = "poses.csv",
    delimiter: str = ",",
) -> Path:
    pictured(folder, "a.jpg", "b.jpg")
    with (folder / name).open("w", newline="") as file:
        writer = csv.writer(file, delimiter=delimiter)
        writer.writerows([*([] if header is None else [header]), *rows])
    return folder


def close(survey: Survey, heading: float, pitch: float, roll: float) -> bool:
    pose = pose_of(survey)
    found = (pose.heading_deg, pose.pitch_deg, pose.roll_deg)
    return found == pytest.approx((heading, pitch, roll), abs=1e-6)


MAPILLARY = [
    {
        "filename": "/home/me/drive/a.jpg",
        "filetype": "image",
        "MAPLatitude": 48.85,
        "MAPLongitude": 2.34,
        "MAPAltitude": 40.5,
        "MAPCaptureTime": "2020_05_01_10_00_00_123",
        "MAPCompassHeading": {"TrueHeading": 271.5, "MagneticHeading": 270.0},
        "MAPGPSAccuracyMeters": 3.5,
    },
    {
        "filename": "/home/me/drive/b.jpg",
        "error": {"type": "MapillaryGeoTaggingError", "message": "no GPS"},
        "filetype": "image",
    },
]


def test_a_mapillary_description_is_read(tmp_path: Path) -> None:
    pictured(tmp_path, "sub/a.jpg", "b.jpg")
    (tmp_path / "mapillary_image_description.json").write_text(json.dumps(MAPILLARY))
    survey = read_survey(tmp_path, AS_IT_IS)
    pose = pose_of(survey, "sub/a.jpg")
    assert (pose.easting, pose.northing, pose.altitude_m) == (2.34, 48.85, 40.5)
    assert (pose.heading_deg, pose.north, pose.crs) == (271.5, "true", "EPSG:4326")
    assert pose.position_error_m == 3.5
    assert survey.images[0].captured_at == "2020-05-01T10:00:00.123Z"
    assert "no GPS" in reasons(survey)["b.jpg"]


def test_mapillary_headings_that_are_all_zero_were_not_measured(tmp_path: Path) -> None:
    pictured(tmp_path, "a.jpg")
    entry = MAPILLARY[0] | {"MAPCompassHeading": {"TrueHeading": 0.0, "MagneticHeading": 0.0}}
    (tmp_path / "mapillary_image_description.json").write_text(json.dumps([entry]))
    survey = read_survey(tmp_path, AS_IT_IS)
    assert pose_of(survey).heading_deg is None
    assert any("every heading is exactly 0" in note for note in survey.notes)


def test_a_mapillary_heading_of_zero_among_others_is_north(tmp_path: Path) -> None:
    header = ["filename", "MAPLatitude", "MAPLongitude", "MAPCompassHeading.TrueHeading"]
    root = written(tmp_path, header, ["a.jpg", 48, 2, 0], ["b.jpg", 48, 2, 10])
    assert pose_of(read_survey(root, AS_IT_IS)).heading_deg == 0.0


def test_a_panoramax_table_is_read(tmp_path: Path) -> None:
    header = [
        "file",
        "lon",
        "lat",
        "capture_time",
        "Exif.GPSInfo.GPSImgDirection",
        "Exif.Image.Artist",
    ]
    rows = [
        ["a.jpg", 2.34, 48.85, "2023-01-12T12:00:00.5Z", "17750/100", "Me"],
        ["b.jpg", "", "", "2023-01-12T12:00:01", "", "Me"],
    ]
    survey = read_survey(written(tmp_path, header, *rows, name="_panoramax.csv"), AS_IT_IS)
    assert (pose_of(survey).easting, pose_of(survey).heading_deg) == (2.34, 177.5)
    assert survey.images[0].captured_at == "2023-01-12T12:00:00.500Z"
    assert "coordinates are empty" in reasons(survey)["b.jpg"]
    assert any("1 of 2 times have no zone" in note for note in survey.notes)


ARCGIS = [
    *("OBJECTID", "Name", "ImagePath", "X", "Y", "Z", "SRS", "CameraHeading", "CameraPitch"),
    *("CameraRoll", "HorizontalFieldOfView", "VerticalFieldOfView", "AcquisitionDate"),
]


def test_an_oriented_imagery_table_is_read(tmp_path: Path) -> None:
    path = r"\\server\share\drive\a.jpg"
    cells = [1, "a", path, 652000, 6862000, 40, 2154, 90, 95, -3, 70, 50, 1588327200123]
    survey = read_survey(written(tmp_path, ARCGIS, cells), AS_IT_IS)
    assert close(survey, 90, 5, -3)
    assert (pose_of(survey).crs, survey.images[0].camera.hfov_deg) == ("EPSG:2154", 70.0)
    assert survey.images[0].captured_at == "2020-05-01T10:00:00.123Z"


def test_unknown_values_of_oriented_imagery_are_not_known(tmp_path: Path) -> None:
    cells = [1, "a", "a.jpg", 260000, 6250000, 0, 102100, -999, -999, -999, -999, -999, ""]
    survey = read_survey(written(tmp_path, ARCGIS, cells), AS_IT_IS)
    pose = pose_of(survey)
    assert (pose.heading_deg, pose.pitch_deg, pose.roll_deg) == (None, None, None)
    assert survey.images[0].camera.hfov_deg is None
    assert pose.crs in {"ESRI:102100", "EPSG:3857"}


def test_a_path_of_another_machine_needs_a_name_that_only_one_image_has(tmp_path: Path) -> None:
    pictured(tmp_path, "one/a.jpg", "two/a.jpg")
    cells = [1, "a", r"C:\drive\a.jpg", 652000, 6862000, 40, 2154, 90, 95, -3, 70, 50, ""]
    root = written(tmp_path, ARCGIS, cells)
    (root / "a.jpg").unlink()
    with pytest.raises(BadSurvey, match=r"not a path within the survey|no row"):
        read_survey(root, AS_IT_IS)


NAVVIS = (
    "# pano poses v1.0: ID; filename; timestamp; pano_pos_x; pano_pos_y; pano_pos_z; "
    "pano_ori_w; pano_ori_x; pano_ori_y; pano_ori_z\n"
    "0; a.jpg; 1455816514.953352; 652000.15; 6862000.05; 1.855066; 1; 0; 0; 0\n"
    "1; b.jpg; 1455816529.513326; 652000.02; 6862000.03; 1.855066; 0.7071068; 0; 0; 0.7071068\n"
)


def test_navvis_poses_are_read(tmp_path: Path) -> None:
    pictured(tmp_path, "a.jpg", "b.jpg")
    (tmp_path / "pano-poses.csv").write_text(NAVVIS)
    survey = read_survey(tmp_path, L93)
    assert close(survey, 90, 0, 0)  # x is forward and, in the survey's system, east
    assert pose_of(survey, "b.jpg").heading_deg == pytest.approx(0.0, abs=1e-4)  # a quarter left
    assert survey.images[0].captured_at == "2016-02-18T17:28:34.953352Z"


def test_navvis_poses_without_a_system_are_refused(tmp_path: Path) -> None:
    pictured(tmp_path, "a.jpg", "b.jpg")
    (tmp_path / "pano-poses.csv").write_text(NAVVIS)
    with pytest.raises(UnknownCrs, match="pano_pos_x"):
        read_survey(tmp_path, AS_IT_IS)


def test_a_quaternion_of_no_length_or_too_much_is_a_fault(tmp_path: Path) -> None:
    header = ["filename", "pano_pos_x", "pano_pos_y"] + [f"pano_ori_{c}" for c in "wxyz"]
    rows = [["a.jpg", 652000, 6862000, 1, 0, 0, 0], ["b.jpg", 652000, 6862000, 0, 0, 0, 0]]
    survey = read_survey(written(tmp_path, header, *rows), L93)
    assert reasons(survey)["b.jpg"] == (
        "poses.csv row 3: qw, qx, qy, qz have the length 0, expected 1"
    )


RIPROCESS = (
    "Timestamp,Filename,Origin (Easting[m],Northing[m],Height[m]),"
    "Direction (Easting[m],Northing[m],Height[m]),Up (Easting[m],Northing[m],Height[m]),"
    "Roll(X)[deg],Pitch(Y)[deg],Yaw(Z)[deg],Omega[deg],Phi[deg],Kappa[deg]\n"
)


def test_a_riprocess_camera_table_is_read(tmp_path: Path) -> None:
    pictured(tmp_path, "a.jpg")
    cells = "186594.2,a.jpg,652000.5,6862000.25,40,0,1,0,0,0,1,9,9,9,90,0,0\n"
    (tmp_path / "poses.csv").write_text(RIPROCESS + cells)
    survey = read_survey(tmp_path, L93)
    pose = pose_of(survey)
    assert (pose.easting, pose.northing, pose.altitude_m) == (652000.5, 6862000.25, 40.0)
    assert close(survey, 0, 0, 0)  # omega 90 lifts a camera that looked down to the north


def test_an_older_riprocess_table_has_yaw_alone(tmp_path: Path) -> None:
    pictured(tmp_path, "a.jpg")
    header = "Timestamp,Filename,Origin (X,Y,Z),Direction (X,Y,Z),Up (X,Y,Z),"
    header += "Roll(X),Pitch(Y),Yaw(Z)\n"
    cells = "186594.2,a.jpg,652000.5,6862000.25,40,0,1,0,0,0,1,-2,3,45\n"
    (tmp_path / "poses.csv").write_text(header + cells)
    survey = read_survey(tmp_path, L93)
    assert (pose_of(survey).easting, pose_of(survey).altitude_m) == (652000.5, 40.0)
    assert close(survey, 45, 3, -2)


PEGASUS = "a.jpg;486957.765;652000.326;6862000.412;67.6;{angles};{matrix}\n"


def world_from_camera(omega: float, phi: float, kappa: float) -> np.ndarray:
    return Rotation.from_euler("XYZ", [omega, phi, kappa], degrees=True).as_matrix()


@pytest.mark.parametrize("transposed", [False, True])
def test_a_pegasus_table_has_neither_header_nor_contradiction(
    tmp_path: Path, transposed: bool
) -> None:
    matrix = world_from_camera(80, -10, 20)
    written_matrix = (matrix if transposed else matrix.T).ravel()  # column after column
    pictured(tmp_path, "a.jpg")
    text = PEGASUS.format(angles="80;-10;20", matrix=";".join(map(repr, written_matrix.tolist())))
    (tmp_path / "External Orientation.csv").write_text(text)
    survey = read_survey(tmp_path, L93)
    axis = -matrix[:, 2]  # a photogrammetric camera looks along its negative z
    assert pose_of(survey).heading_deg == pytest.approx(
        math.degrees(math.atan2(axis[0], axis[1])) % 360
    )
    assert pose_of(survey).pitch_deg == pytest.approx(math.degrees(math.asin(axis[2])))
    assert survey.notes == ()


def test_a_matrix_that_contradicts_the_angles_is_told(tmp_path: Path) -> None:
    pictured(tmp_path, "a.jpg")
    text = PEGASUS.format(angles="80;-10;20", matrix="1;0;0;0;1;0;0;0;1")
    (tmp_path / "poses.csv").write_text(text)
    assert any("another attitude" in note for note in read_survey(tmp_path, L93).notes)


def matrix_header() -> list[str]:
    return ["Filename", "Easting", "Northing", "Height"] + [
        f"M{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)
    ]


def test_a_matrix_says_what_its_angles_say(tmp_path: Path) -> None:
    matrix = world_from_camera(85, 12, -7)
    cells = ["a.jpg", 652000, 6862000, 40, *matrix.ravel().tolist()]
    by_matrix = read_survey(written(tmp_path / "m", matrix_header(), cells), L93)
    header = ["file", "x", "y", "z", "omega", "phi", "kappa"]
    by_angles = read_survey(
        written(tmp_path / "o", header, ["a.jpg", 652000, 6862000, 40, 85, 12, -7]), L93
    )
    pose = pose_of(by_angles)
    assert pose.heading_deg is not None
    assert pose.pitch_deg is not None
    assert pose.roll_deg is not None
    assert close(by_matrix, pose.heading_deg, pose.pitch_deg, pose.roll_deg)


def test_a_matrix_that_turns_nothing_is_a_fault(tmp_path: Path) -> None:
    rows = [
        ["a.jpg", 652000, 6862000, 40, *np.eye(3).ravel()],
        ["b.jpg", 652000, 6862000, 40, *(2 * np.eye(3)).ravel()],
    ]
    survey = read_survey(written(tmp_path, matrix_header(), *rows), L93)
    assert "m11 to m33 are no rotation matrix" in reasons(survey)["b.jpg"]


def test_a_stereopolis_table_is_in_lambert_93_and_of_true_north(tmp_path: Path) -> None:
    header = [
        *("file", "pan_xml_easting", "pan_xml_northing", "pan_xml_altitude"),
        *("pan_xml_heading", "pan_xml_roll", "pan_xml_pitch"),
    ]
    root = written(tmp_path, header, ["a.jpg", 651187.76, 6861379.05, 39.39, 176.1, 0.1, 1.2])
    pose = pose_of(read_survey(root, AS_IT_IS))
    assert (pose.crs, pose.north, pose.heading_deg) == ("EPSG:2154", "true", 176.1)


def test_a_quaternion_whose_axes_nobody_explains_is_told_and_left(tmp_path: Path) -> None:
    header = ["file", "x", "y", "qw", "qx", "qy", "qz"]
    root = written(tmp_path, header, ["a.jpg", 652000, 6862000, 1, 0, 0, 0])
    survey = read_survey(root, L93)
    assert pose_of(survey).heading_deg is None
    assert any("qw, qx, qy, qz are not used" in note for note in survey.notes)


def test_omega_phi_kappa_in_degrees_are_understood_without_a_profile(tmp_path: Path) -> None:
    header = ["file", "x", "y", "omega", "phi", "kappa"]
    root = written(tmp_path, header, ["a.jpg", 652000, 6862000, 0, 0, 0])
    assert pose_of(read_survey(root, L93)).pitch_deg == pytest.approx(-90.0)  # straight down


def test_rows_in_several_systems_are_converted_into_the_most_frequent(tmp_path: Path) -> None:
    header = ["file", "x", "y", "crs", "heading"]
    rows = [
        ["a.jpg", 652000, 6862000, "EPSG:2154", 10],
        ["b.jpg", 652010, 6862000, "2154", 10],
        ["c.jpg", 449032.42, 5411920.63, "EPSG:32631", 10],
        ["d.jpg", 652000, 6862000, "", 10],
        ["e.jpg", 652000, 6862000, "EPSG:999999", 10],
    ]
    pictured(tmp_path, "c.jpg", "d.jpg", "e.jpg")
    survey = read_survey(written(tmp_path, header, *rows), AS_IT_IS)
    assert survey.crs == "EPSG:2154"
    converted = pose_of(survey, "c.jpg")
    assert converted.crs == "EPSG:2154"
    directly = Transformer.from_crs("EPSG:32631", "EPSG:2154", always_xy=True)
    there = directly.transform(449032.42, 5411920.63)
    assert (converted.easting, converted.northing) == pytest.approx(there, abs=0.001)
    # 0.695 degrees west of both central meridians: UTM's grid turns by sin(latitude) of it,
    # Lambert-93's by its cone constant
    lon_deg = 3 - 0.6946
    turn = (lon_deg - 3) * (math.sin(math.radians(48.858)) - 0.7256077650)
    assert converted.heading_deg == pytest.approx(10 + turn, abs=0.002)
    assert turn < -0.01
    (note,) = survey.notes
    assert note.startswith("poses.csv, 1 rows: converted from EPSG:32631 into EPSG:2154 by ")
    assert "UTM zone 31N" in note
    assert re.search(r"\((to \d+ m|of unknown accuracy)\)$", note)
    assert reasons(survey)["d.jpg"] == "poses.csv row 5 column 'crs': no coordinate system"
    assert "EPSG:999999" in reasons(survey)["e.jpg"]


def test_a_row_s_altitude_from_another_level_is_dropped(tmp_path: Path) -> None:
    rows = [
        ["a.jpg", 652000, 6862000, 40, "EPSG:5698"],
        ["b.jpg", 652010, 6862000, 40, "EPSG:5698"],
        ["c.jpg", 449032.42, 5411920.63, 84, "EPSG:32631"],
    ]
    pictured(tmp_path, "c.jpg")
    survey = read_survey(written(tmp_path, ["file", "x", "y", "z", "crs"], *rows), AS_IT_IS)
    assert pose_of(survey).altitude_m == 40.0
    assert pose_of(survey, "c.jpg").altitude_m is None
    assert any("poses.csv, 1 rows: 1 altitudes dropped" in note for note in survey.notes)


def test_a_row_s_system_of_unknown_accuracy_needs_the_user_s_word(tmp_path: Path) -> None:
    rows = [["a.jpg", 652000, 6862000, 2154], ["b.jpg", 652010, 6862000, 2154]]
    nameless = "+proj=utm +zone=31 +ellps=intl +units=m"
    rows.append(["c.jpg", 449032.42, 5411920.63, nameless])
    pictured(tmp_path, "c.jpg")
    root = written(tmp_path, ["file", "x", "y", "crs"], *rows)
    assert "--allow-ballpark" in reasons(read_survey(root, AS_IT_IS))["c.jpg"]
    survey = read_survey(root, replace(AS_IT_IS, allow_ballpark=True))
    assert pose_of(survey, "c.jpg").crs == "EPSG:2154"


def test_a_column_that_says_an_impossible_angle_is_named(tmp_path: Path) -> None:
    header = ["file", "lon", "lat", "Pitch[deg]"]
    rows = [["a.jpg", 2.25, 48.85, 120], ["b.jpg", 2.25, 148.85, 0]]
    with pytest.raises(BadSurvey, match=r"poses\.csv row 2 column 'Pitch\[deg\]': pitch is 120"):
        read_survey(written(tmp_path, header, *rows[:1]), AS_IT_IS)
    with pytest.raises(BadSurvey, match=r"poses\.csv row 2 column 'lat': longitude 2\.25"):
        read_survey(written(tmp_path, header, *rows[1:]), AS_IT_IS)


def test_a_system_in_the_table_that_the_user_contradicts_is_refused(tmp_path: Path) -> None:
    root = written(tmp_path, ["file", "x", "y", "srs"], ["a.jpg", 652000, 6862000, 2154])
    with pytest.raises(BadSurvey, match=r"poses\.csv is in EPSG:2154.*--crs says EPSG:3857"):
        read_survey(root, replace(L93, crs="EPSG:3857"))
    assert pose_of(read_survey(root, L93)).crs == "EPSG:2154"


@pytest.mark.parametrize("crs", ["EPSG:4258", "EPSG:2154+5720", "EPSG:4979"])
def test_geographic_and_compound_systems_are_accepted(tmp_path: Path, crs: str) -> None:
    projected = "2154" in crs
    names = ["x", "y"] if projected else ["lon", "lat"]
    cells = ["a.jpg", 652000, 6862000] if projected else ["a.jpg", 2.34, 48.85]
    root = written(tmp_path, ["file", *names], cells)
    pose = pose_of(read_survey(root, replace(L93, crs=crs)))
    assert pose.north == ("grid" if projected else "true")


def test_half_an_attitude_is_none(tmp_path: Path) -> None:
    header = ["file", "x", "y", "omega", "phi", "kappa"]
    rows = [["a.jpg", 652000, 6862000, "", "", ""], ["b.jpg", 652000, 6862000, 90, "", 0]]
    survey = read_survey(written(tmp_path, header, *rows), L93)
    assert pose_of(survey).heading_deg is None
    assert reasons(survey)["b.jpg"] == (
        "poses.csv row 3: phi not given, but the rest of the attitude"
    )
