"""How real images, and the keypoints of real photos, use the visual words of a channel."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contracts.records import Postings
from index.files import write_arrays


@dataclass(frozen=True, slots=True)
class WordUse:
    """One channel of a real index, its words by descending document frequency.

    postings : of the images, in the order of their uris: neighbours in a street are neighbours.
    words : (n, k) int32, nearest words of the keypoints of all photos. sq_dist : (n, k) float32.
    starts : (n_photos + 1,) int64, where each photo's keypoints begin.
    dmin, dmax : the codebook's smallest and largest distance for this k, squared.
    """

    n_images: int
    postings: Postings
    words: NDArray[np.int32]
    sq_dist: NDArray[np.float32]
    starts: NDArray[np.int64]
    dmin: float
    dmax: float

    @property
    def frequency(self) -> NDArray[np.int64]:
        """Images that have each word; (V,)."""
        return np.diff(self.postings.indptr)

    @property
    def words_per_image(self) -> float:
        return len(self.postings.image_ids) / self.n_images

    @property
    def n_photos(self) -> int:
        return len(self.starts) - 1

    def relative_frequency(self) -> NDArray[np.float64]:
        """Document frequency as a multiple of its mean; (V,)."""
        relative: NDArray[np.float64] = self.frequency / self.frequency.mean()
        return relative

    def photo(self, number: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Words and squared distances of one photo's keypoints; (n, k) each."""
        keypoints = slice(self.starts[number], self.starts[number + 1])
        return self.words[keypoints], self.sq_dist[keypoints]


def save(path: Path, channels: Mapping[str, WordUse]) -> None:
    """Keep what was measured, for a later run."""
    arrays: dict[str, NDArray[np.generic]] = {}
    for name, use in channels.items():
        arrays[f"{name}/indptr"] = use.postings.indptr
        arrays[f"{name}/image_ids"] = use.postings.image_ids
        arrays[f"{name}/words"] = use.words
        arrays[f"{name}/sq_dist"] = use.sq_dist
        arrays[f"{name}/starts"] = use.starts
        arrays[f"{name}/scalars"] = np.array([use.n_images, use.dmin, use.dmax])
    write_arrays(path, arrays)


def load(path: Path) -> Mapping[str, WordUse]:
    """Read what `save` kept."""
    channels = {}
    with np.load(path, allow_pickle=False) as kept:
        for name in dict.fromkeys(key.split("/")[0] for key in kept.files):
            n_images, dmin, dmax = kept[f"{name}/scalars"].tolist()
            channels[name] = WordUse(
                int(n_images),
                Postings(kept[f"{name}/indptr"], kept[f"{name}/image_ids"]),
                kept[f"{name}/words"],
                kept[f"{name}/sq_dist"],
                kept[f"{name}/starts"],
                dmin,
                dmax,
            )
    return channels
