"""Packed postings: a word's ascending images as gaps, each block in as few bits as it needs.

Blocks of 128 gaps share one width (binary packing: Lemire & Boytsov, Decoding billions of
integers per second through vectorization, 2015; Lucene's FOR). docs/index-format.md has the bytes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.errors import BadIndex, VocabularyMismatch, WrongInput
from contracts.records import PackedPostings, Postings
from retrieval import packing_kernels as kernels
from retrieval.kernels import read_only


@dataclass(frozen=True, slots=True)
class Part:
    """The packed postings of a segment, whose images have the ids from `first_image` on."""

    packed: PackedPostings
    first_image: int
    n_images: int


def pack(postings: Postings) -> PackedPostings:
    """Pack every word's images; a word's bytes depend on nothing but its own list.

    Parameters
    ----------
    postings : image_ids strictly ascending within a word.

    Raises
    ------
    WrongInput : offsets that do not fit, or images out of order.
    """
    indptr = read_only(postings.indptr, np.int64)
    image_ids = read_only(postings.image_ids, np.uint32)
    if len(indptr) == 0 or indptr[0] != 0 or indptr[-1] != len(image_ids):
        raise WrongInput(f"postings to pack have offsets that do not end at {len(image_ids)}")
    offsets = np.zeros(len(indptr), dtype=np.int64)
    if kernels.measure(indptr, image_ids, offsets) == kernels.DAMAGED:
        raise WrongInput("postings to pack must ascend strictly within each word")
    packed = np.zeros(int(offsets[-1]), dtype=np.uint8)
    kernels.write(indptr, image_ids, offsets, packed)
    return PackedPostings(offsets, np.diff(indptr).astype(np.uint32), packed)


def unpack(
    parts: Sequence[Part],
    word_ids: NDArray[np.int64] | NDArray[np.int32],
    kept: NDArray[np.bool_] | None = None,
) -> Postings:
    """Read the images of some words, joined over the parts of an index.

    Parameters
    ----------
    parts : of one codebook, by ascending `first_image`.
    word_ids : (m,), in any order.
    kept : (n_images,) bool over the whole index, who is listed; None: everyone.

    Returns
    -------
    Postings of m words in the order of `word_ids`, images ascending within each.

    Raises
    ------
    VocabularyMismatch : the parts were built from different codebooks.
    BadIndex : a word outside the codebook, an image outside its part, or damaged bytes.
    """
    _check(parts, kept)
    words = read_only(word_ids.astype(np.int64, copy=False), np.int64)
    lengths = np.zeros(len(words), dtype=np.int64)
    plain = [_plain(part) for part in parts]
    for part, (offsets, counts, packed) in zip(parts, plain, strict=True):
        if kernels.count(words, offsets, counts, packed, part.n_images, lengths) < 0:
            raise _damaged(part)
    indptr = np.zeros(len(words) + 1, dtype=np.int64)
    np.cumsum(lengths, out=indptr[1:])
    image_ids = np.empty(int(indptr[-1]), dtype=np.uint32)
    filled = indptr[:-1].copy()
    for part, (offsets, counts, packed) in zip(parts, plain, strict=True):
        ids = part.first_image, part.n_images
        if kernels.read(words, offsets, counts, packed, *ids, filled, image_ids) < 0:
            raise _damaged(part)
    if kept is None:
        return Postings(indptr, image_ids)
    kernels.keep(indptr, image_ids, read_only(kept, np.bool_))
    return Postings(indptr, image_ids[: indptr[-1]])


def _check(parts: Sequence[Part], kept: NDArray[np.bool_] | None) -> None:
    sizes = sorted({part.packed.n_words for part in parts})
    if len(sizes) > 1:
        raise VocabularyMismatch(
            f"segments of codebooks with {sizes} words cannot be searched together; "
            "index all surveys with one set of codebooks"
        )
    n_images = max((part.first_image + part.n_images for part in parts), default=0)
    if kept is not None and len(kept) != n_images:
        raise WrongInput(f"{len(kept)} images were said to be kept or not, of {n_images}")


def _plain(part: Part) -> tuple[NDArray[np.int64], NDArray[np.uint32], NDArray[np.uint8]]:
    packed = part.packed
    if len(packed.offsets) != packed.n_words + 1:
        raise _damaged(part)
    return (
        read_only(packed.offsets, np.int64),
        read_only(packed.counts, np.uint32),
        read_only(packed.packed, np.uint8),
    )


def _damaged(part: Part) -> BadIndex:
    return BadIndex(
        f"The postings of images {part.first_image} to {part.first_image + part.n_images - 1} are "
        f"damaged, or a word beyond the codebook's {part.packed.n_words} was asked for. "
        "`flaneur verify` names the file; restore it or index again."
    )
