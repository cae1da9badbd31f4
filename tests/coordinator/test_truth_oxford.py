"""Folders in the format of the Oxford and Paris buildings."""

import unicodedata
from pathlib import Path

import pytest

from contracts.errors import BadTruth
from coordinator.truth import JudgedQuery, read_truth

URIS = [
    "oxbuild_images/all_souls_000001.jpg",
    "oxbuild_images/all_souls_000013.jpg",
    "oxbuild_images/all_souls_000026.jpg",
    "oxbuild_images/hertford_000015.jpg",
    "oxbuild_images/radcliffe camera_000002.jpg",
]
PATHS = [f"/images/{uri}" for uri in URIS]
QUERY = "oxc1_all_souls_000013 136.5 34.1 648.5 955.7\n"


def truth(folder: Path, **files: str | bytes) -> Path:
    """Files of the query all_souls_1, as published but for those given; by the end of the name."""
    contents = {
        "all_souls_1_query": QUERY,
        "all_souls_1_good": "all_souls_000013\n",
        "all_souls_1_ok": "all_souls_000026\n",
        "all_souls_1_junk": "hertford_000015\n",
    }
    for name, content in {**contents, **files}.items():
        data = content.encode() if isinstance(content, str) else content
        (folder / f"{name}.txt").write_bytes(data)
    return folder


def read(folder: Path, root: Path | None = None) -> list[JudgedQuery]:
    return read_truth(folder, root, URIS, PATHS)


def refusal(folder: Path, root: Path | None = None) -> str:
    with pytest.raises(BadTruth) as error:
        read(folder, root)
    return str(error.value)


def test_a_query_is_its_photo_its_box_what_is_good_or_ok_and_what_is_junk(tmp_path: Path) -> None:
    (query,) = read(truth(tmp_path))
    assert query == JudgedQuery(
        query="all_souls_1",
        path=Path(PATHS[1]),
        relevant=(1, 2),
        junk=(1, 3),  # the query itself is of the index
        box=(136.5, 34.1, 648.5, 955.7),
    )


def test_paris_writes_its_queries_without_a_prefix(tmp_path: Path) -> None:
    truth(tmp_path, all_souls_1_query="all_souls_000013 1 2 3 4")
    assert read(tmp_path)[0].path == Path(PATHS[1])


def test_queries_are_in_the_order_of_their_names_and_other_files_are_no_matter(
    tmp_path: Path,
) -> None:
    lists = {f"hertford_2_{kind}": "" for kind in ("good", "ok", "junk")}
    truth(tmp_path, **lists, hertford_2_query="hertford_000015 0 0 9 9", README="lists\n")
    (tmp_path / "._all_souls_9_good.txt").write_bytes(b"\0")
    assert [each.query for each in read(tmp_path)] == ["all_souls_1", "hertford_2"]
    assert read(tmp_path)[1].relevant == ()


def test_windows_lines_empty_lines_marks_and_spaces_in_names_are_no_matter(tmp_path: Path) -> None:
    truth(
        tmp_path,
        all_souls_1_query=b"\xef\xbb\xbfoxc1_radcliffe camera_000002  1 2\t3 4e1 \r\n\r\n",
        all_souls_1_good=b"\xef\xbb\xbf\r\nradcliffe camera_000002\r\n all_souls_000001 \r\n",
        all_souls_1_ok=b"",
    )
    (query,) = read(tmp_path)
    assert (query.path, query.box) == (Path(PATHS[4]), (1.0, 2.0, 3.0, 40.0))
    assert query.relevant == (0, 4)


def test_names_are_compared_in_the_unicode_form_of_uris(tmp_path: Path) -> None:
    name = unicodedata.normalize("NFD", "façade")
    truth(tmp_path, all_souls_1_good=name, all_souls_1_ok="", all_souls_1_junk="")
    (query,) = read_truth(tmp_path, None, [*URIS, "façade.png"], [*PATHS, "/facade"])
    assert query.relevant == (5,)


