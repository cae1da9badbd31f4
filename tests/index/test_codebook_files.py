"""A codebook comes back from disk as it was, or not at all."""

import json
from pathlib import Path

import numpy as np
import pytest

from contracts.config import MAX_NEIGHBOURS
from contracts.errors import BadIndex
from index.codebooks import codebook_paths, read_searcher, write_codebook
from retrieval.codebooks import train_codebook


def written(root: Path) -> tuple[dict[str, Path], str]:
    sample = np.random.default_rng(0).integers(0, 256, (60, 8), dtype=np.uint8)
    paths = codebook_paths(root, "0001", "hesaff-sift")
    digests = write_codebook(paths, train_codebook(sample, 12, 0))
    return paths, digests[paths["search"]]


def test_a_codebook_read_is_the_one_written(tmp_path: Path) -> None:
    paths, digest = written(tmp_path)
    codebook = read_searcher(paths, digest).codebook
    again = write_codebook(codebook_paths(tmp_path, "0002", "hesaff-sift"), codebook)
    assert [path.read_bytes() for path in again] == [path.read_bytes() for path in paths.values()]


@pytest.mark.parametrize("key", ["dmin", "dmax", "d99"])
@pytest.mark.parametrize("value", [None, "far", [1.0] * (MAX_NEIGHBOURS - 1)])
def test_distances_that_are_missing_or_damaged_are_refused(
    tmp_path: Path, key: str, value: object
) -> None:
    paths, digest = written(tmp_path)
    distances = json.loads(paths["distances"].read_bytes())
    del distances[key]
    paths["distances"].write_text(
        json.dumps(distances if value is None else {**distances, key: value})
    )
    with pytest.raises(BadIndex, match=r"hesaff-sift\.json is damaged or of an older"):
        read_searcher(paths, digest)
