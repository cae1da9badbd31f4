"""What is wrong with text tables, and how it is told."""

import csv
import gzip
import io
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest
from pictured import AS_IT_IS, L93, pictured, pose_of, reasons

from contracts.errors import BadSurvey
from survey import Survey, read_survey


def read(folder: Path, table: str | bytes, *names: str) -> Survey:
    pictured(folder, *(names or ("a.jpg", "b.jpg")))
    data = table if isinstance(table, bytes) else table.encode()
    (folder / "poses.csv").write_bytes(data)
    return read_survey(folder / "poses.csv", L93)


@pytest.mark.parametrize("separator", [",", ";", "\t", "|", " ", "    ", " \t "])
def test_any_separator_is_found(tmp_path: Path, separator: str) -> None:
    lines = [["file", "x", "y", "heading"], ["a.jpg", "652000.5", "6862000", "90"]]
    survey = read(tmp_path, "\n".join(map(separator.join, lines)) + "\n")
    assert (pose_of(survey).easting, pose_of(survey).heading_deg) == (652000.5, 90.0)


@pytest.mark.parametrize("stated", ["sep=;", '"sep=;"', "\ufeffSEP=;\r"])
def test_a_separator_that_excel_states_is_used(tmp_path: Path, stated: str) -> None:
    survey = read(tmp_path, f"{stated}\nfile;x;y\na.jpg;652000,5;6862000\nb.jpg;;1\n")
    assert pose_of(survey).easting == 652000.5
    assert "poses.csv row 4" in reasons(survey)["b.jpg"]


@pytest.mark.parametrize(
    ("header", "row", "words"),
    [
        ("file,x,y", "a.jpg;652000.5;6862000", "by semicolons, the header by commas"),
        ("file,x,y", "a.jpg;652000,5;6862000,5", "by semicolons, the header by commas"),
        ("file;x;y", "a.jpg,652000.5,6862000", "by commas, the header by semicolons"),
        ("file\tx\ty", "a.jpg 652000.5 6862000", "by blanks, the header by tabs"),
        ("file,x,y", "a.jpg\t652000.5\t6862000", "by tabs, the header by commas"),
    ],
)
def test_rows_by_another_separator_than_the_header_are_refused(
    tmp_path: Path, header: str, row: str, words: str
) -> None:
    with pytest.raises(BadSurvey, match=rf"poses\.csv, line 2: the rows are separated {words}"):
        read(tmp_path, f"{header}\n{row}\n{row}\n")


def test_another_separator_inside_cells_is_no_reason_to_refuse(tmp_path: Path) -> None:
    survey = read(tmp_path, "file,x,y\na|b;c.jpg,652000,6862000\n", "a|b;c.jpg")
    assert [image.uri for image in survey.images] == ["a|b;c.jpg"]


def test_columns_may_come_in_any_order_and_case(tmp_path: Path) -> None:
    survey = read(tmp_path, "Heading,Y,note,FILE,X\n90,6862000,hello,a.jpg,652000\n")
    assert (pose_of(survey).easting, pose_of(survey).heading_deg) == (652000.0, 90.0)


@pytest.mark.parametrize(
    ("encoding", "mark"),
    [("utf-8", b""), ("utf-8-sig", b""), ("utf-16", b""), ("utf-32", b""), ("latin-1", b"")],
)
def test_encodings_are_found(tmp_path: Path, encoding: str, mark: bytes) -> None:
    table = "file,x,y\nété.jpg,652000,6862000\n"
    survey = read(tmp_path, mark + table.encode(encoding), "été.jpg")
    assert [image.uri for image in survey.images] == ["été.jpg"]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_any_end_of_line_will_do_even_none_at_the_end(tmp_path: Path, end: str) -> None:
    survey = read(tmp_path, f"file,x,y{end}a.jpg,652000,6862000{end}b.jpg,652001,6862000")
    assert len(survey.images) == 2


