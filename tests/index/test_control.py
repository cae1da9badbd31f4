"""What is wished of a job lies in its folder."""

from pathlib import Path

import pytest

from index.control import begin_again, read_wish, write_wish


def test_what_nobody_has_wished_runs(tmp_path: Path) -> None:
    assert read_wish(tmp_path) == "run"
    begin_again(tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("wish", ["pause", "cancel"])
def test_a_wish_holds_until_the_work_is_begun_again(tmp_path: Path, wish: str) -> None:
    write_wish(tmp_path, wish)
    assert read_wish(tmp_path) == wish
    begin_again(tmp_path)
    assert read_wish(tmp_path) == "run"


@pytest.mark.parametrize("content", ["", "[]", '{"wish": "explode"}', '{"wish": ["run"]}', "{"])
def test_a_damaged_wish_runs(tmp_path: Path, content: str) -> None:
    (tmp_path / "control.json").write_text(content)
    assert read_wish(tmp_path) == "run"
