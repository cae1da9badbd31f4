"""Lists in the two forms of the INRIA Holidays package."""

from pathlib import Path

import pytest

from contracts.errors import BadTruth
from coordinator.truth import JudgedQuery, read_truth

URIS = ["jpg/100000.jpg", "jpg/100001.jpg", "jpg/100002.jpg", "jpg/100100.jpg", "jpg/100101.jpg"]
PATHS = [f"/holidays/{uri}" for uri in URIS]
LIST = "100000.jpg\n100001.jpg\n100002.jpg\n100100.jpg\n100101.jpg\n"
RESULTS = "100100.jpg 0 100101.jpg\n100000.jpg 0 100002.jpg 1 100001.jpg\n"
FIRST = JudgedQuery("100000.jpg", Path(PATHS[0]), relevant=(1, 2), junk=(0,))
SECOND = JudgedQuery("100100.jpg", Path(PATHS[3]), relevant=(4,), junk=(3,))


def read(folder: Path, content: str | bytes, root: Path | None = None) -> list[JudgedQuery]:
    path = folder / "holidays.dat"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_truth(path, root, URIS, PATHS)


def test_each_hundred_is_a_query_and_its_relevant_images(tmp_path: Path) -> None:
    assert read(tmp_path, LIST) == [FIRST, SECOND]


def test_the_list_may_be_in_any_order(tmp_path: Path) -> None:
    backwards = "\n".join(reversed(LIST.split()))
    assert read(tmp_path, backwards) == [SECOND, FIRST]


def test_a_perfect_result_is_the_same_truth(tmp_path: Path) -> None:
    assert read(tmp_path, RESULTS) == [SECOND, FIRST]
    tabs_and_itself = "100000.jpg\t0\t100000.jpg\t1\t100001.jpg\t2\t100002.jpg"
    assert read(tmp_path, tabs_and_itself) == [FIRST]


@pytest.mark.parametrize("content", [LIST, RESULTS])
def test_windows_lines_empty_lines_and_marks_are_no_matter(tmp_path: Path, content: str) -> None:
    dressed = b"\xef\xbb\xbf\r\n" + content.replace("\n", " \r\n\r\n").encode()
    assert read(tmp_path, dressed) == read(tmp_path, content)


def test_folders_may_stand_before_names_with_spaces_in_them(tmp_path: Path) -> None:
    path = tmp_path / "list.txt"
    path.write_text("my photos/100000.jpg\nmy photos/100001.jpg\n")
    uris = ["my photos/100000.jpg", "my photos/100001.jpg"]
    (query,) = read_truth(path, None, uris, ["/0", "/1"])
    assert query == JudgedQuery("my photos/100000.jpg", Path("/0"), (1,), junk=(0,))


def test_a_query_that_is_not_indexed_is_found_under_the_root(tmp_path: Path) -> None:
    path = tmp_path / "list.txt"
    path.write_text("200000.jpg\n100001.jpg\n100000.jpg\n")
    with pytest.raises(BadTruth, match=r"200000\.jpg, is not in the index.*--root"):
        read_truth(path, None, URIS, PATHS)
    (tmp_path / "jpg").mkdir()
    (tmp_path / "jpg" / "200000.jpg").touch()
    alone, other = read_truth(path, tmp_path, URIS, PATHS)
    assert alone == JudgedQuery("200000.jpg", tmp_path / "jpg" / "200000.jpg", ())
    assert other == JudgedQuery("100000.jpg", Path(PATHS[0]), (1,), junk=(0,))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("100000.jpg\n100001.jpg\n100101.jpg\n", "lists 100101.jpg without its query, number 1001"),
        ("100000.jpg\nhouse.jpg\n", "Line 2 of .* is 'house.jpg'; expected a numbered image"),
        ("100000.jpg\n\n100000.jpg 0\n", "Line 3 of .* is '100000.jpg 0'"),
        ("100000.jpg 0 100001.jpg 1\n", "Line 1 of .* is '100000.jpg 0 100001.jpg 1'; expected"),
        ("100000.jpg 0 100001.jpg x 100002.jpg\n", "Line 1 of .* or a query with ranks and images"),
        ("100000.jpg 0 100101.jpg\n", "100000.jpg with 100101.jpg, which is no ground truth"),
        ("100001.jpg 0 100002.jpg\n", "Is it the result of a search"),
        (RESULTS + "100101.jpg\n", "Line 3 of .* has 100101.jpg, which is no ground truth"),
        (RESULTS * 2, "Line 3 of .* has 100100.jpg a second time"),
        ("100000.jpg\n100003.jpg\n", "100000.jpg names 100003.jpg, which is no image"),
    ],
)
def test_a_list_that_does_not_hold_is_quoted(tmp_path: Path, content: str, says: str) -> None:
    with pytest.raises(BadTruth, match=says):
        read(tmp_path, content)
