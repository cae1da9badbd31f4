"""Files are whole or absent, and what is read is what was promised."""

import errno
import os
import resource
import tracemalloc
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import IO

import numpy as np
import pytest

from contracts.errors import BadIndex
from index.files import (
    check_files,
    is_inside,
    map_array,
    read_member,
    read_text_file,
    sha256_of,
    write_array,
    write_arrays,
    write_atomic,
    write_bytes,
)

ARRAYS = [
    np.arange(1000, dtype=np.int64),
    np.arange(12, dtype=np.uint8).reshape(3, 4),
    np.zeros((0, 128), dtype=np.uint8),
    np.zeros(0, dtype=np.uint32),
    np.array([0.5, np.inf], dtype=np.float32),
]


def npy(array: np.ndarray) -> bytes:
    """As numpy itself would write it."""
    stream = BytesIO()
    np.save(stream, array, allow_pickle=True)
    return stream.getvalue()


def with_header(text: str, content: bytes = b"") -> bytes:
    """A .npy file of any header, padded as numpy pads it."""
    padded = text.ljust((len(text) // 64 + 1) * 64 + 64 - 11) + "\n"
    return b"\x93NUMPY\x01\x00" + len(padded).to_bytes(2, "little") + padded.encode() + content


def header_of(shape: str, fortran: str = "False", content: bytes = bytes(80)) -> bytes:
    text = f"{{'descr': '<i8', 'fortran_order': {fortran}, 'shape': {shape}, }}"
    return with_header(text, content)


def test_a_failed_write_leaves_the_former_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "words.npy"
    write_bytes(path, b"former")

    def disk_full(stream: IO[bytes]) -> None:
        stream.write(b"half of")
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OSError, match="No space left") as error:
        write_atomic(path, disk_full)
    assert error.value.filename == str(path)
    assert path.read_bytes() == b"former"
    assert [each.name for each in tmp_path.iterdir()] == ["words.npy"]


def test_an_error_of_another_file_keeps_its_name(tmp_path: Path) -> None:
    missing = tmp_path / "elsewhere" / "missing"
    with pytest.raises(FileNotFoundError) as error:
        write_atomic(tmp_path / "copy", lambda _: missing.read_bytes())
    assert error.value.filename == str(missing)


@pytest.mark.parametrize("write", [write_bytes, write_array])
def test_a_disk_that_takes_no_more_is_told_with_the_name_of_the_file(
    tmp_path: Path, write: Callable[[Path, object], str]
) -> None:
    """A limit of the system's own, so that the write itself fails half way."""
    path = tmp_path / "large.npy"
    content = b"x" * 300_000 if write is write_bytes else np.zeros(300_000, dtype=np.uint8)
    former = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, former[1]))
    try:
        with pytest.raises(OSError, match="File too large") as error:
            write(path, content)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, former)
    assert error.value.filename == str(path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("array", ARRAYS)
def test_arrays_are_written_as_numpy_writes_them_and_come_back(
    tmp_path: Path, array: np.ndarray
) -> None:
    path, several = tmp_path / "deep" / "er" / "array.npy", tmp_path / "arrays.npz"
    assert write_array(path, array) == sha256_of(path)
    assert path.read_bytes() == npy(array)
    write_arrays(several, {"other": np.arange(3), "a/b": array})
    with np.load(several) as stored:
        np.testing.assert_array_equal(stored["a/b"], array)
    for found in (
        map_array(path, array.dtype.type, array.ndim),
        read_member(several, "a/b", array.dtype.type, array.ndim),
    ):
        np.testing.assert_array_equal(found, array, strict=True)
        assert not found.flags.writeable


def test_an_array_in_any_layout_is_written_in_c_order(tmp_path: Path) -> None:
    turned = np.arange(12, dtype=np.uint8).reshape(3, 4).T
    write_array(tmp_path / "array.npy", turned[::2])
    np.testing.assert_array_equal(map_array(tmp_path / "array.npy", np.uint8, 2), turned[::2])


def test_an_array_that_would_be_pickled_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(TypeError, match="pickled"):
        write_array(tmp_path / "array.npy", np.array([{}], dtype=object))
    assert not list(tmp_path.iterdir())


WHOLE = npy(np.arange(10))
DAMAGED = {
    "nothing": b"",
    "only a beginning": WHOLE[:4],
    "no end of the header": WHOLE[:60],
    "no content": WHOLE[:128],
    "one byte less": WHOLE[:-1],
    "one byte more": WHOLE + b"\0",
    "another magic": b"\x94" + WHOLE[1:],
    "another version": WHOLE[:6] + b"\x02" + WHOLE[7:],
    "a pickle": npy(np.array([{"not": "an array"}], dtype=object)),
    "an archive": b"PK\x03\x04" + bytes(200),
    "another dtype": npy(np.arange(10, dtype=np.uint64)),
    "the other byte order": npy(np.arange(10, dtype=">i8")),
    "columns": npy(np.zeros(10, dtype=[("a", "<i8")])),
    "two dimensions": npy(np.zeros((2, 5), dtype=np.int64)),
    "no dimension": npy(np.int64(7)),
    "Fortran order": header_of("(10,)", fortran="True"),
    "a huge shape": header_of(f"({2**60},)"),
    "a shape of 0 bytes modulo 2**64": header_of(f"({2**61},)"),
    "a negative shape": header_of("(-10,)"),
    "a shape that is no tuple": header_of("10"),
    "a shape of digits without end": header_of("(" + "9" * 4000 + ",)"),
    "a call": header_of("__import__('os').getcwd()"),
    "brackets without end": with_header("[" * 9000),
    "signs without end": with_header("-" * 60_000),
    "a torn string": with_header("{'descr': '<i8"),
    "an unaligned header": WHOLE[:8] + b"\x77\x00" + WHOLE[10:127] + b" \n" + WHOLE[128:],
}


@pytest.mark.parametrize("content", DAMAGED.values(), ids=DAMAGED.keys())
def test_a_damaged_array_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    path, several = tmp_path / "array.npy", tmp_path / "arrays.npz"
    path.write_bytes(content)
    with zipfile.ZipFile(several, "w") as archive:
        archive.writestr("array.npy", content)
    with pytest.raises(BadIndex, match=r"array.npy cannot be read as an array .*\. Restore"):
        map_array(path, np.int64, 1)
    with pytest.raises(BadIndex, match=r"arrays.npz does not hold array as it .*\. Restore"):
        read_member(several, "array", np.int64, 1)


def test_a_shape_that_is_huge_and_empty_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "array.npy"
    path.write_bytes(header_of(f"({2**62}, 0)", content=b""))
    with pytest.raises(BadIndex, match=r"array\.npy cannot be read"):
        map_array(path, np.int64, 2)


def test_a_mistyped_array_is_told_as_it_is(tmp_path: Path) -> None:
    write_array(tmp_path / "array.npy", np.zeros((2, 3), dtype=np.int64))
    with pytest.raises(BadIndex, match="2-d '<i8', expected 1-d uint32"):
        map_array(tmp_path / "array.npy", np.uint32, 1)


def make_folder(path: Path) -> None:
    path.mkdir()


def make_link_to_nothing(path: Path) -> None:
    path.symlink_to("nowhere")


def make_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


@pytest.mark.parametrize("make", [make_folder, os.mkfifo, make_link_to_nothing, make_device])
def test_what_is_no_file_is_refused_and_nobody_waits(
    tmp_path: Path, make: Callable[[Path], None]
) -> None:
    path = tmp_path / "array.npy"
    make(path)
    with pytest.raises(BadIndex, match=r"array\.npy cannot be read"):
        map_array(path, np.int64, 1)
    with pytest.raises(BadIndex, match=r"array\.npy does not hold"):
        read_member(path, "array", np.int64, 1)
    with pytest.raises(OSError, match=r"array\.npy"):
        read_text_file(path)
    with pytest.raises(BadIndex, match=r"array\.npy is (a link|not a file|missing)"):
        check_files(tmp_path, {"array.npy": 0})


def test_a_text_of_a_gigabyte_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "large.json"
    with path.open("wb") as stream:
        stream.truncate(2**30)
    with pytest.raises(OSError, match=r"Larger than .*large\.json"):
        read_text_file(path)
    write_bytes(path, b"12345")
    assert read_text_file(path, 5) == b"12345"


def test_no_more_memory_is_set_aside_than_a_text_is_long(tmp_path: Path) -> None:
    write_bytes(tmp_path / "small.json", b"{}")
    tracemalloc.start()
    try:
        read_text_file(tmp_path / "small.json", 2**28)
        assert tracemalloc.get_traced_memory()[1] < 2**20
    finally:
        tracemalloc.stop()


def archive_of(members: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> bytes:
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w", compression) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


def encrypted(content: bytes) -> bytes:
    """Say of the only member that it is encrypted, in both of its headers."""
    data = bytearray(content)
    data[6] |= 1
    data[data.index(b"PK\x01\x02") + 8] |= 1
    return bytes(data)


STORED = archive_of({"array.npy": WHOLE})
BAD_ARCHIVES = {
    "no archive": WHOLE,
    "an empty one": archive_of({}),
    "another name": archive_of({"../array.npy": WHOLE}),
    "a bomb": archive_of({"array.npy": npy(np.zeros(10**7))}, zipfile.ZIP_DEFLATED),
    "cut": STORED[:-30],
    "cut within": STORED[:100] + STORED[150:],
    "flipped": STORED[:200] + b"\xff" + STORED[201:],
    "encrypted": encrypted(STORED),
    "of a later version": STORED.replace(b"PK\x01\x02\x14\x03\x14", b"PK\x01\x02\x14\x03\xff"),
}


@pytest.mark.parametrize("content", BAD_ARCHIVES.values(), ids=BAD_ARCHIVES.keys())
def test_a_damaged_archive_is_refused_by_name(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "piece.npz"
    path.write_bytes(content)
    with pytest.raises(BadIndex, match=r"piece\.npz does not hold array"):
        read_member(path, "array", np.int64, 1)


@pytest.mark.parametrize(
    "name", ["/etc/passwd", "../x", "a/../../x", "", ".", "a\0b", "//server/x"]
)
def test_a_name_that_leaves_is_told(name: str) -> None:
    assert not is_inside(name)
    assert is_inside("segments/0001/hesaff-sift/packed.npy")


def test_links_do_not_lead_out_of_an_index(tmp_path: Path) -> None:
    root, outside = tmp_path / "index", tmp_path / "outside"
    write_bytes(outside / "words.npy", b"12345")
    write_bytes(root / "codebooks" / "words.npy", b"12345")
    (root / "linked").symlink_to(outside)
    (root / "words.npy").symlink_to(root / "codebooks" / "words.npy")
    check_files(root, {"codebooks/words.npy": 5})
    with pytest.raises(BadIndex, match="leads out of the index"):
        check_files(root, {"linked/words.npy": 5})
    with pytest.raises(BadIndex, match=r"words\.npy is a link"):
        check_files(root, {"words.npy": 5})
    with pytest.raises(BadIndex, match="5 bytes long, expected a file of 6"):
        check_files(root, {"codebooks/words.npy": 6})


def test_an_index_may_itself_be_reached_by_a_link(tmp_path: Path) -> None:
    write_bytes(tmp_path / "index" / "codebooks" / "words.npy", b"12345")
    (tmp_path / "linked").symlink_to("index")
    check_files(tmp_path / "linked", {"codebooks/words.npy": 5})
