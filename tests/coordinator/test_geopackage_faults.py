"""What happens to a GeoPackage when writing, or the search behind it, ends early."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pyogrio
import pytest
from made_results import failed, made_index, posed

from contracts.errors import WrongInput
from coordinator.export.geopackage import write_geopackage
from coordinator.querying import Located
from index.opened import OpenedIndex


@pytest.fixture
def index(tmp_path: Path) -> OpenedIndex:
    return made_index(tmp_path / "index", [posed("00.jpg", 652000, 6862000)], "EPSG:2154")


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A file that was written before."""
    path = tmp_path / "out" / "r.gpkg"
    path.parent.mkdir()
    path.write_bytes(b"the former file")
    return path


def test_what_ends_the_answers_comes_through_and_the_former_file_stays(
    index: OpenedIndex, out: Path
) -> None:
    def answers() -> Iterator[Located]:
        yield failed("a.jpg")
        raise ConnectionError("the broker went away")

    with pytest.raises(ConnectionError, match="the broker went away"):
        write_geopackage(out, answers(), index)
    assert out.read_bytes() == b"the former file"
    assert list(out.parent.iterdir()) == [out]


def test_the_new_file_replaces_the_former_one(index: OpenedIndex, out: Path) -> None:
    write_geopackage(out, [failed("a.jpg")], index)
    assert len(pyogrio.read_dataframe(out, layer="queries")) == 1
    assert list(out.parent.iterdir()) == [out]
    assert out.stat().st_mode & 0o777 == 0o644


def test_missing_folders_are_made(index: OpenedIndex, tmp_path: Path) -> None:
    write_geopackage(tmp_path / "new" / "folder" / "r.gpkg", [], index)
    assert (tmp_path / "new" / "folder" / "r.gpkg").is_file()


def test_a_place_under_a_file_is_refused(index: OpenedIndex, out: Path) -> None:
    with pytest.raises(WrongInput, match=r"cannot write .*r\.gpkg/x\.gpkg.*\(--out\)"):
        write_geopackage(out / "x.gpkg", [], index)


def test_a_folder_in_its_place_is_refused(index: OpenedIndex, tmp_path: Path) -> None:
    (tmp_path / "r.gpkg").mkdir()
    with pytest.raises(WrongInput, match=r"cannot write .*r\.gpkg.*\(--out\)"):
        write_geopackage(tmp_path / "r.gpkg", [], index)
    assert list((tmp_path / "r.gpkg").iterdir()) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_without_leave_to_write_is_refused(index: OpenedIndex, tmp_path: Path) -> None:
    (tmp_path / "closed").mkdir(mode=0o555)
    with pytest.raises(WrongInput, match=r"cannot write .*Permission denied.*\(--out\)"):
        write_geopackage(tmp_path / "closed" / "r.gpkg", [], index)


FULL_DISK = """
import resource, sys
from pathlib import Path
sys.path[:0] = [sys.argv[1], str(Path(sys.argv[1]).parent)]
from made_results import made_match
from contracts.errors import WrongInput
from coordinator.export.geopackage import write_geopackage
from coordinator.export.vectors import write_vectors
from coordinator.querying import Located
from index.opened import OpenedIndex

index, folder = OpenedIndex(Path(sys.argv[2])), Path(sys.argv[3])
answers = [
    Located(str(n), (made_match(str(n) * 100, 1, 2.34, 48.85, image_id=0),), 0.1)
    for n in range(400)
]
for room, name in ((60_000, "a.gpkg"), (250_000, "b.gpkg"), (60_000, "c.fgb"), (60_000, "d.kml")):
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, resource.RLIM_INFINITY))
    write = write_geopackage if name.endswith("gpkg") else write_vectors
    try:
        write(folder / name, answers, index)
    except WrongInput as error:
        print(error)
"""


def test_a_full_disk_is_told_and_leaves_nothing(index: OpenedIndex, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    said = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(Path(__file__).parent), index.root, folder],
        capture_output=True,
        text=True,
        timeout=100,
    )
    assert said.returncode == 0, said.stderr
    lines = said.stdout.splitlines()
    for name, line in zip(("a.gpkg", "b.gpkg", "c.fgb", "d.kml"), lines, strict=True):
        assert f"cannot write {folder / name}" in line
        assert "(--out)" in line
    assert list(folder.iterdir()) == []
