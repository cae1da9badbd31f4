from pathlib import Path

import pytest
from PIL import Image

from contracts.errors import BadSurvey, UnknownCrs
from contracts.records import Pose
from survey import ReadOptions, Survey, read_survey

L93 = ReadOptions(crs="EPSG:2154")


def survey_of(folder: Path, table: str | bytes, *names: str, table_name: str = "poses.csv") -> Path:
    for name in names or ("a.jpg",):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.new("RGB", (4, 4)).save(path)
    data = table if isinstance(table, bytes) else table.encode()
    (folder / table_name).write_bytes(data)
    return folder


def poses(survey: Survey) -> dict[str, Pose | None]:
    return {image.uri: image.pose for image in survey.images}


def reasons(survey: Survey) -> dict[str, str]:
    return {skip.uri: skip.reason for skip in survey.skipped}


def test_every_column_arrives_where_it_belongs(tmp_path: Path) -> None:
    root = survey_of(
        tmp_path,
        "file,x,y,z,heading,pitch,roll,time,camera,hfov,note\n"
        "a.jpg,652000.5,6862000.25,40,-90,1.5,-2,2020-05-01T10:00:00.250+02:00,front,70,hello\n",
    )
    (image,) = read_survey(root, L93).images
    assert image.pose == Pose(
        652000.5, 6862000.25, "EPSG:2154", 40.0, 270.0, 1.5, -2.0, north="grid"
    )
    assert (image.camera.name, image.camera.hfov_deg) == ("front", 70.0)
    assert image.captured_at == "2020-05-01T10:00:00.250+02:00"


def test_unknown_cells_are_not_known(tmp_path: Path) -> None:
    root = survey_of(tmp_path, "image,lon,lat,z,heading,time\na.jpg,2.3,48.8,,,2020-05-01 10:00\n")
    (image,) = read_survey(root, ReadOptions()).images
    assert image.pose == Pose(2.3, 48.8, "EPSG:4326", north="true")
    assert image.captured_at is None


@pytest.mark.parametrize(
    "header",
    [
        "file,x,y",
        "FileName,Easting,Northing",
        "Image Path, X_m ,Y_m",
        "photo,e,n",
        '"path","x","y"',
    ],
)
def test_columns_go_by_many_names(tmp_path: Path, header: str) -> None:
    survey = read_survey(survey_of(tmp_path, f"{header}\na.jpg,652000,6862000\n"), L93)
    assert poses(survey) == {"a.jpg": Pose(652000.0, 6862000.0, "EPSG:2154")}


def test_north_is_the_users_to_say(tmp_path: Path) -> None:
    root = survey_of(tmp_path, "file,x,y,heading\na.jpg,652000,6862000,10\n")
    options = ReadOptions(crs="EPSG:2154", north="magnetic")
    pose = read_survey(root, options).images[0].pose
    assert pose is not None
    assert pose.north == "magnetic"


@pytest.mark.parametrize(
    "table",
    [
        "\ufefffile,x,y\na.jpg,652000.5,6862000\n".encode(),
        "file,x,y\r\na.jpg,652000.5,6862000\r\n".encode("utf-16"),
        b"file;x;y\na.jpg;652000,5;6862000\n",
        b"file;x;y\na.jpg;652000.5;6862000\n",
        b"file\tx\ty\na.jpg\t652000,5\t6862000\n",
        b"file|x|y\na.jpg|652000.5|6862000\n",
        b'file,x,y\n\n"a.jpg","652000.5","6862000"\n\n',
        b"file,x,y\n./a.jpg,652000.5,6862000\n",
        b"note,file,x,y\n\xe9t\xe9,a.jpg,652000.5,6862000\n",
    ],
    ids=["bom", "utf16", "comma", "semicolon", "tab", "bar", "quotes", "dot", "latin1"],
)
def test_tables_of_many_makes_are_read(tmp_path: Path, table: bytes) -> None:
    survey = read_survey(survey_of(tmp_path, table), L93)
    assert poses(survey) == {"a.jpg": Pose(652000.5, 6862000.0, "EPSG:2154")}


def test_a_latin1_table_names_its_files(tmp_path: Path) -> None:
    table = "file,x,y\ncafé.jpg,652000,6862000\n".encode("latin-1")
    assert list(poses(read_survey(survey_of(tmp_path, table, "café.jpg"), L93))) == ["café.jpg"]


def test_backslashes_and_decomposed_names_are_understood(tmp_path: Path) -> None:
    table = "file,x,y\nimages\\cafe\u0301.jpg,652000,6862000\n"
    survey = read_survey(survey_of(tmp_path, table, "images/café.jpg"), L93)
    assert list(poses(survey)) == ["images/café.jpg"]


