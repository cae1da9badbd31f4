"""Several processes at one index: writers take turns, readers keep what they opened."""

import os
import shutil
import signal
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from small_index import (
    CHANNEL,
    Silent,
    add_survey,
    compact_all,
    contents,
    folder_in_memory,
    index_survey,
    make_surveys,
    read,
    remove_two,
)

from contracts.config import Where
from contracts.errors import BadIndex
from coordinator.pruning import prune
from coordinator.removing import remove_images
from index.commits import writing
from index.manifest import generation_numbers, live_number
from index.opened import OpenedIndex


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Path]]:
    """An index of a survey of three images, and a later survey of two."""
    with folder_in_memory() as folder:
        surveys = make_surveys(folder)
        index_survey(folder / "index", read(surveys[0]))
        yield folder / "index", surveys[1]


@pytest.fixture
def root(made: tuple[Path, Path], tmp_path: Path) -> Path:
    return Path(shutil.copytree(made[0], tmp_path / "index"))


def begin(work: Callable[[], object]) -> int:
    """Fork a process that does some work; its id."""
    child = os.fork()
    if child == 0:
        signal.alarm(60)
        code = 1
        try:
            work()
            code = 0
        finally:
            os._exit(code)
    return child


def ended_well(child: int) -> bool:
    return os.waitpid(child, 0)[1] == 0


def remove(root: Path, uri: str) -> None:
    remove_images(root, Where(), (uri,), (), Silent())


def test_two_writers_at_once_are_both_in(root: Path, made: tuple[Path, Path]) -> None:
    later = read(made[1], "later")
    with writing(root):  # until both stand before it
        children = [
            begin(partial(remove, root, "01.jpg")),
            begin(partial(add_survey, root, later)),
            begin(partial(remove, root, "02.jpg")),
        ]
        time.sleep(0.3)
        assert generation_numbers(root) == (1,)
    ends = [ended_well(child) for child in children]
    assert all(ends)
    assert generation_numbers(root) == (1, 2, 3, 4)
    index = OpenedIndex(root)
    uris = index.catalogue.column("uri")
    assert index.kept is not None
    assert [uri for uri, kept in zip(uris, index.kept, strict=True) if kept] == [
        "00.jpg",
        "later/03.jpg",
        "later/04.jpg",
    ]
    contents(root)


def test_the_lock_of_a_killed_writer_is_free_at_once(root: Path) -> None:
    ready, told = os.pipe()

    def hold() -> None:
        with writing(root):
            os.write(told, b"x")
            time.sleep(60)

    child = begin(hold)
    os.read(ready, 1)
    with pytest.raises(BadIndex, match="another process"), writing(root, patience_s=0):
        pass
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    with writing(root, patience_s=0) as writer:
        assert writer.next_number() == 2


def lists_of(index: OpenedIndex) -> tuple[np.ndarray, ...]:
    words = np.arange(index.parts(CHANNEL)[0].packed.n_words)
    lists = index.lists(CHANNEL, words)
    return lists.indptr, lists.image_ids, index.idf(CHANNEL)


def test_a_reader_keeps_its_generation_while_others_write(
    root: Path, made: tuple[Path, Path]
) -> None:
    """One that has read before the files went, and one that only opened them."""
    read_before, opened_only = OpenedIndex(root), OpenedIndex(root)
    before, uris = lists_of(read_before), read_before.catalogue.column("uri")
    add_survey(root, read(made[1], "later"))
    remove_two(root)
    compact_all(root)
    assert live_number(root) == 4
    for index in (read_before, opened_only, OpenedIndex(root, 1)):
        for found, expected in zip(lists_of(index), before, strict=True):
            np.testing.assert_array_equal(found, expected, strict=True)
        assert index.catalogue.column("uri") == uris
    late = OpenedIndex(root, 2)
    prune(root)
    for found, expected in zip(lists_of(read_before), before, strict=True):
        np.testing.assert_array_equal(found, expected, strict=True)
    with pytest.raises(BadIndex, match=r"cannot be read .*No such file"):
        late.lists(CHANNEL, np.arange(3))
    with pytest.raises(BadIndex, match="has no generation 1; there are: 4"):
        OpenedIndex(root, 1)
    assert OpenedIndex(root).n_live == 3
