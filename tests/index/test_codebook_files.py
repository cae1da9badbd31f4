"""A codebook comes back from disk as it was, or not at all."""

import json
import mmap
from pathlib import Path

import numpy as np
import pytest

from contracts.config import MAX_NEIGHBOURS
from contracts.errors import BadIndex
from index.codebooks import codebook_paths, codebooks_digest, read_searcher, write_codebook
from retrieval.codebooks import Codebook, train_codebook


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


def npy(header: str, data: bytes = b"") -> bytes:
    return b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + data


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\x93NUMPY",
        npy("{'descr': '|u1', 'fortran_order': False, 'shape': (12, 8), }\n", bytes(95)),
        npy("{'descr': '|u1', 'fortran_order': False, 'shape': (10**15, 8), }\n", bytes(96)),
        npy("{'descr': '|u1', 'fortran_order': False, 'shape': (1000000000000, 8), }\n", bytes(96)),
        npy("{'descr': '<u2', 'fortran_order': False, 'shape': (6, 8), }\n", bytes(96)),
        npy("{'descr': '|u1', 'fortran_order': False, 'shape': (96,), }\n", bytes(96)),
        npy("{'descr': '|O', 'fortran_order': False, 'shape': (12, 8), }\n", bytes(768)),
        npy("{'descr': '|u1', 'fortran_order': False, 'shape': (11, 8), }\n", bytes(88)),
        npy("{'descr': '|u1', 'fortran_order': False, 'shape': (12, 7), }\n", bytes(84)),
        npy(" " * 60_000),
    ],
)
def test_words_that_are_not_those_of_the_structure_are_refused(
    tmp_path: Path, content: bytes
) -> None:
    paths, digest = written(tmp_path)
    paths["words"].write_bytes(content)
    with pytest.raises(BadIndex, match=r"hesaff-sift\.npy"):
        read_searcher(paths, digest)


@pytest.mark.parametrize("damage", ["missing", "shorter", "edited", "longer"])
def test_a_structure_that_is_not_the_one_written_is_refused(tmp_path: Path, damage: str) -> None:
    paths, digest = written(tmp_path)
    content = paths["search"].read_bytes()
    paths["search"].unlink()
    if damage == "shorter":
        paths["search"].write_bytes(content[:-1])
    if damage == "edited":
        paths["search"].write_bytes(content[:200] + b"\xff" + content[201:])
    if damage == "longer":
        paths["search"].write_bytes(content + b"\0")
    with pytest.raises(BadIndex, match=r"hesaff-sift\.npz is missing or not the file"):
        read_searcher(paths, digest)


def test_a_large_codebook_read_finds_the_words_it_found_before(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    words = np.unique(rng.integers(0, 256, (4_200, 4), dtype=np.uint8), axis=0)
    codebook = Codebook(words, 0.0, *[np.ones(MAX_NEIGHBOURS, np.float32)] * 2)
    paths = codebook_paths(tmp_path, "0001", "hesaff-sift")
    digest = write_codebook(paths, codebook)[paths["search"]]
    ids, sq_dist = read_searcher(paths, digest).nearest(words, 1)
    assert ids[:, 0].tolist() == list(range(len(words)))
    assert not sq_dist.any()


def test_words_read_are_mapped_and_not_held(tmp_path: Path) -> None:
    paths, digest = written(tmp_path)
    words = read_searcher(paths, digest).codebook.words
    assert not words.flags.writeable
    owner: object = words
    while isinstance(owner, np.ndarray | memoryview) and not isinstance(owner, np.memmap):
        owner = owner.base if isinstance(owner, np.ndarray) else owner.obj
    assert isinstance(owner, np.memmap | mmap.mmap)


def test_sets_of_words_are_told_apart_by_every_channel_and_not_by_its_order() -> None:
    files = {"hesaff-sift": "ab", "star-sc": "cd"}
    digest = codebooks_digest(files)
    assert len(digest) == 16
    assert int(digest, 16) >= 0
    assert codebooks_digest(dict(reversed(files.items()))) == digest
    others = (
        {**files, "star-sc": "ce"},
        {"hesaff-sift": "ab"},
        {"hesaff-sift": "ab", "mser-sc": "cd"},
    )
    assert len({digest, *map(codebooks_digest, others)}) == 4
