import os
import shutil
import unicodedata
from dataclasses import replace
from pathlib import Path

import pytest
from made_surveys import MAKERS
from pictured import AS_IT_IS
from PIL import Image

from contracts.errors import BadConfig, BadSurvey, UnknownCrs
from survey import ReadOptions, Survey, read_survey

PLAIN = ReadOptions(no_pose=True)


def picture(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", (8, 6), (10, 20, 30)).save(path)
    return path


def uris(survey: Survey) -> list[str]:
    return [image.uri for image in survey.images]


def reasons(survey: Survey) -> dict[str, str]:
    return {skip.uri: skip.reason for skip in survey.skipped}


def test_images_come_in_the_order_of_the_bytes_of_their_uris(tmp_path: Path) -> None:
    names = ["b.jpg", "B.jpg", "é.jpg", "a/z.jpg", "a.jpg", "a0.jpg", "Ж.png", "10.jpg", "9.jpg"]
    for name in names:
        picture(tmp_path / name)
    survey = read_survey(tmp_path, PLAIN)
    assert uris(survey) == sorted(names, key=lambda name: name.encode())
    assert survey.format == "plain"
    assert survey.crs is None
    assert all(image.pose is None for image in survey.images)
    assert all(Path(image.path).is_file() for image in survey.images)


def test_a_decomposed_name_is_written_composed_and_still_opens(tmp_path: Path) -> None:
    picture(tmp_path / unicodedata.normalize("NFD", "café.jpg"))
    survey = read_survey(tmp_path, PLAIN)
    assert uris(survey) == [unicodedata.normalize("NFC", "café.jpg")]
    assert Path(survey.images[0].path).is_file()


def test_two_names_that_are_one_in_nfc_are_not_both_taken(tmp_path: Path) -> None:
    picture(tmp_path / unicodedata.normalize("NFD", "café.jpg"))
    picture(tmp_path / unicodedata.normalize("NFC", "café.jpg"))
    survey = read_survey(tmp_path, PLAIN)
    assert len(survey.images) == 1
    assert "NFC" in survey.skipped[0].reason


def test_a_name_that_is_not_utf8_is_skipped_under_a_name_that_is(tmp_path: Path) -> None:
    """Plans and catalogues are UTF-8 and could not hold its path."""
    picture(tmp_path / "a.jpg")
    picture(tmp_path / "b.jpg").rename(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9.jpg"))
    survey = read_survey(tmp_path, PLAIN)
    assert uris(survey) == ["a.jpg"]
    assert survey.skipped[0].uri == "caf\ufffd.jpg"
    assert "not UTF-8" in survey.skipped[0].reason


def test_a_link_to_itself_is_no_obstacle(tmp_path: Path) -> None:
    picture(tmp_path / "a.jpg")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "self").symlink_to(".")
    assert uris(read_survey(tmp_path, PLAIN)) == ["a.jpg"]


def test_the_same_name_in_two_folders_is_two_images(tmp_path: Path) -> None:
    picture(tmp_path / "a" / "1.jpg")
    picture(tmp_path / "b" / "1.jpg")
    assert uris(read_survey(tmp_path, PLAIN)) == ["a/1.jpg", "b/1.jpg"]


def test_hidden_and_foreign_files_are_not_images(tmp_path: Path) -> None:
    picture(tmp_path / "a.jpg")
    picture(tmp_path / ".thumbnails" / "a.jpg")
    picture(tmp_path / ".b.jpg")
    (tmp_path / "notes.pdf").write_text("no")
    survey = read_survey(tmp_path, PLAIN)
    assert uris(survey) == ["a.jpg"]
    assert survey.skipped == ()


def test_a_prefix_names_every_uri(tmp_path: Path) -> None:
    picture(tmp_path / "a.jpg")
    os.mkfifo(tmp_path / "b.jpg")
    survey = read_survey(tmp_path, replace(PLAIN, name="other"))
    assert uris(survey) == ["other/a.jpg"]
    assert reasons(survey) == {"other/b.jpg": "not a regular file"}


@pytest.mark.parametrize(
    ("include", "exclude", "left"),
    [
        ((), (), ["a/1.jpg", "a/b/2.jpg", "c/1.jpg", "top.jpg"]),
        (("a/*",), (), ["a/1.jpg", "a/b/2.jpg"]),
        (("a/**/*.jpg",), (), ["a/1.jpg", "a/b/2.jpg"]),
        (("**/1.jpg",), (), ["a/1.jpg", "c/1.jpg"]),
        (("**/top.jpg",), (), ["top.jpg"]),
        (("1.jpg",), (), ["a/1.jpg", "c/1.jpg"]),
        (("[ac]/1.jpg", "top*"), (), ["a/1.jpg", "c/1.jpg", "top.jpg"]),
        (("*",), ("a/*",), ["c/1.jpg", "top.jpg"]),
        ((), ("**/b/**/*",), ["a/1.jpg", "c/1.jpg", "top.jpg"]),
        ((), ("?.jpg",), ["top.jpg"]),
    ],
)
def test_globs_choose_images(
    tmp_path: Path, include: tuple[str, ...], exclude: tuple[str, ...], left: list[str]
) -> None:
    for name in ("a/1.jpg", "a/b/2.jpg", "c/1.jpg", "top.jpg"):
        picture(tmp_path / name)
    survey = read_survey(tmp_path, replace(PLAIN, include=include, exclude=exclude))
    assert uris(survey) == left
    assert survey.skipped == ()


def test_globs_that_leave_nothing_are_refused(tmp_path: Path) -> None:
    picture(tmp_path / "a.jpg")
    with pytest.raises(BadSurvey, match="--include"):
        read_survey(tmp_path, replace(PLAIN, include=("b/*",)))


def test_links_are_followed_only_within_the_survey(tmp_path: Path) -> None:
    outside = picture(tmp_path / "outside" / "secret.jpg")
    root = tmp_path / "survey"
    inside = picture(root / "a.jpg")
    (root / "link_in.jpg").symlink_to(inside)
    (root / "link_out.jpg").symlink_to(outside)
    (root / "folder_out").symlink_to(outside.parent)
    (root / "broken.jpg").symlink_to(root / "nowhere.jpg")
    (root / "loop").symlink_to(root)
    survey = read_survey(root, PLAIN)
    assert uris(survey) == ["a.jpg", "link_in.jpg"]
    assert set(reasons(survey)) == {"broken.jpg", "folder_out", "link_out.jpg"}
    assert "leads out" in reasons(survey)["link_out.jpg"]
    assert "leads out" in reasons(survey)["folder_out"]


def test_pipes_are_skipped_with_a_reason(tmp_path: Path) -> None:
    picture(tmp_path / "a.jpg")
    os.mkfifo(tmp_path / "b.jpg")
    assert reasons(read_survey(tmp_path, PLAIN)) == {"b.jpg": "not a regular file"}


@pytest.mark.skipif(os.geteuid() == 0, reason="root may list every folder")
def test_a_folder_that_may_not_be_listed_is_skipped_with_a_reason(tmp_path: Path) -> None:
    picture(tmp_path / "a.jpg")
    (tmp_path / "closed").mkdir(mode=0)
    assert reasons(read_survey(tmp_path, PLAIN)) == {
        "closed/": "folder cannot be listed: Permission denied"
    }


@pytest.mark.parametrize("no_pose", [False, True])
def test_an_empty_survey_is_refused(tmp_path: Path, no_pose: bool) -> None:
    with pytest.raises(BadSurvey, match="is empty"):
        read_survey(tmp_path, ReadOptions(no_pose=no_pose))


def test_a_survey_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadSurvey, match="does not exist"):
        read_survey(tmp_path / "nowhere", ReadOptions())


