"""Files are whole or absent."""

from pathlib import Path
from typing import IO

import numpy as np
import pytest

from contracts.errors import BadIndex
from index.files import map_array, sha256_of, write_array, write_atomic, write_bytes


def test_a_failed_write_leaves_the_former_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "words.npy"
    write_bytes(path, b"former")

    def disk_full(stream: IO[bytes]) -> None:
        stream.write(b"half of")
        raise OSError(28, "No space left on device")

    with pytest.raises(OSError, match="No space left"):
        write_atomic(path, disk_full)
    assert path.read_bytes() == b"former"
    assert [each.name for each in tmp_path.iterdir()] == ["words.npy"]


def test_the_digest_returned_is_that_of_the_file(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "array.npy"
    assert write_array(path, np.arange(7)) == sha256_of(path)


def test_truncated_and_mistyped_arrays_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "array.npy"
    write_array(path, np.arange(1000, dtype=np.int64))
    with pytest.raises(BadIndex, match="expected 1-d uint32"):
        map_array(path, np.uint32, 1)
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(BadIndex, match="cannot be read as an array"):
        map_array(path, np.int64, 1)


def test_a_pickled_array_is_never_loaded(tmp_path: Path) -> None:
    path = tmp_path / "array.npy"
    np.save(path, np.array([{"not": "an array"}], dtype=object), allow_pickle=True)
    with pytest.raises(BadIndex, match="cannot be read as an array"):
        map_array(path, np.int64, 1)
