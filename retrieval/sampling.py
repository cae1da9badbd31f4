"""The sample of descriptors that words are made from: those with the smallest hashes.

A hash knows of its image and frame alone, so the sample depends on neither shards nor order. What
of a shard can be in the sample of the whole survey is guessed from the shard itself, and asked for
again where the guess was too low: so most of a large survey need not be read again to train.
"""

import numpy as np
from numpy.typing import NDArray

from contracts.errors import WrongInput

_SPARE_SHARE = 1.25
"""How far a reservoir may fill beyond its size before it is cut back to it."""

_SPARE_POINTS = 4.0
"""How many times as many descriptors as the sample needs all shards put aside together: enough
while the images of a shard have no more than four times as many as the survey's mean."""

_WORTH_PUTTING_ASIDE = 0.25
"""A larger share of a shard is as soon read with all of it."""

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)


class SampleReservoir:
    """Keeps the `max_points` descriptors of the smallest keys, in bounded memory.

    What it keeps does not depend on the order, or the portions, of what it is offered.
    """

    def __init__(self, max_points: int) -> None:
        self._max_points = max_points
        self._keys: list[NDArray[np.uint64]] = []
        self._descriptors: list[NDArray[np.uint8]] = []
        self._n_held = 0
        self._largest_of_use = np.uint64(2**64 - 1)

    def offer(self, keys: NDArray[np.uint64], descriptors: NDArray[np.uint8]) -> None:
        """Take in (n,) uint64 keys and their (n, D) uint8 descriptors.

        Raises
        ------
        WrongInput : not one key per descriptor.
        """
        if len(keys) != len(descriptors):
            raise WrongInput(f"{len(keys)} sample keys were offered for {len(descriptors)} points")
        wanted = keys <= self._largest_of_use
        self._keys.append(keys[wanted])
        self._descriptors.append(descriptors[wanted])
        self._n_held += int(wanted.sum())
        if self._n_held > _SPARE_SHARE * self._max_points:
            self._shrink()

    def sample(self) -> NDArray[np.uint8]:
        """Give the sample by ascending key, then descriptor bytes; (n, D) uint8.

        Raises
        ------
        WrongInput : nothing was ever offered, not even an empty array of the right width.
        """
        if not self._descriptors:
            raise WrongInput("no descriptors were offered to sample from; extract features first")
        self._shrink()
        return self._descriptors[0]

    def may_use(self, smallest: int) -> bool:
        """Whether a descriptor of this key, or of a larger one, may come into the sample."""
        return smallest <= int(self._largest_of_use)

    def _shrink(self) -> None:
        keys, descriptors = np.concatenate(self._keys), np.concatenate(self._descriptors)
        self._descriptors = []
        order = np.argsort(keys, kind="stable")
        keys = keys[order]
        repeats = np.flatnonzero(np.diff(keys) == 0)
        tied = np.union1d(repeats, repeats + 1)
        among = descriptors[order[tied]]
        order[tied] = order[tied[np.lexsort((*among.T[::-1], keys[tied]))]]
        self._keys = [keys[: self._max_points].copy()]
        self._descriptors = [descriptors[order[: self._max_points]]]
        self._n_held = len(self._keys[0])
        if self._n_held == self._max_points:
            self._largest_of_use = self._keys[0][-1]


def key_limit(n_points: int, n_images: int, n_images_in_all: int, max_points: int) -> int:
    """Below which key a shard's descriptors are put aside for the sample; 0: none are.

    Parameters
    ----------
    n_points : descriptors of the shard's `n_images` images.
    n_images_in_all : of the survey, or more. max_points : of the sample.
    """
    return int(share_put_aside(n_points * n_images_in_all / max(n_images, 1), max_points) * 2.0**64)


def share_put_aside(n_points: float, max_points: int) -> float:
    """What share of a survey's `n_points` descriptors is put aside for a sample of `max_points`."""
    share = _SPARE_POINTS * max_points / max(n_points, 1.0)
    return share if share <= _WORTH_PUTTING_ASIDE else 0.0


def sample_keys(image_sha256: str, n_frames: int, seed: int) -> NDArray[np.uint64]:
    """Hash each frame of an image for sampling; (n_frames,) uint64.

    splitmix64 (Steele, Lea & Flood 2014) started at the first 8 bytes of the image's sha256,
    mixed with the seed. It knows nothing of shards, so neither does the sample.

    Raises
    ------
    WrongInput : not a hexadecimal digest of 8 bytes or more.
    """
    try:
        head = int(image_sha256[:16], 16)
    except ValueError:
        head = -1
    if head < 0 or len(image_sha256) < 16:
        raise WrongInput(f"an image's sha256 must be hexadecimal; got {image_sha256!r}")
    start = np.array([head], dtype=np.uint64) ^ _mixed(np.array([seed], dtype=np.uint64) + _GOLDEN)
    return _mixed(_mixed(start) + np.arange(1, n_frames + 1, dtype=np.uint64) * _GOLDEN)


def _mixed(state: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Finish splitmix64; whole numbers wrap at 2**64."""
    state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return state ^ (state >> np.uint64(31))
