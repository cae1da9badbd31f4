"""The sample of descriptors depends on neither shards nor order, and is of bounded size."""

import hashlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from contracts.errors import WrongInput
from retrieval.sampling import SampleReservoir, key_limit, sample_keys

SHA = hashlib.sha256(b"image").hexdigest()


def test_sample_keys_follow_splitmix64() -> None:
    def mixed(state: int) -> int:
        state = (state ^ (state >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
        state = (state ^ (state >> 27)) * 0x94D049BB133111EB % 2**64
        return state ^ (state >> 31)

    golden = 0x9E3779B97F4A7C15
    assert mixed(golden) == 0xE220A8397B1DCDAF  # the generator's published first value, seed 0
    start = mixed(int(SHA[:16], 16) ^ mixed((7 + golden) % 2**64))
    expected = [mixed((start + i * golden) % 2**64) for i in (1, 2, 3)]
    assert sample_keys(SHA, 3, 7).tolist() == expected


def test_sample_keys_differ_by_frame_image_and_seed() -> None:
    other = hashlib.sha256(b"another").hexdigest()
    keys = np.concatenate(
        [sample_keys(SHA, 500, 0), sample_keys(SHA, 500, 1), sample_keys(other, 500, 0)]
    )
    assert len(np.unique(keys)) == 1500
    assert sample_keys(SHA, 0, 0).shape == (0,)


@pytest.mark.parametrize("sha", ["", "abc", "z" * 64])
def test_what_is_no_digest_has_no_keys(sha: str) -> None:
    with pytest.raises(WrongInput, match="hexadecimal"):
        sample_keys(sha, 3, 0)


@settings(max_examples=80, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 12), st.integers(0, 3), st.integers(0, 3)), max_size=40),
    st.integers(1, 10),
    st.lists(st.integers(0, 40), max_size=5),
    st.randoms(use_true_random=False),
)
def test_a_sample_is_the_smallest_keys_however_offered(points, size, cuts, shuffler) -> None:  # type: ignore[no-untyped-def]
    expected = [list(row[1:]) for row in sorted(points)[:size]]
    shuffler.shuffle(points)
    rows = np.array(points, dtype=np.int64).reshape(-1, 3)
    reservoir = SampleReservoir(size)
    for part in np.split(rows, sorted(cuts)):
        reservoir.offer(part[:, 0].astype(np.uint64), part[:, 1:].astype(np.uint8))
    assert reservoir.sample().tolist() == expected


def test_a_reservoir_holds_a_bounded_number_of_points() -> None:
    reservoir = SampleReservoir(100)
    for image in range(50):
        sha = hashlib.sha256(bytes([image])).hexdigest()
        reservoir.offer(sample_keys(sha, 60, 0), np.full((60, 36), image, dtype=np.uint8))
        assert sum(len(part) for part in reservoir._descriptors) <= 260
    assert reservoir.sample().shape == (100, 36)


def test_sampling_from_nothing_is_refused_but_from_no_frames_is_empty() -> None:
    reservoir = SampleReservoir(5)
    with pytest.raises(WrongInput, match="no descriptors"):
        reservoir.sample()
    reservoir.offer(np.zeros(0, np.uint64), np.zeros((0, 64), np.uint8))
    assert reservoir.sample().shape == (0, 64)
    with pytest.raises(WrongInput, match="2 sample keys"):
        reservoir.offer(np.zeros(2, np.uint64), np.zeros((3, 64), np.uint8))


def test_a_small_survey_puts_nothing_aside() -> None:
    assert key_limit(32_000, 32, 1000, 1_000_000) == 0
    assert key_limit(0, 0, 1000, 1_000_000) == 0


def test_shards_put_some_times_the_sample_aside_however_many_points_they_have() -> None:
    for points_an_image in (50, 1000):
        share = key_limit(points_an_image * 32, 32, 1_000_000, 1_000_000) / 2**64
        assert 2 < share * points_an_image * 1_000_000 / 1_000_000 < 8
