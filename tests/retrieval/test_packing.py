"""Packed postings come back as they were, and damaged ones never leave their arrays."""

import ctypes
import mmap
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from contracts.errors import BadIndex, VocabularyMismatch, WrongInput
from contracts.records import PackedPostings, Postings
from retrieval.packing import Part, pack, unpack

N_IMAGES = 2**32 - 1
LENGTHS = (0, 1, 2, 7, 8, 9, 127, 128, 129, 256, 700)


def postings_of(lists: list[list[int]]) -> Postings:
    indptr = np.cumsum([0, *map(len, lists)], dtype=np.int64)
    return Postings(indptr, np.array([i for images in lists for i in images], dtype=np.uint32))


def as_lists(postings: Postings) -> list[list[int]]:
    return [postings.image_ids[a:b].tolist() for a, b in pairwise(postings.indptr)]


def random_lists(seed: int, n_images: int) -> list[list[int]]:
    rng = np.random.default_rng(seed)
    sizes = rng.permutation([min(n, n_images) for n in LENGTHS])
    return [
        np.unique(rng.integers(0, n_images, n, dtype=np.uint64)).astype(int).tolist() for n in sizes
    ]


def packed_by_hand(images: list[int]) -> bytes:
    """The written format: blocks of 128 gaps, a width, then the gaps as one long number."""
    gaps = [after - before - 1 for before, after in pairwise([-1, *images])]
    packed = b""
    for first in range(0, len(gaps), 128):
        block = gaps[first : first + 128]
        width = max(gap.bit_length() for gap in block)
        number = sum(gap << (width * place) for place, gap in enumerate(block))
        packed += bytes([width]) + number.to_bytes((len(block) * width + 7) // 8, "little")
    return packed


@pytest.mark.parametrize("n_images", [1, 40, 1000, 100_000, N_IMAGES])
@pytest.mark.parametrize("seed", [0, 1])
def test_lists_of_every_length_and_width_come_back(seed: int, n_images: int) -> None:
    lists = random_lists(seed, n_images)
    packed = pack(postings_of(lists))
    assert as_lists(unpack([Part(packed, 0, n_images)], np.arange(len(lists)))) == lists
    assert packed.packed.tobytes() == b"".join(map(packed_by_hand, lists))
    assert packed.counts.tolist() == list(map(len, lists))


@pytest.mark.parametrize("width", range(33))
def test_every_width_of_a_block_is_read_back(width: int) -> None:
    images = [2**width - 1 + place for place in range(140)] if width < 32 else [2**32 - 1]
    packed = pack(postings_of([images]))
    assert packed.packed[0] == width
    assert as_lists(unpack([Part(packed, 0, 2**32)], np.arange(1))) == [images]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.lists(st.sets(st.integers(0, 400)), min_size=5, max_size=5), max_size=3),
    st.lists(st.integers(0, 4), max_size=8),
    st.integers(0, 2**32 - 1),
)
def test_words_are_joined_over_the_parts_in_the_order_asked(
    segments: list[list[set[int]]], asked: list[int], seed: int
) -> None:
    packed = [pack(postings_of([sorted(images) for images in words])) for words in segments]
    parts = [Part(each, 401 * number, 401) for number, each in enumerate(packed)]
    kept = np.random.default_rng(seed).random(401 * len(parts)) < 0.5
    everyone = [
        [
            401 * number + image
            for number, words in enumerate(segments)
            for image in sorted(words[word])
        ]
        for word in asked
    ]
    words = np.array(asked, dtype=np.int64)
    assert as_lists(unpack(parts, words)) == everyone
    assert as_lists(unpack(parts, words.astype(np.int32), kept)) == [
        [image for image in images if kept[image]] for images in everyone
    ]


def test_packed_ranges_of_words_may_be_put_together() -> None:
    lists = random_lists(3, 5000)
    whole = pack(postings_of(lists))
    halves = [pack(postings_of(lists[:4])), pack(postings_of(lists[4:]))]
    assert b"".join(half.packed.tobytes() for half in halves) == whole.packed.tobytes()


@pytest.mark.parametrize("images", [[3, 3], [4, 3]])
def test_images_that_do_not_ascend_are_not_packed(images: list[int]) -> None:
    with pytest.raises(WrongInput, match="ascend"):
        pack(postings_of([[1], images]))


@pytest.mark.parametrize("indptr", [[0, 3, 2], [0, 1, 3], [1, 1, 2], []])
def test_offsets_that_do_not_fit_are_not_packed(indptr: list[int]) -> None:
    with pytest.raises(WrongInput):
        pack(Postings(np.array(indptr, np.int64), np.array([1, 2], np.uint32)))


