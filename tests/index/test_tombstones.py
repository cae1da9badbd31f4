"""Tombstones: what is left of each word without the removed images."""

from pathlib import Path

import numpy as np
import pytest

from contracts.errors import BadIndex
from contracts.records import Postings
from index import tombstones
from index.tombstones import count_left, map_counts, map_removed, write_tombstones
from retrieval import merging
from retrieval.packing import Part, pack

N_WORDS, N_IMAGES = 40, 300


def lists() -> list[list[int]]:
    """The images of each word: some in none, some in nearly all."""
    rng = np.random.default_rng(3)
    shares = rng.random(N_WORDS) ** 3
    return [np.flatnonzero(rng.random(N_IMAGES) < share).tolist() for share in shares]


def part_of(images: list[list[int]]) -> Part:
    indptr = np.cumsum([0, *map(len, images)], dtype=np.int64)
    ids = np.array([image for each in images for image in each], dtype=np.uint32)
    return Part(pack(Postings(indptr, ids)), 0, N_IMAGES)


@pytest.mark.parametrize("at_once", [1, 500, 1 << 24])
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_words_are_counted_without_the_removed_images(
    at_once: int, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(merging, "POSTINGS_AT_ONCE", at_once)
    removed = np.random.default_rng(4).random(N_IMAGES) < share
    expected = [sum(not removed[image] for image in each) for each in lists()]
    left = count_left(part_of(lists()), removed)
    assert left.dtype == np.uint32
    assert left.tolist() == expected


def test_tombstones_come_back_as_written(tmp_path: Path) -> None:
    removed = np.array([True, False, True])
    counts = {"hesaff-sift": np.array([0, 2], dtype=np.uint32)}
    written = write_tombstones(tmp_path, removed, counts)
    assert sorted(path.name for path in written) == ["hesaff-sift.npy", "removed.npy"]
    assert map_removed(tmp_path, 3).tolist() == [True, False, True]
    assert map_counts(tmp_path, "hesaff-sift", 2).tolist() == [0, 2]


def test_tombstones_of_another_segment_are_refused(tmp_path: Path) -> None:
    write_tombstones(tmp_path, np.zeros(3, np.bool_), {"orb-sift": np.zeros(2, np.uint32)})
    with pytest.raises(BadIndex, match="of 3 images; the segment has 4"):
        map_removed(tmp_path, 4)
    with pytest.raises(BadIndex, match="of 2 words; the codebook has 5"):
        map_counts(tmp_path, "orb-sift", 5)


def test_the_folder_of_tombstones_is_named_by_generation_and_segment(tmp_path: Path) -> None:
    folder = tombstones.tombstones_folder(tmp_path, "000007", "0002")
    assert folder == tmp_path / "tombstones" / "000007" / "0002"
