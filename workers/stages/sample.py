"""Sample: what training may need of a shard lies beside its features, so that it reads no more."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contracts.config import IndexConfig
from index.files import read_member
from index.jobs import IndexedImage, JobPlan
from retrieval.sampling import key_limit, sample_keys

Arrays = dict[str, NDArray[np.generic]]


@dataclass(frozen=True, slots=True)
class ShardSample:
    """What a shard put aside of a channel: all its descriptors whose keys are below `limit`.

    keys : (n,) uint64. descriptors : (n, D) uint8. n_points : descriptors of the shard in all.
    """

    limit: int
    n_points: int
    keys: NDArray[np.uint64]
    descriptors: NDArray[np.uint8]


def put_aside(
    images: Sequence[IndexedImage], features: Mapping[str, NDArray[np.generic]], plan: JobPlan
) -> Arrays:
    """The arrays to be stored beside a shard's features.

    `<detector>/keys` and `<channel>/sample` are what is put aside, `<detector>/sampled` the limit
    of the keys and the number of descriptors in all. A job that trains no words needs none.

    Parameters
    ----------
    images : whose features these are. features : `<detector>/counts` and `<channel>`.
    """
    arrays: Arrays = {}
    config = plan.config
    if not plan.trains:
        return arrays
    for detector in config.features.detectors:
        counts = features[f"{detector}/counts"]
        n_points = int(counts.sum())
        limit = key_limit(n_points, len(images), plan.n_images, config.codebooks.max_train_points)
        keys = keys_of(images, counts, config)
        below = keys < np.uint64(limit)
        arrays[f"{detector}/keys"] = keys[below]
        arrays[f"{detector}/sampled"] = np.array([limit, n_points], dtype=np.uint64)
        for descriptor in config.features.descriptors:
            channel = f"{detector}-{descriptor}"
            arrays[f"{channel}/sample"] = features[channel][below]
    return arrays


def keys_of(
    images: Sequence[IndexedImage], counts: NDArray[np.generic], config: IndexConfig
) -> NDArray[np.uint64]:
    """The keys of all descriptors of a shard by one detector, as they lie in its features."""
    none = np.zeros(0, dtype=np.uint64)
    seed = config.codebooks.seed
    each = [
        sample_keys(image.sha256, count, seed)
        for image, count in zip(images, counts.tolist(), strict=True)
    ]
    return np.concatenate([none, *each])


def read_sample(path: Path, channel: str) -> ShardSample:
    """What a shard's feature file has put aside of a channel.

    Raises
    ------
    BadIndex : the file is missing or damaged.
    """
    detector = channel.split("-")[0]
    limit, n_points = read_member(path, f"{detector}/sampled", np.uint64, 1).tolist()
    return ShardSample(
        limit=limit,
        n_points=n_points,
        keys=read_member(path, f"{detector}/keys", np.uint64, 1),
        descriptors=read_member(path, f"{channel}/sample", np.uint8, 2),
    )