@pytest.mark.parametrize("word", [-1, 11, 2**40])
def test_a_word_outside_the_codebook_is_refused(word: int) -> None:
    packed = pack(postings_of(random_lists(0, 1000)))
    with pytest.raises(BadIndex, match="codebook's 11"):
        unpack([Part(packed, 0, 1000)], np.array([0, word]))


def test_an_image_beyond_its_part_is_refused() -> None:
    packed = pack(postings_of([[1, 999]]))
    with pytest.raises(BadIndex, match="images 5 to 1003"):
        unpack([Part(packed, 5, 999)], np.arange(1))


def test_parts_of_different_codebooks_are_refused() -> None:
    parts = [Part(pack(postings_of([[0]] * n)), 0, 1) for n in (2, 3)]
    with pytest.raises(VocabularyMismatch, match=r"\[2, 3\] words"):
        unpack(parts, np.arange(1))


def test_a_filter_of_another_length_is_refused() -> None:
    with pytest.raises(WrongInput, match="3 images"):
        unpack([Part(pack(postings_of([[0]])), 0, 4)], np.arange(1), np.ones(3, dtype=np.bool_))


def before_a_wall(content: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Copy bytes to where a single one more cannot be read: the interpreter would crash."""
    n_pages = -(-len(content) // mmap.PAGESIZE) or 1
    end = n_pages * mmap.PAGESIZE
    memory = np.frombuffer(mmap.mmap(-1, end + mmap.PAGESIZE), dtype=np.uint8)
    wall = ctypes.c_void_p(memory.ctypes.data + end)
    assert ctypes.CDLL(None).mprotect(wall, ctypes.c_size_t(mmap.PAGESIZE), 0) == 0
    place = memory[end - len(content) : end]
    place[:] = content
    return place


def outcome(packed: PackedPostings, n_images: int) -> list[list[int]] | None:
    """What reading all words gives; None if it is refused."""
    walled = replace(packed, packed=before_a_wall(packed.packed))
    try:
        return as_lists(unpack([Part(walled, 0, n_images)], np.arange(packed.n_words)))
    except BadIndex:
        return None


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_any_damage_gives_sound_lists_or_an_error(data: st.DataObject) -> None:
    whole = pack(postings_of(random_lists(data.draw(st.integers(0, 3)), 900)))
    arrays = {name: getattr(whole, name).copy() for name in ("offsets", "counts", "packed")}
    for _ in range(data.draw(st.integers(1, 4))):
        name = data.draw(st.sampled_from(sorted(arrays)))
        raw = arrays[name].view(np.uint8)
        raw[data.draw(st.integers(0, len(raw) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(arrays["packed"])))
    arrays["packed"] = arrays["packed"][: data.draw(st.sampled_from([None, cut]))]
    lists = outcome(PackedPostings(**arrays), 900)
    for images in lists or []:
        assert images == sorted(set(images))
        assert all(0 <= image < 900 for image in images)


def test_every_single_byte_changed_is_survived() -> None:
    whole = pack(postings_of([[3], list(range(5, 400, 3)), [], [7, 20]]))
    good = outcome(whole, 500)
    for place in range(len(whole.packed)):
        for value in (0, 1, 31, 33, 128, 255):
            changed = whole.packed.copy()
            changed[place] = value
            lists = outcome(replace(whole, packed=changed), 500)
            assert lists is None or list(map(len, lists)) == list(map(len, good or []))


@pytest.mark.parametrize(
    ("offsets", "count"),
    [([0, 2**62], 1), ([-8, 2], 1), ([2, 0], 1), ([0, 2], 2**32 - 1), ([0, 2], 0), ([0, 1], 1)],
)
def test_offsets_and_counts_beyond_the_bytes_are_refused(offsets: list[int], count: int) -> None:
    packed = PackedPostings(
        np.array(offsets, np.int64), np.array([count], np.uint32), np.array([3, 5], np.uint8)
    )
    with pytest.raises(BadIndex, match="damaged"):
        unpack([Part(packed, 0, 100)], np.arange(1))


def test_offsets_of_another_number_of_words_are_refused() -> None:
    packed = replace(pack(postings_of([[1], [2]])), counts=np.ones(5, np.uint32))
    with pytest.raises(BadIndex, match="damaged"):
        unpack([Part(packed, 0, 100)], np.arange(1))
