"""Segments on disk: one packed inverted index a channel, and the pieces it is joined from.

`segments/<segment>/<channel>/` holds offsets.npy (V + 1,) int64, where each word's bytes begin;
counts.npy (V,) uint32, its images; packed.npy (B,) uint8; words_per_image.npy (n_images,) uint32.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex
from contracts.records import PackedPostings, Postings
from index.files import map_array, read_member, write_array, write_arrays, write_atomic
from retrieval.packing import pack
from retrieval.postings import distinct_words

_AGAIN = "Remove the job's folder and run the same command again."


@dataclass(frozen=True, slots=True)
class SegmentPaths:
    """The files of one channel of a segment."""

    offsets: Path
    counts: Path
    packed: Path
    words_per_image: Path


def segment_paths(root: Path, segment: str, channel: str) -> SegmentPaths:
    """Where a channel of a segment is."""
    folder = root / "segments" / segment / channel
    return SegmentPaths(
        folder / "offsets.npy",
        folder / "counts.npy",
        folder / "packed.npy",
        folder / "words_per_image.npy",
    )


def map_segment(
    paths: SegmentPaths, n_words: int, n_images: int, *, scattered: bool = False
) -> PackedPostings:
    """Map a channel read-only; headers and sizes are checked here, bytes when they are unpacked.

    scattered : some words will be read, not one after the other; as in `map_array`.

    Raises
    ------
    BadIndex : a file is missing or damaged, or they do not fit each other.
    """
    offsets = map_array(paths.offsets, np.int64, 1, scattered=scattered)
    counts = map_array(paths.counts, np.uint32, 1, scattered=scattered)
    packed = map_array(paths.packed, np.uint8, 1, scattered=scattered)
    expected = {
        paths.offsets: (len(offsets), n_words + 1),
        paths.counts: (len(counts), n_words),
        paths.words_per_image: (len(map_array(paths.words_per_image, np.uint32, 1)), n_images),
    }
    for path, (found, wanted) in expected.items():
        if found != wanted:
            raise BadIndex(
                f"{path} has {found} entries, expected {wanted} for {n_words} words and "
                f"{n_images} images. Restore it or index again."
            )
    if offsets[0] != 0 or offsets[-1] != len(packed):
        raise BadIndex(
            f"{paths.offsets} runs from {offsets[0]} to {offsets[-1]}, expected 0 to the "
            f"{len(packed)} bytes of {paths.packed.name}. Restore them or index again."
        )
    return PackedPostings(offsets, counts, packed)


def write_piece(path: Path, postings: Postings, n_images: int) -> str:
    """Pack a range of words into a file that waits to be joined; returns its sha256.

    Raises
    ------
    BadIndex : an image beyond `n_images`.
    """
    words_per_image = distinct_words(postings, n_images).astype(np.uint32)
    packed = pack(postings)
    return write_arrays(
        path,
        {
            "counts": packed.counts,
            "sizes": np.diff(packed.offsets),
            "words_per_image": words_per_image,
            "packed": packed.packed,
        },
    )


def join_pieces(
    paths: SegmentPaths, pieces: Sequence[Path], n_words: int, n_images: int
) -> tuple[dict[Path, str], int]:
    """Lay the pieces of all words, in the order of their words, end to end.

    Memory is that of a piece, some 30 bytes a word and 8 an image. Returns path -> sha256 and the
    number of postings; the same bytes however the words were cut into pieces.

    Raises
    ------
    BadIndex : a piece is missing, damaged or of another number of images, or words are missing.
    """
    counts: list[NDArray[np.uint32]] = [np.zeros(0, dtype=np.uint32)]
    sizes: list[NDArray[np.int64]] = [np.zeros(1, dtype=np.int64)]
    words_per_image = np.zeros(n_images, dtype=np.uint32)
    for piece in pieces:
        counts.append(read_member(piece, "counts", np.uint32, 1))
        sizes.append(read_member(piece, "sizes", np.int64, 1))
        found = read_member(piece, "words_per_image", np.uint32, 1)
        if len(found) != n_images:
            raise BadIndex(f"{piece} is of {len(found)} images, not {n_images}. {_AGAIN}")
        words_per_image += found
    offsets = np.cumsum(np.concatenate(sizes))
    of_words = np.concatenate(counts)
    if not len(of_words) == len(offsets) - 1 == n_words:
        raise BadIndex(
            f"{len(pieces)} pieces for {paths.packed.parent} hold {len(of_words)} words, the "
            f"codebook {n_words}. {_AGAIN}"
        )

    def copy(stream: IO[bytes]) -> None:
        header = {"descr": "|u1", "fortran_order": False, "shape": (int(offsets[-1]),)}
        np.lib.format.write_array_header_1_0(stream, header)
        for piece in pieces:
            stream.write(read_member(piece, "packed", np.uint8, 1).data)

    written = {
        paths.offsets: write_array(paths.offsets, offsets),
        paths.counts: write_array(paths.counts, of_words),
        paths.packed: write_atomic(paths.packed, copy),
        paths.words_per_image: write_array(paths.words_per_image, words_per_image),
    }
    return written, int(of_words.sum(dtype=np.int64))
