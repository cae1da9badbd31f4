"""Tables of no known kind, by a mapping file."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from pictured import L93, pictured, pose_of
from scipy.spatial.transform import Rotation

from contracts.errors import BadConfig, BadSurvey
from geo.attitude import Attitude, enu_from_rdf
from survey import ReadOptions, Survey, read_survey
from survey.tables.mapping import read_mapping

COLUMNS = '[columns]\nfile = "Photo"\nx = "Ost"\ny = "Nord"\n'


def read(folder: Path, mapping: str, table: str, options: ReadOptions = L93) -> Survey:
    pictured(folder, "a.jpg", "b.jpg")
    (folder / "table.txt").write_text(table)
    return read_survey(folder / "table.txt", with_mapping(folder, mapping, options))


def with_mapping(folder: Path, mapping: str, options: ReadOptions = L93) -> ReadOptions:
    (folder / "mapping.toml").write_text(mapping)
    return replace(options, mapping=folder / "mapping.toml", format="table")


def test_columns_go_by_the_names_the_mapping_gives(tmp_path: Path) -> None:
    survey = read(tmp_path, COLUMNS, "Nord;Photo;Ost\n6862000;a.jpg;652000,5\n")
    assert pose_of(survey).easting == 652000.5


def test_columns_go_by_number_where_there_is_no_header(tmp_path: Path) -> None:
    mapping = 'header = false\nskip_lines = 2\nseparator = "whitespace"\n'
    mapping += "[columns]\nfile = 2\nx = 3\ny = 4\n"
    table = "made by hand\n\n7   a.jpg 652000  6862000\n8 b.jpg 652001 6862000\n"
    survey = read(tmp_path, mapping, table)
    assert len(survey.images) == 2
    assert pose_of(survey).easting == 652000.0


def test_a_column_number_beyond_the_table_is_refused(tmp_path: Path) -> None:
    mapping = "header = false\n[columns]\nfile = 1\nx = 2\ny = 9\n"
    with pytest.raises(BadSurvey, match=r"table\.txt: y is to be in column 9, but there are 3"):
        read(tmp_path, mapping, "a.jpg,652000,6862000\n")


def test_a_name_that_is_not_in_the_header_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadSurvey, match=r"table\.txt: .*\['Photo', 'Ost', 'y'\].*no column 'nord'"):
        read(tmp_path, COLUMNS, "Photo,Ost,y\na.jpg,652000,6862000\n")


@pytest.mark.parametrize(("unit", "turn"), [("deg", 360.0), ("grad", 400.0), ("rad", math.tau)])
def test_angles_are_in_their_unit(tmp_path: Path, unit: str, turn: float) -> None:
    mapping = f'{COLUMNS}heading = "h"\n[angles]\nunit = "{unit}"\n'
    survey = read(tmp_path, mapping, f"Photo,Ost,Nord,h\na.jpg,652000,6862000,{turn / 8!r}\n")
    assert pose_of(survey).heading_deg == pytest.approx(45.0)


@pytest.mark.parametrize(
    ("angles", "cells", "expected"),
    [
        ('heading_zero = "east"\nheading_turn = "counterclockwise"', "30,0,0", (60, 0, 0)),
        ('heading_zero = "south"', "30,0,0", (210, 0, 0)),
        ('pitch_zero = "nadir"', "30,95,0", (30, 5, 0)),
        ('pitch_sense = "down"\nroll_sense = "left_down"', "30,5,-3", (30, -5, 3)),
    ],
)
def test_zeros_and_senses_are_the_mappings(
    tmp_path: Path, angles: str, cells: str, expected: tuple[float, float, float]
) -> None:
    mapping = f'{COLUMNS}heading = "h"\npitch = "p"\nroll = "r"\n[angles]\n{angles}\n'
    pose = pose_of(read(tmp_path, mapping, f"Photo,Ost,Nord,h,p,r\na.jpg,652000,6862000,{cells}\n"))
    assert (pose.heading_deg, pose.pitch_deg, pose.roll_deg) == pytest.approx(expected)


AXES = {
    "rdf": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "rub": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "frd": [[0, 0, 1], [1, 0, 0], [0, 1, 0]],
    "flu": [[0, 0, 1], [-1, 0, 0], [0, -1, 0]],
}
"""Camera axes of a name, each written in right, down, forward: rows are the axes' letters."""


