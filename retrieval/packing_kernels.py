"""The loops that pack and unpack postings; whatever the bytes say, they stay in the arrays.

A block is its width, one byte, and up to 128 gaps of so many bits each, lowest bit first.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from retrieval.instructions import load_uint64, prefetch
from retrieval.kernels import kernel

BLOCK = 128
DAMAGED = -1

_MAX_WIDTH = 32
_LOADED = 8
"""Bytes read at once: any 32 bits, wherever in their first byte they begin."""
_AHEAD = 8
"""Lists that are fetched while one is unpacked; 1.7 times as fast where they lie far apart."""
_LINE, _LINES_AHEAD = 64, 4

_Offsets: TypeAlias = NDArray[np.int64]
_Ids: TypeAlias = NDArray[np.uint32]
_Bytes: TypeAlias = NDArray[np.uint8]
_Int: TypeAlias = int | np.int64


@kernel
def measure(indptr: _Offsets, image_ids: _Ids, offsets: _Offsets) -> int:
    """Fill in where each word's bytes begin; DAMAGED if images do not ascend."""
    for word in range(len(indptr) - 1):
        start, stop = indptr[word], indptr[word + 1]
        if start > stop:
            return DAMAGED
        size, previous = np.int64(0), np.int64(-1)
        for first in range(start, stop, BLOCK):
            last = min(first + BLOCK, stop)
            for i in range(first, last):
                if image_ids[i] <= previous:
                    return DAMAGED
                previous = np.int64(image_ids[i])
            size += 1 + _size(last - first, _width(image_ids, start, first, last))
        offsets[word + 1] = offsets[word] + size
    return 0


@kernel
def write(indptr: _Offsets, image_ids: _Ids, offsets: _Offsets, packed: _Bytes) -> None:
    """Pack postings that `measure` measured into zeros."""
    for word in range(len(indptr) - 1):
        start, stop = indptr[word], indptr[word + 1]
        at = offsets[word]
        for first in range(start, stop, BLOCK):
            last = min(first + BLOCK, stop)
            width = _width(image_ids, start, first, last)
            packed[at] = width
            at += 1
            held, n_held = np.uint64(0), 0
            for i in range(first, last):
                held |= np.uint64(_gap(image_ids, start, i)) << np.uint64(n_held)
                n_held += width
                while n_held >= 8:
                    packed[at] = held & np.uint64(255)
                    held >>= np.uint64(8)
                    at += 1
                    n_held -= 8
            if n_held > 0:
                packed[at] = held
                at += 1


@kernel
def count(
    words: _Offsets,
    offsets: _Offsets,
    counts: _Ids,
    packed: _Bytes,
    n_images: int,
    lengths: _Offsets,
) -> int:
    """Add to `lengths` the images of each of `words`; DAMAGED if the bytes cannot be theirs.

    Every list's first byte is looked at: so many at a time are fetched from memory.
    """
    for i in range(len(words)):
        word = words[i]
        if word < 0 or word >= len(counts):
            return DAMAGED
        start, stop, n = offsets[word], offsets[word + 1], np.int64(counts[word])
        if start < 0 or start > stop or stop > len(packed):
            return DAMAGED
        if n > n_images or n > (stop - start) * BLOCK:
            return DAMAGED
        if n > 0 and packed[start] > _MAX_WIDTH:
            return DAMAGED
        lengths[i] += n
    return 0


@kernel
def read(
    words: _Offsets,
    offsets: _Offsets,
    counts: _Ids,
    packed: _Bytes,
    first_image: int,
    n_images: int,
    filled: _Offsets,
    image_ids: _Ids,
) -> int:
    """Unpack words that `count` found sound to `filled` on, which moves to their ends.

    DAMAGED if blocks do not end with their list, or an image is beyond `n_images`.
    """
    beyond = np.uint64(first_image + n_images)
    ending = np.zeros(BLOCK * _MAX_WIDTH // 8 + _LOADED, dtype=np.uint8)
    for i in range(len(words)):
        if i + _AHEAD < len(words):
            _fetch(packed, offsets[words[i + _AHEAD]])
        # Checked again as they are used: a mapped file can change after `count` looked at it.
        at, stop = offsets[words[i]], min(int(offsets[words[i] + 1]), len(packed))
        left = np.int64(counts[words[i]])
        image = np.uint64(first_image - 1)
        while left > 0:
            n = min(int(left), BLOCK)
            if at < 0 or at >= stop or filled[i] + n > len(image_ids):
                return DAMAGED
            width = np.int64(packed[at])
            at += 1
            size = _size(n, width)
            if width > _MAX_WIDTH or at + size > stop:
                return DAMAGED
            if at + size + _LOADED <= len(packed):
                image = _read_block(packed, at, width, image, image_ids, filled[i], n)
            else:  # the last lists of all: reading 8 bytes at once would leave the array
                for byte in range(size):
                    ending[byte] = packed[at + byte]
                image = _read_block(ending, 0, width, image, image_ids, filled[i], n)
            if image >= beyond:
                return DAMAGED
            at += size
            filled[i] += n
            left -= n
        if at != stop:
            return DAMAGED
    return 0


@kernel
def keep(indptr: _Offsets, image_ids: _Ids, kept: NDArray[np.bool_]) -> None:
    """Move the images that are kept together, in place; all ids are below `len(kept)`."""
    out, start = 0, indptr[0]
    for word in range(len(indptr) - 1):
        stop = indptr[word + 1]
        for i in range(start, stop):
            image_ids[out] = image_ids[i]
            out += int(kept[image_ids[i]])
        start = stop
        indptr[word + 1] = out


@kernel
def _read_block(
    packed: _Bytes,
    at: _Int,
    width: _Int,
    image: np.uint64,
    image_ids: _Ids,
    out: _Int,
    n: _Int,
) -> np.uint64:
    """Add up n gaps after `image`; images ascend, so that the last alone need be checked."""
    mask = (np.uint64(1) << np.uint64(width)) - np.uint64(1)
    bit: _Int = 0
    for i in range(n):
        image += ((load_uint64(packed, at + (bit >> 3)) >> np.uint64(bit & 7)) & mask) + np.uint64(
            1
        )
        image_ids[out + i] = image
        bit += width
    return image


@kernel
def _fetch(packed: _Bytes, start: _Int) -> None:
    for line in range(_LINES_AHEAD):
        prefetch(packed, start + line * _LINE)


@kernel
def _size(n: _Int, width: _Int) -> _Int:
    """Bytes of n gaps."""
    return (n * width + 7) >> 3


@kernel
def _width(image_ids: _Ids, start: _Int, first: _Int, last: _Int) -> int:
    """Bits that the largest gap of a block of the list from `start` on needs."""
    bits = np.int64(0)
    for i in range(first, last):
        bits |= _gap(image_ids, start, i)
    width = 0
    while bits >> width:
        width += 1
    return width


@kernel
def _gap(image_ids: _Ids, start: _Int, i: _Int) -> np.int64:
    """Images left out between an image of the list from `start` on and the one before it."""
    if i == start:
        return np.int64(image_ids[i])
    return np.int64(image_ids[i]) - np.int64(image_ids[i - 1]) - 1