def test_a_table_can_be_given_itself_whatever_its_name(tmp_path: Path) -> None:
    table = "file,x,y\nsub/a.jpg,652000,6862000\n"
    root = survey_of(tmp_path, table, "sub/a.jpg", table_name="where.txt")
    survey = read_survey(root / "where.txt", L93)
    assert survey.format == "table"
    assert list(poses(survey)) == ["sub/a.jpg"]


def test_other_tables_in_the_folder_do_not_matter(tmp_path: Path) -> None:
    root = survey_of(tmp_path, "file,x,y\na.jpg,652000,6862000\n")
    (root / "weather.csv").write_text("day,rain\n1,2\n")
    assert len(read_survey(root, L93).images) == 1


def test_two_pose_tables_are_refused(tmp_path: Path) -> None:
    root = survey_of(tmp_path, "file,x,y\na.jpg,652000,6862000\n")
    (root / "other.csv").write_text("file,x,y\na.jpg,652000,6862000\n")
    with pytest.raises(BadSurvey, match=r"other\.csv, poses\.csv"):
        read_survey(root, L93)


def test_metres_without_a_coordinate_system_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownCrs, match="--crs"):
        read_survey(survey_of(tmp_path, "file,x,y\na.jpg,652000,6862000\n"), ReadOptions())


def test_small_coordinates_alone_do_not_prove_degrees(tmp_path: Path) -> None:
    with pytest.raises(UnknownCrs, match="call the columns lon and lat"):
        read_survey(survey_of(tmp_path, "file,x,y\na.jpg,2.3,48.8\n"), ReadOptions())


def test_degrees_under_a_projected_system_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadSurvey, match="projected"):
        read_survey(survey_of(tmp_path, "file,lon,lat\na.jpg,2.3,48.8\n"), L93)


@pytest.mark.parametrize(("crs", "easting"), [(None, 2.3), ("EPSG:2154", 652000.0)])
def test_of_two_positions_the_one_in_the_named_system_is_used(
    tmp_path: Path, crs: str | None, easting: float
) -> None:
    table = "file,lon,lat,x,y\na.jpg,2.3,48.8,652000,6862000\n"
    pose = read_survey(survey_of(tmp_path, table), ReadOptions(crs=crs)).images[0].pose
    assert pose is not None
    assert pose.easting == easting


def test_swapped_axes_are_refused_with_both_numbers(tmp_path: Path) -> None:
    table = "file,x,y\na.jpg,6862000,652000\n"
    with pytest.raises(BadSurvey, match=r"6\.862e\+06.*652000.*swapped"):
        read_survey(survey_of(tmp_path, table), L93)


def test_the_wrong_system_is_refused(tmp_path: Path) -> None:
    table = "file,x,y\na.jpg,652000,6862000\n"
    with pytest.raises(BadSurvey, match="area of use of EPSG:2056"):
        read_survey(survey_of(tmp_path, table), ReadOptions(crs="EPSG:2056"))


def test_swapped_degrees_are_refused_where_they_show(tmp_path: Path) -> None:
    table = "file,lon,lat\na.jpg,40.7,-122.4\n"
    with pytest.raises(BadSurvey, match="swapped"):
        read_survey(survey_of(tmp_path, table), ReadOptions())


def test_one_far_pose_among_good_ones_is_skipped(tmp_path: Path) -> None:
    table = "file,x,y\na.jpg,652000,6862000\nb.jpg,6862000,652000\n"
    survey = read_survey(survey_of(tmp_path, table, "a.jpg", "b.jpg"), L93)
    assert list(poses(survey)) == ["a.jpg"]
    assert "far outside" in reasons(survey)["b.jpg"]


@pytest.mark.parametrize(
    ("cells", "reason"),
    [
        ("nan,6862000,1,2,3", "poses.csv row 3 column 'x': easting is 'nan'"),
        ("652000,inf,1,2,3", "poses.csv row 3 column 'y': northing is 'inf'"),
        ("652000,,1,2,3", "poses.csv row 3: image without pose"),
        ("here,6862000,1,2,3", "poses.csv row 3 column 'x': easting is 'here'"),
        ("652000,6862000,nan,2,3", "poses.csv row 3 column 'heading': heading is 'nan'"),
        ("652000,6862000,north,2,3", "poses.csv row 3 column 'heading': heading is 'north'"),
        ("652000,6862000,1,91,3", "poses.csv row 3 column 'pitch': pitch is 91"),
        ("652000,6862000,1,2,-9999", "poses.csv row 3 column 'z': altitude is -9999"),
        ("652000", "poses.csv row 3: image without pose"),
    ],
)
def test_a_row_with_an_impossible_pose_is_skipped_by_number(
    tmp_path: Path, cells: str, reason: str
) -> None:
    table = f"file,x,y,heading,pitch,z\na.jpg,652000,6862000,1,2,3\nb.jpg,{cells}\n"
    survey = read_survey(survey_of(tmp_path, table, "a.jpg", "b.jpg"), L93)
    assert list(poses(survey)) == ["a.jpg"]
    assert reasons(survey)["b.jpg"].startswith(reason)