def test_a_row_that_was_cut_off_is_told(tmp_path: Path) -> None:
    survey = read(tmp_path, "file,x,y,z,heading\na.jpg,652000,6862000,4,5\nb.jpg,652001,68620")
    assert "poses.csv row 3: has 3 cells, expected 5" in reasons(survey)["b.jpg"]
    assert "cut off" in reasons(survey)["b.jpg"]


def test_a_short_row_lacks_only_what_it_lacks(tmp_path: Path) -> None:
    survey = read(tmp_path, "file,x,y,z\na.jpg,652000,6862000\nb.jpg,652000,6862000,4\n")
    assert (pose_of(survey).altitude_m, pose_of(survey, "b.jpg").altitude_m) == (None, 4.0)


def test_a_row_with_too_many_cells_is_told(tmp_path: Path) -> None:
    survey = read(tmp_path, "file,x,y\na.jpg,652000,6862000\nb.jpg,652,000,6862000\n")
    assert reasons(survey)["b.jpg"].startswith("poses.csv row 3: has 4 cells, expected 3")


@pytest.mark.parametrize(
    ("cell", "value"),
    [("652000,5", 652000.5), ("652000.5", 652000.5), (" 652000 ", 652000.0), ("+6.52e5", 652000.0)],
)
def test_numbers_are_read_as_written(tmp_path: Path, cell: str, value: float) -> None:
    assert pose_of(read(tmp_path, f"file;x;y\na.jpg;{cell};6862000\n")).easting == value


@pytest.mark.parametrize(
    "cell", ["652.000,5", "652 000,5", "652'000.5", "652\u202f000", "1.652.000"]
)
def test_thousands_separators_are_refused_with_a_hint(tmp_path: Path, cell: str) -> None:
    table = f"file;x;y\na.jpg;652000;6862000\nb.jpg;{cell};6862000\n"
    reason = reasons(read(tmp_path, table))["b.jpg"]
    assert reason.startswith(f"poses.csv row 3 column 'x': easting is {cell!r}")
    assert "without thousands separators" in reason


@pytest.mark.parametrize("cell", ["1e308", "-1e308", "nan", "inf", "-Infinity", "0x10", "1_000"])
@pytest.mark.parametrize("column", ["x", "y", "z", "heading", "pitch", "roll", "hfov"])
def test_no_impossible_number_becomes_a_pose(tmp_path: Path, column: str, cell: str) -> None:
    cells = {"file": "b.jpg", "x": "652000", "y": "6862000", "z": "0", "heading": "0"}
    cells |= {"pitch": "0", "roll": "0", "hfov": "70"}
    good = cells | {"file": "a.jpg"}
    text = io.StringIO()
    writer = csv.DictWriter(text, list(cells))
    writer.writeheader()
    writer.writerows([good, cells | {column: cell}])
    survey = read(tmp_path, text.getvalue())
    assert [image.uri for image in survey.images] == ["a.jpg"]
    assert "b.jpg" in reasons(survey)


@pytest.mark.parametrize("cell", ["", " ", "NULL", "null", "None", "NA", "n/a"])
def test_what_is_not_known_is_not_zero(tmp_path: Path, cell: str) -> None:
    survey = read(tmp_path, f"file,x,y,heading\na.jpg,652000,6862000,{cell}\n")
    assert pose_of(survey).heading_deg is None


def test_duplicate_columns_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(BadSurvey, match=r"poses\.csv: columns 'x' and 'X' both say x"):
        read(tmp_path, "file,x,y,X\na.jpg,652000,6862000,1\n")


@pytest.mark.parametrize(
    ("time", "known"),
    [
        ("2020-02-29T10:00:00Z", True),
        ("2021-02-29T10:00:00Z", False),
        ("2016-12-31T23:59:60Z", False),
        ("2020-02-29T10:00:00", False),
        ("2020-02-29 10:00:00+02:00", True),
        ("yesterday", False),
    ],
)
def test_a_time_that_is_no_moment_is_left_out_and_told(
    tmp_path: Path, time: str, known: bool
) -> None:
    survey = read(tmp_path, f"file,x,y,time\na.jpg,652000,6862000,{time}\n")
    assert (survey.images[0].captured_at is not None) == known
    assert any(f"{time!r} (poses.csv row 2 column 'time')" in n for n in survey.notes) != known