def test_the_photo_is_taken_from_the_root_before_the_index(tmp_path: Path) -> None:
    folder = truth(tmp_path)
    root = tmp_path / "photos"
    (root / "all souls").mkdir(parents=True)
    assert read(folder, root)[0].path == Path(PATHS[1])
    photo = root / "all souls" / "all_souls_000013.png"
    photo.touch()
    assert read(folder, root)[0].path == photo
    (root / "all_souls_000013.jpg").touch()
    assert read(folder, root)[0].path == root / "all_souls_000013.jpg"  # equal to its end
    (root / "all_souls_000013.jpg").rename(root / "all souls" / "all_souls_000013.jpg")
    assert "all_souls_000013, which is several" in refusal(folder, root)


def test_a_photo_that_is_nowhere_is_named(tmp_path: Path) -> None:
    truth(tmp_path, all_souls_1_query="gone_000001 1 2 3 4")
    assert "all_souls_1, gone_000001, is not in the index" in refusal(tmp_path)
    assert f"neither in {tmp_path} nor the index" in refusal(tmp_path, tmp_path)
    assert "cannot be listed" in refusal(tmp_path, tmp_path / "none")


@pytest.mark.parametrize("kind", ["good", "ok", "junk"])
def test_a_query_without_one_of_its_lists_is_refused(tmp_path: Path, kind: str) -> None:
    (truth(tmp_path) / f"all_souls_1_{kind}.txt").unlink()
    said = refusal(tmp_path)
    assert f"all_souls_1_query.txt has no all_souls_1_{kind}.txt" in said


@pytest.mark.parametrize("kind", ["good", "ok", "junk"])
def test_a_list_without_its_query_is_refused(tmp_path: Path, kind: str) -> None:
    truth(tmp_path, **{f"hertford_2_{kind}": "hertford_000015\n"})
    assert f"hertford_2_{kind}.txt belongs to no query" in refusal(tmp_path)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("", "holds 0 lines"),
        (QUERY * 2, "holds 2 lines"),
        ("all_souls_000013\n", "holds 'all_souls_000013'"),
        ("all_souls_000013 1 2 3\n", "expected one line"),
        ("all_souls_000013 1 2 3 wide\n", "3 wide'"),
        ("all_souls_000013 1 2 nan 4\n", "box 1 2 nan 4, which is empty"),
        ("all_souls_000013 1 2 inf 4\n", "which is empty"),
        ("all_souls_000013 5 2 5 4\n", "box 5 2 5 4, which is empty"),
        ("all_souls_000013 1 4 5 2\n", "with x1 < x2 and y1 < y2"),
    ],
)
def test_a_query_file_that_does_not_hold_is_quoted(tmp_path: Path, line: str, says: str) -> None:
    said = refusal(truth(tmp_path, all_souls_1_query=line))
    assert says in said
    assert "all_souls_1_query.txt" in said


def test_a_name_that_is_no_image_or_several_is_refused(tmp_path: Path) -> None:
    said = refusal(truth(tmp_path, all_souls_1_ok="all_souls_00002"))
    assert "all_souls_1 names all_souls_00002, which is no image" in said
    truth(tmp_path)
    with pytest.raises(BadTruth, match=r"hertford_000015, which is several images .*x/hertford"):
        read_truth(tmp_path, None, [*URIS, "x/hertford_000015.jpg"], [*PATHS, "/x"])


def test_an_image_that_is_good_and_junk_is_refused(tmp_path: Path) -> None:
    said = refusal(truth(tmp_path, all_souls_1_junk="all_souls_000026"))
    assert "all_souls_1_junk.txt names all_souls_000026, which is good or ok too" in said


def test_a_list_that_is_not_utf_8_is_named(tmp_path: Path) -> None:
    said = refusal(truth(tmp_path, all_souls_1_ok="façade".encode("latin-1")))
    assert "all_souls_1_ok.txt is not UTF-8 text (byte 2)" in said


def test_a_folder_without_a_query_is_told_the_three_formats(tmp_path: Path) -> None:
    said = refusal(tmp_path)
    assert all(name in said for name in ("JSON", "_query.txt", "INRIA Holidays"))
