"""Generations: what may be opened, and what is refused with which words."""

import json
from pathlib import Path

import pytest
from made_generation import a_generation

from contracts.errors import BadIndex
from index.commits import writing
from index.manifest import FORMAT_VERSION, Generation, read_generation


def commit(root: Path, generation: Generation) -> None:
    with writing(root) as writer:
        writer.commit(generation)


def test_the_last_commit_is_the_read_generation(tmp_path: Path) -> None:
    commit(tmp_path, a_generation(1))
    commit(tmp_path, a_generation(2))
    assert read_generation(tmp_path) == a_generation(2)


@pytest.mark.parametrize("make", [lambda path: None, lambda path: (path / "x").write_text("y")])
def test_a_folder_that_is_no_index_is_refused(tmp_path: Path, make: object) -> None:
    make(tmp_path)  # type: ignore[operator]
    with pytest.raises(BadIndex, match="is not a Flaneur index"):
        read_generation(tmp_path)


def test_a_missing_folder_says_how_to_make_an_index(tmp_path: Path) -> None:
    with pytest.raises(BadIndex, match="flaneur index SURVEY"):
        read_generation(tmp_path / "nowhere")


def test_an_unfinished_index_says_how_to_go_on(tmp_path: Path) -> None:
    (tmp_path / "jobs").mkdir()
    with pytest.raises(BadIndex, match="not finished"):
        read_generation(tmp_path)


def test_a_future_format_is_refused_by_its_number(tmp_path: Path) -> None:
    commit(tmp_path, a_generation())
    path = tmp_path / "generations" / "000001.json"
    content = json.loads(path.read_text())
    content["format_version"] = FORMAT_VERSION + 1
    content["something"] = "not known here"
    path.write_text(json.dumps(content))
    with pytest.raises(BadIndex, match=f"format version {FORMAT_VERSION + 1}.*Upgrade"):
        read_generation(tmp_path)


@pytest.mark.parametrize("text", ["", "../../etc/passwd", "000001\x00", "one"])
def test_a_damaged_current_never_leaves_the_index(tmp_path: Path, text: str) -> None:
    commit(tmp_path, a_generation())
    (tmp_path / "CURRENT").write_text(text)
    with pytest.raises(BadIndex, match="CURRENT holds"):
        read_generation(tmp_path)


def test_a_former_format_is_to_be_indexed_again(tmp_path: Path) -> None:
    commit(tmp_path, a_generation())
    path = tmp_path / "generations" / "000001.json"
    content = json.loads(path.read_text())
    content["format_version"] = FORMAT_VERSION - 1
    path.write_text(json.dumps(content))
    with pytest.raises(BadIndex, match=f"format version {FORMAT_VERSION - 1}.*again"):
        read_generation(tmp_path)


@pytest.mark.parametrize("text", ["{", "[]", '{"format_version": 3}'])
def test_a_damaged_generation_names_its_file(tmp_path: Path, text: str) -> None:
    commit(tmp_path, a_generation())
    (tmp_path / "generations" / "000001.json").write_text(text)
    with pytest.raises(BadIndex, match=r"000001\.json"):
        read_generation(tmp_path)