def test_poses_and_images_without_each_other_are_skipped(tmp_path: Path) -> None:
    table = "file,x,y\na.jpg,652000,6862000\ngone.jpg,652000,6862000\n"
    survey = read_survey(survey_of(tmp_path, table, "a.jpg", "extra.jpg"), L93)
    assert list(poses(survey)) == ["a.jpg"]
    assert "pose without image" in reasons(survey)["gone.jpg"]
    assert "image without pose" in reasons(survey)["extra.jpg"]


@pytest.mark.parametrize(
    "name",
    ["/etc/passwd.jpg", "../outside.jpg", "sub/../../outside.jpg", "C:\\a.jpg", "file:///a.jpg"],
)
def test_a_row_cannot_name_a_file_outside_the_survey(tmp_path: Path, name: str) -> None:
    Image.new("RGB", (4, 4)).save(tmp_path / "outside.jpg")
    table = f"file,x,y\na.jpg,652000,6862000\n{name},652000,6862000\n"
    survey = read_survey(survey_of(tmp_path / "root", table), L93)
    assert list(poses(survey)) == ["a.jpg"]
    (skip,) = survey.skipped
    assert "not a path within the survey" in skip.reason


def test_the_first_of_two_rows_for_one_image_counts(tmp_path: Path) -> None:
    table = "file,x,y\na.jpg,652000,6862000\na.jpg,652001,6862000\n"
    survey = read_survey(survey_of(tmp_path, table), L93)
    assert poses(survey) == {"a.jpg": Pose(652000.0, 6862000.0, "EPSG:2154")}
    assert "the same image as row 2" in reasons(survey)["a.jpg"]


def test_a_row_without_a_file_is_named_by_its_number(tmp_path: Path) -> None:
    table = "file,x,y\na.jpg,652000,6862000\n,652001,6862000\n"
    assert reasons(read_survey(survey_of(tmp_path, table), L93)) == {
        "row 3": "poses.csv row 3: names no file"
    }


@pytest.mark.parametrize("header", ["file,x,y,x", "file,x,easting,y", "file,image,x,y"])
def test_two_columns_for_one_thing_are_refused(tmp_path: Path, header: str) -> None:
    with pytest.raises(BadSurvey, match="both say"):
        read_survey(survey_of(tmp_path, f"{header}\na.jpg,652000,6862000,1\n"), L93)


def test_a_table_without_a_position_is_refused_with_the_columns_it_has(tmp_path: Path) -> None:
    root = survey_of(tmp_path, "file,colour\na.jpg,red\n")
    with pytest.raises(BadSurvey, match=r"\['file', 'colour'\]"):
        read_survey(root / "poses.csv", L93)


@pytest.mark.parametrize("content", [b"", b"   \n", b"file,x,y\n\0\0\n"])
def test_what_is_no_table_is_refused(tmp_path: Path, content: bytes) -> None:
    root = survey_of(tmp_path, content)
    with pytest.raises(BadSurvey, match=r"poses\.csv"):
        read_survey(root / "poses.csv", L93)


def test_a_table_of_rows_that_all_fail_is_refused_with_the_reason(tmp_path: Path) -> None:
    with pytest.raises(BadSurvey, match=r"not one usable image.*pose without image"):
        read_survey(survey_of(tmp_path, "file,x,y\nb.jpg,652000,6862000\n", "a.png"), L93)


def test_without_poses_a_table_is_not_looked_at(tmp_path: Path) -> None:
    root = survey_of(tmp_path, "file,x,y\nb.jpg,nan,nan\n")
    survey = read_survey(root, ReadOptions(no_pose=True))
    assert poses(survey) == {"a.jpg": None}
    assert survey.crs is None


def test_excluded_images_are_not_reported(tmp_path: Path) -> None:
    table = "file,x,y\na.jpg,652000,6862000\nb.jpg,nan,1\n"
    root = survey_of(tmp_path, table, "a.jpg", "b.jpg", "c.jpg")
    survey = read_survey(root, ReadOptions(crs="EPSG:2154", exclude=("b.jpg", "c.jpg")))
    assert list(poses(survey)) == ["a.jpg"]
    assert survey.skipped == ()
