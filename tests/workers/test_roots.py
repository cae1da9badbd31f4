"""Roots: a path of the coordinator becomes ours, and none leads out of where we may work."""

from pathlib import Path

import pytest

from contracts.errors import BadConfig, Refused
from workers.roots import Roots, roots_here


def test_a_path_below_a_root_moves_with_it() -> None:
    roots = Roots({"ARCHIVE": "/data/archive"}, {"ARCHIVE": "/mnt/a"})
    assert roots.local("/data/archive/town/1.jpg") == "/mnt/a/town/1.jpg"
    assert roots.local("/data/archive") == "/mnt/a"


def test_a_root_may_be_a_store_on_one_machine_and_a_folder_on_another() -> None:
    roots = Roots({"A": "/data/archive"}, {"A": "s3://bucket/archive"})
    assert roots.local("/data/archive/town/1.jpg") == "s3://bucket/archive/town/1.jpg"
    roots = Roots({"A": "s3://bucket/archive"}, {"A": "/data/archive"})
    assert roots.local("s3://bucket/archive/town/1.jpg") == "/data/archive/town/1.jpg"


def test_the_innermost_root_counts() -> None:
    roots = Roots({"A": "/data", "B": "/data/b"}, {"A": "/mnt/a", "B": "/mnt/b"})
    assert roots.local("/data/b/1.jpg") == "/mnt/b/1.jpg"
    assert roots.local("/data/bb/1.jpg") == "/mnt/a/bb/1.jpg"


def test_the_whole_file_system_may_be_a_root() -> None:
    assert Roots({"A": "/"}, {"A": "/mnt/all"}).local("/data/1.jpg") == "/mnt/all/data/1.jpg"
    assert Roots({"A": "/mnt/all"}, {"A": "/"}).local("/mnt/all/data/1.jpg") == "/data/1.jpg"


def test_without_roots_of_our_own_paths_are_taken_as_they_are() -> None:
    assert Roots({"A": "/data"}, {}).local("/elsewhere/1.jpg") == "/elsewhere/1.jpg"


@pytest.fixture
def confined(tmp_path: Path) -> Roots:
    """One root, beside a secret, with links to it in every way there is."""
    inside, outside = tmp_path / "inside", tmp_path / "inside-out"
    for folder in (inside, outside):
        folder.mkdir()
        (folder / "secret").write_text("secret")
    (inside / "link").symlink_to(outside / "secret")
    (inside / "folder").symlink_to(outside)
    (inside / "relative").symlink_to("../inside-out/secret")
    (inside / "dangling").symlink_to(outside / "not yet there")
    (inside / "round").symlink_to(inside / "round")
    (inside / "within").symlink_to(inside / "secret")
    return Roots({"A": "/data"}, {"A": str(inside)})


@pytest.mark.parametrize("path", ["/data/secret", "/data/within", "/data/./new/../secret"])
def test_what_stays_inside_is_opened(confined: Roots, path: str) -> None:
    assert Path(confined.local(path)).is_relative_to(confined.ours["A"])


@pytest.mark.parametrize(
    "path",
    [
        "/etc/passwd",
        "/data/../inside-out/secret",
        "/data/../../../../../../etc/passwd",
        "/data/link",
        "/data/folder/secret",
        "/data/folder/new",
        "/data/relative",
        "/data/dangling",
        "/data/secret\0.jpg",
        "/database/secret",
        "data/secret",
        "secret",
        "",
        "~/secret",
        "file:///etc/passwd",
        "file:///data/secret",
        "s3://bucket/secret",
        "http://127.0.0.1/secret",
    ],
)
def test_what_leads_out_is_refused(confined: Roots, path: str) -> None:
    with pytest.raises(Refused, match="roots"):
        confined.local(path)


def test_a_coordinator_cannot_widen_a_root_by_what_it_says_of_its_own(confined: Roots) -> None:
    for theirs in ("", "/", "/data/..", "/etc"):
        with pytest.raises(Refused):
            Roots({"A": theirs}, confined.ours).local("/etc/../etc/../../etc/passwd")


@pytest.mark.parametrize(
    "path",
    [
        "s3://bucket/archive/../other/1.jpg",
        "s3://bucket/archive/%2e%2e/other/1.jpg",
        "s3://bucket/archive-too/1.jpg",
        "s3://bucket",
        "s3://other/archive/1.jpg",
        "http://bucket/archive/1.jpg",
        "s3://bucket/archive/1.zip::file:///etc/passwd",
        "simplecache::s3://bucket/archive/1.jpg",
        "/bucket/archive/1.jpg",
    ],
)
def test_a_store_is_not_left_either(path: str) -> None:
    with pytest.raises(Refused, match="roots"):
        Roots({}, {"A": "s3://bucket/archive"}).local(path)


def test_roots_come_from_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLANEUR_ROOT_ARCHIVE", "/data/archive/")
    monkeypatch.setenv("FLANEUR_ROOT_ALL", "/")
    monkeypatch.setenv("FLANEUR_ROOT_NONE", "")
    assert roots_here() == {"ALL": "/", "ARCHIVE": "/data/archive"}


@pytest.mark.parametrize("value", ["data/archive", "file:///data/archive", "~/archive", "."])
def test_a_root_that_is_no_place_is_told(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    monkeypatch.setenv("FLANEUR_ROOT_ARCHIVE", value)
    with pytest.raises(BadConfig, match="expected an absolute path"):
        roots_here()