@pytest.mark.parametrize("axes", sorted(AXES))
@pytest.mark.parametrize("maps", ["world_from_camera", "camera_from_world"])
@pytest.mark.parametrize("form", ["row", "column", "quaternion"])
def test_rotations_of_every_convention_give_the_same_attitude(
    tmp_path: Path, axes: str, maps: str, form: str
) -> None:
    world_from_rdf = enu_from_rdf(Attitude(123.0, -7.0, 4.0))
    matrix = world_from_rdf @ Rotation.from_matrix(AXES[axes]).inv().as_matrix()
    if maps == "camera_from_world":
        matrix = matrix.T
    if form == "quaternion":
        names, x, y, z, w = ["qw", "qx", "qy", "qz"], *Rotation.from_matrix(matrix).as_quat()
        cells = [w, x, y, z]
    else:
        names = [f"m{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3)]
        cells = list((matrix if form == "row" else matrix.T).ravel())
    mapping = COLUMNS + "".join(f'{name} = "{name}"\n' for name in names)
    order = "column" if form == "column" else "row"
    mapping += f'[rotation]\naxes = "{axes}"\nmaps = "{maps}"\norder = "{order}"\n'
    table = ",".join(["Photo", "Ost", "Nord", *names]) + "\n"
    table += ",".join(["a.jpg", "652000", "6862000", *(repr(float(c)) for c in cells)]) + "\n"
    pose = pose_of(read(tmp_path, mapping, table))
    assert (pose.heading_deg, pose.pitch_deg, pose.roll_deg) == pytest.approx((123.0, -7.0, 4.0))


@pytest.mark.parametrize(
    ("time", "cell", "expected"),
    [
        ('format = "unix_ms"', "1588327200250", "2020-05-01T10:00:00.250Z"),
        ('format = "%d.%m.%Y %H:%M"\nzone = "Europe/Paris"', "01.05.2020 12:00", None),
        ('zone = "Europe/Paris"', "2020-01-01T12:00:00", "2020-01-01T12:00:00+01:00"),
        ('format = "unix_s"', "1e300", "none"),
        ('format = "unix_s"', "nan", "none"),
    ],
)
def test_times_are_read_as_the_mapping_says(
    tmp_path: Path, time: str, cell: str, expected: str | None
) -> None:
    mapping = f'{COLUMNS}time = "t"\n[time]\n{time}\n'
    survey = read(tmp_path, mapping, f"Photo,Ost,Nord,t\na.jpg,652000,6862000,{cell}\n")
    found = survey.images[0].captured_at
    assert found == (None if expected == "none" else expected or "2020-05-01T12:00:00+02:00")


def test_unknown_values_systems_and_norths_are_the_mappings(tmp_path: Path) -> None:
    mapping = f'crs = "EPSG:2154"\nnorth = "true"\nunknown = -1\n{COLUMNS}heading = "h"\n'
    survey = read(
        tmp_path,
        mapping,
        "Photo,Ost,Nord,h\na.jpg,652000,6862000,-1\nb.jpg,652000,6862000,3\n",
        replace(L93, crs=None),
    )
    assert pose_of(survey).heading_deg is None
    assert (pose_of(survey, "b.jpg").heading_deg, survey.crs) == (3.0, "EPSG:2154")
    assert pose_of(survey).north == "true"


def test_a_template_makes_the_path(tmp_path: Path) -> None:
    pictured(tmp_path, "images/front/7.jpg")
    mapping = f'{COLUMNS}camera = "c"\n[files]\ntemplate = "images/{{camera}}/{{file}}.jpg"\n'
    survey = read(tmp_path, mapping, "Photo,Ost,Nord,c\n7,652000,6862000,front\n")
    assert [image.uri for image in survey.images] == ["images/front/7.jpg"]


def test_a_template_leads_nowhere_else(tmp_path: Path) -> None:
    mapping = f'{COLUMNS}[files]\ntemplate = "../{{file}}"\n'
    table = "Photo,Ost,Nord\na.jpg,652000,6862000\n"
    with pytest.raises(BadSurvey, match="not one usable image"):
        read(tmp_path / "survey", mapping, table)


def test_a_mapping_chooses_the_table_of_a_folder(tmp_path: Path) -> None:
    pictured(tmp_path, "a.jpg")
    (tmp_path / "one.csv").write_text("Photo,Ost,Nord\na.jpg,652000,6862000\n")
    (tmp_path / "two.csv").write_text("Photo,Ost,Nord\na.jpg,652001,6862000\n")
    options = with_mapping(tmp_path, 'table = "two.csv"\n' + COLUMNS)
    assert pose_of(read_survey(tmp_path, options)).easting == 652001.0
    with pytest.raises(BadSurvey, match=r"'\.\./x\.csv' is not in it"):
        read_survey(tmp_path, with_mapping(tmp_path, 'table = "../x.csv"\n' + COLUMNS))


@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        (COLUMNS + "speed = 3\n", "columns.speed"),
        ("colour = 1\n" + COLUMNS, "colour is no key of a mapping"),
        (COLUMNS + '[angles]\nunits = "deg"\n', "angles.units is no key of a mapping"),
        (COLUMNS + '[angles]\nunit = "mil"\n', "angles.unit: Input should be 'deg'"),
        ("[columns]\nx = 1\ny = 2\n", "columns must name the file"),
        ("header = false\n" + COLUMNS, "without a header has columns by number"),
        (COLUMNS + "z = 0\n", "columns.z"),
        ('separator = "ab"\n' + COLUMNS, "separator: 'ab' is neither"),
        ('encoding = "klingon"\n' + COLUMNS, "encoding: 'klingon'"),
        (COLUMNS + '[time]\nzone = "Mars/Base"\n', "time.zone: 'Mars/Base'"),
        (COLUMNS + '[time]\nformat = "%Q"\n', "time.format: '%Q'"),
        (COLUMNS + '[files]\ntemplate = "{file.__class__}"\n', "files.template"),
        (COLUMNS + '[files]\ntemplate = "{camera}/{file}"\n', "columns name no camera"),
        (COLUMNS + "[columns]\n", "is not TOML"),
        ("", "columns is missing"),
        ('colums = {file = "file"}\n', "columns is missing; colums is no key of a mapping"),
    ],
)
def test_a_mapping_that_makes_no_sense_is_refused_by_key(
    tmp_path: Path, mapping: str, message: str
) -> None:
    (tmp_path / "mapping.toml").write_text(mapping)
    with pytest.raises(BadConfig, match=r"mapping\.toml") as caught:
        read_mapping(tmp_path / "mapping.toml")
    assert message in str(caught.value)


def test_a_mapping_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadConfig, match="cannot be read"):
        read_mapping(tmp_path / "mapping.toml")


def test_a_mapping_without_a_position_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadSurvey, match=r"table\.txt: no position"):
        read(tmp_path, '[columns]\nfile = "Photo"\n', "Photo,Ost\na.jpg,652000\n")


def test_a_mapping_also_names_the_columns_of_a_layer(tmp_path: Path) -> None:
    pictured(tmp_path, "a.jpg")
    feature = {
        "type": "Feature",
        "geometry": {"type": "Point", "coordinates": [2.34, 48.85]},
        "properties": {"Bild": "a.jpg", "Richtung": 100.0},
    }
    collection = {"type": "FeatureCollection", "features": [feature]}
    (tmp_path / "p.geojson").write_text(json.dumps(collection))
    mapping = '[columns]\nfile = "Bild"\nheading = "Richtung"\n[angles]\nunit = "grad"\n'
    pose = pose_of(read_survey(tmp_path, with_mapping(tmp_path, mapping, replace(L93, crs=None))))
    assert (pose.easting, pose.heading_deg) == (2.34, 90.0)
