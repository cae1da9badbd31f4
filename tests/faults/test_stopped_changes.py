"""An index whose change is stopped, or finds the disk full, at any write: nothing is lost."""

import errno
import itertools
import re
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
from small_index import (
    Chapter,
    Contents,
    contents,
    files_in,
    folder_in_memory,
    life,
    make_surveys,
)
from stopping import (
    DONE,
    STOPPED,
    Hear,
    Writes,
    full_from,
    photographed,
    run_in_child,
    stopped_at,
)

from contracts.errors import BadIndex
from index.commits import writing

CHANGES = ("index", "add", "remove", "compact", "rollback", "prune")


FULL_EVERY = 5
"""Of the writes, those at which the disk is tried to be full."""


@pytest.fixture(scope="module")
def place() -> Iterator[Path]:
    with folder_in_memory() as folder:
        yield folder


@pytest.fixture(scope="module")
def chapters(place: Path) -> dict[str, Chapter]:
    return life(place, make_surveys(place))


def found_in(root: Path) -> Contents | str:
    """What is in an index, or why it cannot be opened."""
    try:
        return contents(root)
    except BadIndex as error:
        return str(error).removeprefix(str(root))


def change_again(root: Path, chapter: Chapter, known: set[object]) -> None:
    """Make the change as if nothing had been: everything is as if nothing had been.

    known : what was left before; what is left once more behaves as it did.
    """
    left = frozenset(re.sub(r"(/\.[^/]+)\.\w{8}$", r"\1", name) for name in files_in(root))
    if (left, found_in(root)) not in known:
        known.add((left, found_in(root)))
        chapter.change(root)
        assert contents(root) == chapter.after
        if chapter.tidies:
            assert files_in(root) == chapter.files
    shutil.rmtree(root)


def error_of(work: Callable[[], object], writes: Writes, hear: Hear) -> OSError | None:
    """The error of the system that ends some work while `hear` is asked of every write."""
    writes.hear = hear
    try:
        work()
    except OSError as error:
        return error
    finally:
        writes.hear = None
    return None


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_that_ends_at_any_write_leaves_the_former_index_or_the_new_one(
    chapters: dict[str, Chapter], name: str, place: Path
) -> None:
    chapter, root, shots = chapters[name], place / f"{name} whole", place / f"{name} at each write"
    former, known = found_in(chapter.before), set[object]()
    shutil.copytree(chapter.before, root)
    photographed(root, shots, partial(chapter.change, root))
    seen = []
    for shot in sorted(shots.iterdir()):
        seen.append(found_in(shot))
        change_again(shot, chapter, known)
    assert len(seen) > 3, "writes are not heard"
    n_former = seen.count(former)
    assert seen == [former] * n_former + [chapter.after] * (len(seen) - n_former)
    assert found_in(root) == chapter.after
    shutil.rmtree(root)


@pytest.mark.parametrize("name", CHANGES)
def test_a_process_that_is_stopped_leaves_what_the_pictures_show_and_no_lock(
    chapters: dict[str, Chapter], name: str, place: Path
) -> None:
    chapter, root = chapters[name], place / f"{name} stopped"
    for number in (0, 4, 15, 60):
        shutil.copytree(chapter.before, root)
        outcome = stopped_at(root, number, partial(chapter.change, root))
        assert outcome == STOPPED or (outcome == DONE and found_in(root) == chapter.after), outcome
        with writing(root, patience_s=0):
            pass
        change_again(root, chapter, set())


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_on_a_full_disk_names_the_file_and_goes_on_once_there_is_room(
    chapters: dict[str, Chapter], name: str, place: Path
) -> None:
    chapter, root = chapters[name], place / f"{name} without room"
    allowed = (found_in(chapter.before), chapter.after)

    def fill_from_each_write_on() -> None:
        known, writes = set[object](), Writes(root, None)
        writes.install()
        for first in itertools.count(0, FULL_EVERY):
            shutil.copytree(chapter.before, root)
            error = error_of(partial(chapter.change, root), writes, full_from(first))
            if error is None:
                break
            assert error.errno == errno.ENOSPC
            assert str(error.filename).startswith(f"{root}/"), error
            assert found_in(root) in allowed
            assert not [each for each in files_in(root) if "/." in each], "a part of a file"
            change_again(root, chapter, known)

    assert run_in_child(fill_from_each_write_on) == DONE
    assert found_in(root) == chapter.after
    shutil.rmtree(root)