def zipped(data: bytes) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("poses.csv", data)
    return buffer.getvalue()


GOOD = b"file,x,y\na.jpg,652000,6862000\n"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "is empty"),
        (b" \n\n", "is empty"),
        (b"file,x,y\n", "no rows"),
        (b"file,x,y\n\n , ,\n", "no rows"),
        (zipped(GOOD), "ZIP archive or a spreadsheet"),
        (gzip.compress(GOOD, mtime=0), "gzip"),
        (b"\x89PNG\r\n\x1a\n", "PNG"),
        (GOOD + b"b.jpg,\0,6862000\n", "line 3: a NUL"),
        (GOOD.decode().encode("utf-16-le"), "NUL .*UTF-16 without a byte order mark"),
        (b"\xff\xfe" + GOOD.decode().encode("utf-16-le")[:-1], "line .* utf-16"),
        (GOOD + b'"b.jpg,652000,6862000\n', "line 3: unexpected end of data; a quote"),
        (GOOD + b'"b.jpg"x,652000,6862000\n', "line 3: ',' expected after"),
        (b"file,colour\na.jpg,red\n", r"columns \['file', 'colour'\], expected one for the file"),
    ],
)
def test_what_is_no_table_is_refused_by_name(tmp_path: Path, data: bytes, message: str) -> None:
    with pytest.raises(BadSurvey, match=f"(?s)poses\\.csv.*{message}"):
        read(tmp_path, data)


def test_an_endless_line_is_refused_before_it_fills_the_memory(tmp_path: Path) -> None:
    path = pictured(tmp_path, "a.jpg") / "poses.csv"
    with path.open("wb") as file:
        file.write(GOOD)
        file.truncate(1 << 27)  # zeros that takes no room
        file.seek(len(GOOD))
        file.write(b"b" * 2_000_000)
    with pytest.raises(BadSurvey, match=r"line 3: longer than 1000000 characters"):
        read_survey(path, L93)


def test_a_cell_too_long_for_any_file_name_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadSurvey, match="line 3: field larger than field limit"):
        read(tmp_path, GOOD + b"b" * 200_000 + b",1,2\n")


def test_the_first_of_two_rows_of_one_image_counts_and_both_are_named(tmp_path: Path) -> None:
    survey = read(tmp_path, "file,x,y\na.jpg,652000,6862000\n./a.jpg,652009,6862000\n")
    assert pose_of(survey).easting == 652000.0
    assert reasons(survey)["a.jpg"] == "poses.csv row 3: the same image as row 2, which counts"


def test_a_quoted_cell_may_hold_a_line_end(tmp_path: Path) -> None:
    survey = read(tmp_path, 'file,x,y,note\na.jpg,652000,6862000,"two\nlines"\nb.jpg,no,1,\n')
    assert len(survey.images) == 1
    assert reasons(survey)["b.jpg"].startswith("poses.csv row 4 column 'x'")


def test_angles_that_no_camera_turns_are_refused(tmp_path: Path) -> None:
    table = "file,x,y,heading\na.jpg,652000,6862000,648.5\nb.jpg,652000,6862000,48850\n"
    survey = read(tmp_path, table)
    assert pose_of(survey).heading_deg == 288.5
    assert "heading is 48850 deg, which is no angle" in reasons(survey)["b.jpg"]


def test_an_error_of_position_is_kept(tmp_path: Path) -> None:
    survey = read(tmp_path, "file,x,y,gps_accuracy\na.jpg,652000,6862000,2.5\n")
    assert pose_of(survey).position_error_m == 2.5


def test_a_magnetic_survey_stays_magnetic(tmp_path: Path) -> None:
    pictured(tmp_path, "a.jpg")
    (tmp_path / "poses.csv").write_text("file,lon,lat,heading\na.jpg,2.3,48.8,10\n")
    pose = pose_of(read_survey(tmp_path, replace(AS_IT_IS, north="magnetic")))
    assert (pose.north, pose.heading_deg) == ("magnetic", 10.0)
