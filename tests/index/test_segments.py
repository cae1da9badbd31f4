"""Segments are the same bytes however they were cut, and files that do not fit are refused."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from contracts.errors import BadIndex
from contracts.records import Postings
from index.files import sha256_of, write_array, write_arrays
from index.segments import SegmentPaths, join_pieces, map_segment, segment_paths, write_piece
from retrieval.merging import keys_of_words, merge_keys
from retrieval.packing import Part, unpack
from retrieval.postings import build_postings, posting_keys

N_WORDS, N_IMAGES = 23, 40


def pairs(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    words = rng.integers(0, N_WORDS, 500).astype(np.int32)
    return words, rng.integers(0, N_IMAGES, 500).astype(np.uint32)


def merged_segment(
    folder: Path, bounds: Sequence[int], n_shards: int = 1
) -> tuple[SegmentPaths, dict[Path, str], int]:
    """Merge shards of random pairs by ranges of words, and join them in `folder`."""
    words, images = pairs(5)
    shards = np.array_split(np.arange(500), n_shards)[::-1]
    partials = [posting_keys(words[rows], images[rows], N_WORDS) for rows in shards]
    pieces = []
    for first, stop in pairwise(bounds):
        runs = [keys_of_words(keys, first, stop) for keys in partials]
        pieces.append(folder / f"{first}.npz")
        write_piece(pieces[-1], merge_keys(runs, first, stop - first), N_IMAGES)
    paths = segment_paths(folder, "0001", "hesaff-sift")
    return paths, *join_pieces(paths, pieces, N_WORDS, N_IMAGES)


def files_of(paths: SegmentPaths) -> list[Path]:
    return [paths.offsets, paths.counts, paths.packed, paths.words_per_image]


@pytest.mark.parametrize("bounds", [[0, 23], [0, 7, 14, 23], list(range(24))])
@pytest.mark.parametrize("n_shards", [1, 11])
def test_a_segment_is_the_same_bytes_for_any_shards_and_ranges(
    tmp_path: Path, bounds: list[int], n_shards: int
) -> None:
    whole = build_postings(*pairs(5), N_WORDS)
    paths, written, n_postings = merged_segment(tmp_path, bounds, n_shards)
    packed = map_segment(paths, N_WORDS, N_IMAGES)
    lists = unpack([Part(packed, 0, N_IMAGES)], np.arange(N_WORDS))
    np.testing.assert_array_equal(lists.indptr, whole.indptr)
    np.testing.assert_array_equal(lists.image_ids, whole.image_ids)
    assert n_postings == packed.n_postings == len(whole.image_ids)
    assert written == {path: sha256_of(path) for path in files_of(paths)}
    counted = np.bincount(whole.image_ids, minlength=N_IMAGES)
    np.testing.assert_array_equal(np.load(paths.words_per_image), counted)
    once, _, _ = merged_segment(tmp_path / "once", [0, 23])
    for path, other in zip(files_of(paths), files_of(once), strict=True):
        assert path.read_bytes() == other.read_bytes()
    assert sorted(paths.packed.parent.iterdir()) == sorted(files_of(paths))


@pytest.mark.parametrize("n_words", [0, 4])
def test_a_segment_without_postings_can_be_written_and_read(tmp_path: Path, n_words: int) -> None:
    pieces = [tmp_path / "piece.npz"] if n_words else []
    for piece in pieces:
        write_piece(piece, merge_keys([], 0, n_words), 3)
    paths = segment_paths(tmp_path, "0001", "hesaff-sift")
    _, n_postings = join_pieces(paths, pieces, n_words, 3)
    packed = map_segment(paths, n_words, 3)
    assert n_postings == packed.n_postings == 0
    assert len(unpack([Part(packed, 0, 3)], np.arange(n_words)).image_ids) == 0


def test_a_piece_that_names_an_image_beyond_the_segment_is_refused(tmp_path: Path) -> None:
    lists = Postings(np.array([0, 1]), np.array([N_IMAGES], np.uint32))
    with pytest.raises(BadIndex, match="beyond the catalogue's 40"):
        write_piece(tmp_path / "piece.npz", lists, N_IMAGES)


def test_pieces_must_be_there_and_of_this_segment(tmp_path: Path) -> None:
    piece = tmp_path / "piece.npz"
    write_piece(piece, merge_keys([], 0, 4), 3)
    paths = segment_paths(tmp_path, "0001", "hesaff-sift")
    with pytest.raises(BadIndex, match="of 3 images, not 5"):
        join_pieces(paths, [piece], 4, 5)
    with pytest.raises(BadIndex, match="hold 4 words, the codebook 8"):
        join_pieces(paths, [piece], 8, 3)
    with pytest.raises(BadIndex, match=r"gone\.npz"):
        join_pieces(paths, [tmp_path / "gone.npz"], 4, 3)
    write_arrays(piece, {"counts": np.zeros(4, np.uint32)})
    with pytest.raises(BadIndex, match="sizes"):
        join_pieces(paths, [piece], 4, 3)
    assert not paths.packed.exists()


@pytest.mark.parametrize("name", ["offsets", "counts", "packed", "words_per_image"])
def test_files_that_do_not_fit_each_other_are_refused(tmp_path: Path, name: str) -> None:
    paths, _, _ = merged_segment(tmp_path, [0, 23])
    path: Path = getattr(paths, name)
    write_array(path, np.load(path)[:-1])
    with pytest.raises(BadIndex, match=path.name.replace(".", r"\.")):
        map_segment(paths, N_WORDS, N_IMAGES)


def test_a_segment_of_another_codebook_is_refused(tmp_path: Path) -> None:
    paths, _, _ = merged_segment(tmp_path, [0, 23])
    with pytest.raises(BadIndex, match=r"24 entries, expected 100 for 99 words"):
        map_segment(paths, 99, N_IMAGES)