def test_images_without_poses_are_refused_with_the_way_out(tmp_path: Path) -> None:
    picture(tmp_path / "a.jpg")
    with pytest.raises(BadSurvey, match="--no-pose"):
        read_survey(tmp_path, ReadOptions())


def test_files_that_could_be_pose_tables_are_told_when_no_image_has_a_pose(tmp_path: Path) -> None:
    picture(tmp_path / "a.jpg")
    (tmp_path / "poses.csv").write_text("name,place\na.jpg,here\n")
    (tmp_path / "empty.csv").touch()
    (tmp_path / "poses.txt").write_text("file,lon,lat\na.jpg,2,48\n")
    (tmp_path / "notes.txt").write_text("Taken in spring.\n")
    with pytest.raises(BadSurvey, match="--no-pose") as refused:
        read_survey(tmp_path, ReadOptions())
    told = str(refused.value)
    assert "; poses.csv is there but is no pose table: columns ['name', 'place'], expected" in told
    assert "; empty.csv is there but is no pose table: is empty" in told
    assert "; poses.txt is there: give its path" in told
    assert "notes.txt" not in told


def test_an_mcap_file_beside_images_is_not_the_survey(tmp_path: Path) -> None:
    table = MAKERS["table"](tmp_path / "survey")
    made = MAKERS["mcap"](tmp_path / "survey")
    options = replace(AS_IT_IS, crs="EPSG:2154")
    assert read_survey(table.parent, options).format == "table"
    assert read_survey(table.parent, replace(options, no_pose=True)).format == "plain"
    assert read_survey(made, AS_IT_IS).format == "mcap"
    table.unlink()
    picture(table.parent / "a.jpg")
    with pytest.raises(BadSurvey, match=r"drive\.mcap is there: --format mcap reads"):
        read_survey(table.parent, AS_IT_IS)
    for name in ("a.jpg", "b.jpg"):
        (table.parent / name).unlink()
    assert read_survey(table.parent, AS_IT_IS).format == "mcap"


