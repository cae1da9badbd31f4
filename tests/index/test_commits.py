"""Commits: what is live, who may write, and going back."""

from pathlib import Path

import pytest
from made_generation import a_generation

from contracts.errors import BadIndex
from index.commits import is_worked_on, roll_back, working, writing
from index.files import write_bytes
from index.jobs import JobFolder
from index.manifest import FileEntry, live_number, read_generation


def committed(root: Path, count: int) -> Path:
    for _ in range(count):
        with writing(root) as writer:
            writer.commit(a_generation(writer.next_number()))
    return root


def test_generations_are_numbered_in_the_order_of_commits(tmp_path: Path) -> None:
    committed(tmp_path, 3)
    assert read_generation(tmp_path) == a_generation(3)


def test_a_writer_waits_for_another_and_is_told_when_that_takes_too_long(tmp_path: Path) -> None:
    with (
        writing(tmp_path),
        pytest.raises(BadIndex, match="being written by another process"),
        writing(tmp_path, patience_s=0.0),
    ):
        pass
    committed(tmp_path, 1)


def test_a_lock_that_leads_elsewhere_leaves_what_is_there(tmp_path: Path) -> None:
    (tmp_path / "diary").write_text("mine")
    (tmp_path / "index").mkdir()
    (tmp_path / "index" / ".lock").symlink_to(tmp_path / "diary")
    committed(tmp_path / "index", 1)
    assert (tmp_path / "diary").read_text() == "mine"


def test_going_back_leads_to_the_generation_before_and_forward_again(tmp_path: Path) -> None:
    committed(tmp_path, 3)
    assert roll_back(tmp_path).number == 2
    assert roll_back(tmp_path).number == live_number(tmp_path) == 1
    with pytest.raises(BadIndex, match="no generation before 1"):
        roll_back(tmp_path)
    assert roll_back(tmp_path, 3) == read_generation(tmp_path) == a_generation(3)


def test_a_number_is_not_used_twice_after_going_back(tmp_path: Path) -> None:
    committed(tmp_path, 2)
    roll_back(tmp_path)
    committed(tmp_path, 1)
    assert live_number(tmp_path) == 3


def test_a_generation_whose_files_are_gone_is_not_gone_back_to(tmp_path: Path) -> None:
    committed(tmp_path, 1)
    digest = write_bytes(tmp_path / "catalogue" / "0001.parquet", b"12345")
    entry = FileEntry(sha256=digest, size=5)
    with writing(tmp_path) as writer:
        files = {"catalogue/0001.parquet": entry}
        writer.commit(a_generation(2).model_copy(update={"files": files}))
    committed(tmp_path, 1)
    (tmp_path / "catalogue" / "0001.parquet").write_bytes(b"1234")
    with pytest.raises(BadIndex, match=r"0001\.parquet"):
        roll_back(tmp_path)
    assert live_number(tmp_path) == 3


def test_a_damaged_current_can_be_mended_by_naming_a_generation(tmp_path: Path) -> None:
    committed(tmp_path, 2)
    (tmp_path / "CURRENT").write_text("?")
    with pytest.raises(BadIndex, match="CURRENT holds"):
        roll_back(tmp_path)
    assert roll_back(tmp_path, 1) == read_generation(tmp_path)


@pytest.mark.parametrize("number", [None, 1])
def test_nothing_is_written_where_there_is_no_index(tmp_path: Path, number: int | None) -> None:
    with pytest.raises(BadIndex, match="is not a Flaneur index"):
        roll_back(tmp_path, number)
    assert not list(tmp_path.iterdir())


def test_a_job_can_be_seen_to_be_worked_on_by_several(tmp_path: Path) -> None:
    job = JobFolder(tmp_path, "0123456789abcdef")
    write_bytes(job.path / "plan.json", b"{}")
    with working(job):
        with working(job):
            assert is_worked_on(job)
        assert is_worked_on(job)
    assert not is_worked_on(job)
