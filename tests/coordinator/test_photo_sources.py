"""Photos listed by folders, tables and lines."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from contracts.errors import WrongInput
from coordinator.batches.fetching import Fetcher
from coordinator.batches.lists import paths_in, read_list
from coordinator.batches.photos import Photo, photo_file, read_photos, told_apart, write_photos
from coordinator.batches.sources import read_sources


@pytest.fixture
def fetcher() -> Iterator[Fetcher]:
    with Fetcher() as each:
        yield each


def test_a_folder_is_its_images_by_the_bytes_of_their_names(
    tmp_path: Path, fetcher: Fetcher
) -> None:
    for name in ("b.jpg", "B.png", "sub/a.TIF", "é.jpg", "notes.txt", ".hidden.jpg"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    (tmp_path / "outside.jpg").symlink_to("/etc/hostname")
    found = read_sources([str(tmp_path)], fetcher)
    names = [Path(each.query).relative_to(tmp_path).as_posix() for each in found]
    assert names == ["B.png", "b.jpg", "outside.jpg", "sub/a.TIF", "é.jpg"]
    assert "leads out" in found[2].error
    assert [each.path for each in found if not each.error] == [
        each.query for each in found if not each.error
    ]


def test_an_empty_folder_is_refused(tmp_path: Path, fetcher: Fetcher) -> None:
    with pytest.raises(WrongInput, match="holds no photo"):
        read_sources([str(tmp_path)], fetcher)


def test_paths_of_a_table_are_relative_to_it_and_addresses_are_fetched(
    tmp_path: Path, fetcher: Fetcher
) -> None:
    table = tmp_path / "list.csv"
    table.write_text("id,Photo,year\n1,old/a.jpg,1900\n2,/abs/b.jpg,1910\n3,https://e.org/c,1920\n")
    found = read_sources([str(table), str(tmp_path / "old" / "a.jpg")], fetcher)
    assert found == [
        photo_file(str(tmp_path / "old" / "a.jpg")),
        photo_file("/abs/b.jpg"),
        Photo("https://e.org/c", urls=("https://e.org/c",)),
    ]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32", "latin-1"])
def test_a_list_is_read_in_the_usual_encodings(tmp_path: Path, encoding: str) -> None:
    table = tmp_path / "list.tsv"
    table.write_bytes("titre\timage\r\nété\tété.jpg\r\n\tb.jpg\r\n".encode(encoding))
    assert read_list(table) == ["été.jpg", "b.jpg"]


@pytest.mark.parametrize(
    ("name", "text", "paths"),
    [
        ("a.csv", "a.jpg\nb.jpg\n", ["a.jpg", "b.jpg"]),
        ("a.csv", "path\na.jpg\n", ["a.jpg"]),
        ("a.csv", 'file;n\n"a;1.jpg";2\n', ["a;1.jpg"]),
        ("a.txt", "Rue, 1900.jpg\nb.jpg\n\n", ["Rue, 1900.jpg", "b.jpg"]),
        ("stdin", "a.jpg\n", ["a.jpg"]),
    ],
)
def test_one_column_needs_no_header(name: str, text: str, paths: list[str]) -> None:
    assert paths_in(text, name) == paths


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("a,b\n1,2\n", "calls none path, file"),
        ("\n \n", "names no photo"),
        ("path\n", "names no photo"),
        ("a\0b", "NUL"),
        ('path,n\n"a.jpg,1\n', "cannot be taken apart"),
    ],
)
def test_a_list_of_which_nobody_can_tell_is_refused(text: str, says: str) -> None:
    with pytest.raises(WrongInput, match=says):
        paths_in(text, "list.csv")


def test_names_that_globs_give_twice_are_one_photo(fetcher: Fetcher) -> None:
    found = read_sources(["a.jpg", "b.jpg", "a.jpg"], fetcher)
    assert [each.query for each in found] == ["a.jpg", "b.jpg"]


def test_other_addresses_are_refused(fetcher: Fetcher) -> None:
    with pytest.raises(WrongInput, match="http and https"):
        read_sources(["ftp://example.org/a.jpg"], fetcher)


def test_another_scheme_in_a_list_is_an_error_of_that_photo_alone(
    tmp_path: Path, fetcher: Fetcher
) -> None:
    table = tmp_path / "list.txt"
    table.write_text("s3://bucket/a.jpg\nb.jpg\n")
    elsewhere, here = read_sources([str(table)], fetcher)
    assert (elsewhere.query, here.error) == ("s3://bucket/a.jpg", "")
    assert "http and https" in elsewhere.error


def test_a_list_of_windows_names_what_windows_does(tmp_path: Path) -> None:
    table = tmp_path / "list.txt"
    table.write_bytes("Sacré-Cœur.jpg\nrue de l’Est….jpg\n".encode("cp1252"))
    assert read_list(table) == ["Sacré-Cœur.jpg", "rue de l’Est….jpg"]


def test_two_photos_of_one_full_name_are_both_kept() -> None:
    same = [Photo("1r", urls=(url,), full_name="id") for url in ("a", "b", "a")]
    other = Photo("1r", urls=("c",), full_name="other")
    found = told_apart([*same, other])
    assert [(each.query, *each.urls) for each in found] == [
        ("id", "a"),
        ("id (2)", "b"),
        ("other", "c"),
    ]


def test_a_list_on_disk_holds_every_name(tmp_path: Path) -> None:
    photos = [Photo("a\nb\udcff.jpg", "/a\nb\udcff.jpg"), Photo("é", urls=("u", "v"), info="i")]
    write_photos(tmp_path / "photos.jsonl", photos)
    assert list(read_photos(tmp_path / "photos.jsonl")) == photos