def test_an_unknown_format_is_refused_and_the_known_ones_are_named(tmp_path: Path) -> None:
    with pytest.raises(
        BadConfig, match="stereopolis, mcap, kapture, table, utm-names, exif, plain"
    ):
        read_survey(tmp_path, ReadOptions(format="kitti"))


def test_an_unknown_coordinate_system_is_refused(tmp_path: Path) -> None:
    picture(tmp_path / "a.jpg")
    with pytest.raises(UnknownCrs, match="EPSG:999999"):
        read_survey(tmp_path, ReadOptions(crs="EPSG:999999"))


def test_what_becomes_of_positions_and_compass_headings_is_noted(tmp_path: Path) -> None:
    rows = ["file,x,y,heading,time"]
    for number, year in enumerate((2005, 2020)):
        picture(tmp_path / f"{number}.jpg")
        rows.append(f"{number}.jpg,{10 * number},0,90,{year}-05-01T10:00:00Z")
    (tmp_path / "poses.csv").write_text("\n".join(rows) + "\n")
    nameless = "+proj=tmerc +lat_0=48 +lon_0=2 +ellps=airy +units=m +no_defs +type=crs"
    options = ReadOptions(crs=nameless, north="magnetic", allow_ballpark=True)
    ballpark, magnetic = read_survey(tmp_path, options).notes
    assert "off by up to hundreds of metres, as --allow-ballpark permits" in ballpark
    assert magnetic.startswith("1 magnetic headings cannot be turned to true north: ")
    assert read_survey(tmp_path, ReadOptions(crs="EPSG:32631", north="grid")).notes == ()


def test_a_survey_reads_the_same_whatever_folder_it_is_in(tmp_path: Path) -> None:
    for name in ("z.jpg", "a.jpg", "m/k.jpg"):
        picture(tmp_path / "one" / name)
    shutil.copytree(tmp_path / "one", tmp_path / "two")
    first, second = (read_survey(tmp_path / name, PLAIN) for name in ("one", "two"))
    assert uris(first) == uris(second)


def test_plain_real_images_are_all_found(test_data: Path) -> None:
    survey = read_survey(test_data / "kth-buildings" / "references", PLAIN)
    assert len(survey.images) == 149
    assert survey.skipped == ()
