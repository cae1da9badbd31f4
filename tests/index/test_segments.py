"""Merging partial indices, a range of words at a time."""

from pathlib import Path

import numpy as np
import pytest

from contracts.errors import BadIndex
from contracts.records import Postings
from index.files import sha256_of, write_array
from index.segments import map_postings, write_segment
from retrieval.postings import build_postings

N_WORDS, N_IMAGES = 23, 40


def partials(folder: Path, seed: int, n_shards: int) -> tuple[list[tuple[Path, Path]], Postings]:
    """Random postings, cut into shards of images; and all of them in one piece."""
    rng = np.random.default_rng(seed)
    words = rng.integers(0, N_WORDS, 500).astype(np.int32)
    images = np.sort(rng.integers(0, N_IMAGES, 500)).astype(np.uint32)
    parts = []
    for number, rows in enumerate(np.array_split(np.arange(500), n_shards)):
        part = build_postings(words[rows], images[rows], N_WORDS)
        paths = (folder / f"{number}.indptr.npy", folder / f"{number}.ids.npy")
        write_array(paths[0], part.indptr)
        write_array(paths[1], part.image_ids)
        parts.append(paths)
    return parts, build_postings(words, images, N_WORDS)


def segment_files(folder: Path) -> tuple[Path, Path, Path]:
    return folder / "indptr.npy", folder / "image_ids.npy", folder / "words_per_image.npy"


@pytest.mark.parametrize("words_at_once", [1, 7, 23, 1000])
@pytest.mark.parametrize("n_shards", [1, 3, 11])
def test_a_segment_is_the_same_bytes_for_any_shards_and_ranges(
    tmp_path: Path, words_at_once: int, n_shards: int
) -> None:
    parts, whole = partials(tmp_path, 5, n_shards)
    files = segment_files(tmp_path / "segment")
    written, n_postings = write_segment(files, parts[::-1], N_WORDS, N_IMAGES, words_at_once)
    merged = map_postings(files[0], files[1], N_WORDS)
    np.testing.assert_array_equal(merged.indptr, whole.indptr)
    np.testing.assert_array_equal(merged.image_ids, whole.image_ids)
    assert n_postings == len(whole.image_ids)
    assert written == {path: sha256_of(path) for path in files}
    counted = np.bincount(whole.image_ids, minlength=N_IMAGES)
    np.testing.assert_array_equal(np.load(files[2]), counted)
    assert sorted(each.name for each in (tmp_path / "segment").iterdir()) == sorted(
        each.name for each in files
    )


def test_a_segment_without_postings_can_be_written_and_read(tmp_path: Path) -> None:
    empty = build_postings(np.zeros(0, np.int32), np.zeros(0, np.uint32), 4)
    paths = (tmp_path / "p.npy", tmp_path / "i.npy")
    write_array(paths[0], empty.indptr)
    write_array(paths[1], empty.image_ids)
    files = segment_files(tmp_path / "segment")
    _, n_postings = write_segment(files, [paths], 4, 3, 2)
    assert n_postings == 0
    assert len(map_postings(files[0], files[1]).image_ids) == 0


def test_offsets_that_do_not_fit_the_ids_are_refused(tmp_path: Path) -> None:
    parts, _ = partials(tmp_path, 5, 1)
    write_array(parts[0][1], np.zeros(3, dtype=np.uint32))
    with pytest.raises(BadIndex, match="do not fit"):
        map_postings(*parts[0])


def test_partials_of_another_codebook_are_refused(tmp_path: Path) -> None:
    parts, _ = partials(tmp_path, 5, 1)
    with pytest.raises(BadIndex, match=f"for {N_WORDS} words; the codebook has 99"):
        map_postings(*parts[0], 99)
