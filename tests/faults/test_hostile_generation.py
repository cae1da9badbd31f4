"""What a generation says is believed only where the index's files bear it out."""

import json
import os
import resource
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_index import CHANNEL, add_survey, index_survey, make_surveys, read, remove_two
from stopping import DONE, run_in_child

from contracts.errors import BadIndex
from index.manifest import generation_path, read_generation
from index.opened import OpenedIndex

PACKED = f"segments/0001/{CHANNEL}/packed.npy"
NUMBERS_FILE = f"segments/0001/{CHANNEL}/words_per_image.npy"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three generations: a survey, a later one added, an image of each removed."""
    folder = tmp_path_factory.mktemp("hostile")
    survey, later = make_surveys(folder)
    index_survey(folder / "index", read(survey))
    add_survey(folder / "index", read(later, "later"))
    remove_two(folder / "index")
    return folder / "index"


@pytest.fixture
def root(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "index"))


def said(root: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(generation_path(root, 3).read_bytes())
    return content


def say(root: Path, content: object) -> None:
    generation_path(root, 3).write_text(json.dumps(content))


def use(root: Path) -> None:
    """Whatever reads an index without a photo."""
    index = OpenedIndex(root)
    n_words = index.parts(CHANNEL)[0].packed.n_words
    lists = index.lists(CHANNEL, np.arange(n_words))
    assert not len(lists.image_ids) or lists.image_ids.max() < index.n_images
    index.idf(CHANNEL)
    index.distinct_words([CHANNEL])
    index.density([CHANNEL])
    index.searcher(CHANNEL)
    index.catalogue.rows([0])
    assert index.kept is None or len(index.kept) == index.n_images


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"format_version": 2}, "format version 2.*Index the survey again"),
        ({"format_version": 4}, "format version 4.*Upgrade Flaneur"),
        ({"number": 2}, "says that it is generation 2"),
        ({"number": -3}, "number"),
        ({"surprise": True}, "surprise"),
        ({"codebooks": "../../etc"}, "codebooks"),
        ({"area": [0.0, 0.0, float("nan"), 1.0]}, "area"),
        ({"segments": []}, "segments"),
        ({"files": {}}, "does not name"),
    ],
)
def test_an_edited_generation_is_refused_by_name(
    root: Path, change: dict[str, object], says: str
) -> None:
    say(root, {**said(root), **change})
    with pytest.raises(BadIndex, match=says) as error:
        use(root)
    assert str(root) in str(error.value) or "Generation 3" in str(error.value)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"n_images": 2**31}, "too short for the 2147483648 images"),
        ({"n_images": 2**32}, "n_images"),
        ({"n_images": 4}, "words_per_image.npy"),
        ({"n_images": 2}, "words_per_image.npy"),
        ({"n_images": -1}, "n_images"),
        ({"n_removed": 4}, "4 of 3 images removed"),
        ({"tombstones": None}, "1 of 3 images removed"),
        ({"tombstones": "../../../etc"}, "tombstones"),
        ({"name": "/etc"}, "name"),
        ({"name": "0002"}, "named twice"),
        ({"name": "0009"}, "0009"),
        ({"quantisation": {CHANNEL: float("inf")}}, "quantisation"),
    ],
)
def test_an_edited_segment_is_refused(root: Path, change: dict[str, object], says: str) -> None:
    content = said(root)
    content["segments"][0].update(change)
    say(root, content)
    with pytest.raises(BadIndex, match=says):
        use(root)


@pytest.mark.parametrize("name", ["../../etc/passwd", "/etc/passwd", "segments/../../x", "", "."])
def test_a_file_outside_the_index_is_refused(root: Path, name: str) -> None:
    content = said(root)
    content["files"][name] = {"sha256": "0" * 64, "size": 5}
    say(root, content)
    with pytest.raises(BadIndex, match="lies outside the index"):
        use(root)


def test_a_file_that_is_a_link_and_a_folder_that_leads_out_are_refused(
    root: Path, tmp_path: Path
) -> None:
    shutil.move(root / "codebooks", tmp_path / "codebooks")
    (root / "codebooks").symlink_to(tmp_path / "codebooks")
    with pytest.raises(BadIndex, match=r"codebooks/0001 leads out of the index to .*/0001"):
        OpenedIndex(root)
    (root / "codebooks").unlink()
    shutil.move(tmp_path / "codebooks", root / "codebooks")
    use(root)
    shutil.move(root / PACKED, tmp_path / "packed.npy")
    (root / PACKED).symlink_to(tmp_path / "packed.npy")
    with pytest.raises(BadIndex, match=r"packed\.npy is a link, expected a file of"):
        OpenedIndex(root)


def large(path: Path) -> None:
    with path.open("wb") as stream:
        stream.truncate(2**30)


def nested(path: Path) -> None:
    path.write_bytes(b'{"a":' + b"[" * 10**6)


def waiting(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize("name", ["CURRENT", "generations/000003.json"])
@pytest.mark.parametrize("make", [large, nested, waiting, folder])
def test_what_is_no_such_text_is_refused_at_once(
    root: Path, name: str, make: Callable[[Path], None]
) -> None:
    make(root / name)
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(BadIndex, match=f"{name}|is not finished"):
        read_generation(root)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used < 100 * 1024


HOSTILE = (None, -1, 0, 2**32, 2**63, 1e300, "", "../..", [], {})


def edits(content: Any) -> Iterator[None]:
    """Put every hostile value in the place of each value in turn, and take each away."""
    places = list(content) if isinstance(content, dict) else range(len(content))
    for place in list(places)[:12]:
        former = content[place]
        if isinstance(former, dict | list):
            yield from edits(former)
        for value in HOSTILE:
            content[place] = value
            yield
        content[place] = former


def test_no_value_in_a_generation_does_more_than_be_refused(root: Path) -> None:
    content = said(root)

    def campaign() -> None:
        used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        n_refused = n = 0
        for n, _ in enumerate(edits(content), 1):  # noqa: B007
            say(root, content)
            try:
                use(root)
            except BadIndex:
                n_refused += 1
        more = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used
        assert n > n_refused > n / 2, (n, n_refused)
        assert more < 100 * 1024, f"{more} KiB more"

    assert run_in_child(campaign) == DONE
