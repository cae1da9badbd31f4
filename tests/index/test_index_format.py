"""docs/index-format.md is enough to read an index: here it is read by it, without our own code."""

import hashlib
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from made_index import made_index

from index.opened import OpenedIndex


def array(path: Path) -> tuple[bytes, tuple[int, ...], bytes]:
    """Version 1.0 of .npy: magic, length of the header, header, data."""
    content = path.read_bytes()
    assert content[:8] == b"\x93NUMPY\x01\x00"
    (length,) = struct.unpack("<H", content[8:10])
    header = content[10 : 10 + length].decode("latin-1")
    shape = header.split("'shape': (")[1].split(")")[0]
    dtype = header.split("'descr': '")[1].split("'")[0]
    return (
        dtype.encode(),
        tuple(int(n) for n in shape.split(",") if n.strip()),
        content[10 + length :],
    )


def numbers(path: Path, descr: bytes, code: str) -> list[int]:
    found, (n,), data = array(path)
    assert found == descr
    return list(struct.unpack(f"<{n}{code}", data))


def the_lists(folder: Path) -> list[list[int]]:
    """Every word's local images, bit by bit."""
    offsets = numbers(folder / "offsets.npy", b"<i8", "q")
    counts = numbers(folder / "counts.npy", b"<u4", "I")
    _, _, packed = array(folder / "packed.npy")
    lists = []
    for word, count in enumerate(counts):
        at, image, images = offsets[word], -1, []
        while len(images) < count:
            n, width = min(count - len(images), 128), packed[at]
            size = -(-n * width // 8)
            bits = int.from_bytes(packed[at + 1 : at + 1 + size], "little")
            for i in range(n):
                image += 1 + (bits >> (i * width) & ((1 << width) - 1))
                images.append(image)
            at += 1 + size
        assert at == offsets[word + 1]
        lists.append(images)
    return lists


def live_generation(root: Path) -> dict[str, Any]:
    number = int((root / "CURRENT").read_text("ascii"))
    content: dict[str, Any] = json.loads((root / f"generations/{number:06d}.json").read_bytes())
    assert content["format_version"] == 3
    for name, entry in content["files"].items():
        whole = (root / name).read_bytes()
        assert (len(whole), hashlib.sha256(whole).hexdigest()) == (entry["size"], entry["sha256"])
    return content


def test_lists_ids_and_counts_are_as_the_page_says(tmp_path: Path) -> None:
    made_index(tmp_path, sizes=(300, 5), removed=(0, 7, 299))
    generation, opened = live_generation(tmp_path), OpenedIndex(tmp_path)
    channel, first = "hesaff-sc", 0
    lists: list[list[int]] = [[] for _ in range(20)]
    left = np.zeros(20, dtype=np.int64)
    for segment in generation["segments"]:
        folder = tmp_path / "segments" / segment["name"] / channel
        removed = [0] * segment["n_images"]
        if segment["tombstones"]:
            gone = tmp_path / "tombstones" / segment["tombstones"] / segment["name"]
            removed = list(array(gone / "removed.npy")[2])
            left += numbers(gone / f"{channel}.npy", b"<u4", "I")
        else:
            left += numbers(folder / "counts.npy", b"<u4", "I")
        assert sum(removed) == segment["n_removed"]
        words_per_image = [0] * segment["n_images"]
        for word, images in enumerate(the_lists(folder)):
            lists[word] += [first + image for image in images if not removed[image]]
            for image in images:
                words_per_image[image] += 1
        assert words_per_image == numbers(folder / "words_per_image.npy", b"<u4", "I")
        first += segment["n_images"]
    found = opened.lists(channel, np.arange(20))
    assert max(map(len, lists)) > 128, "a list of more than one block"
    assert [list(each) for each in np.split(found.image_ids, found.indptr[1:-1])] == lists
    assert [len(each) for each in lists] == left.tolist()
    assert opened.document_frequency(channel).tolist() == left.tolist()


def test_the_catalogue_and_the_digests_are_as_the_page_says(tmp_path: Path) -> None:
    made_index(tmp_path)
    generation = live_generation(tmp_path)
    table = pq.read_table(tmp_path / "catalogue" / "0001.parquet")
    assert table.column("image_id").to_pylist() == list(range(6))
    uris = [uri.encode() for uri in table.column("uri").to_pylist()]
    assert uris == sorted(uris)
    canonical = json.dumps(generation["config"], sort_keys=True, separators=(",", ":"))
    digest = hashlib.sha256(canonical.encode()).hexdigest()[:16]
    assert generation["config_digest"] == digest
    words = sorted(
        [channel, generation["files"][f"codebooks/0001/{channel}.npy"]["sha256"]]
        for channel in ("hesaff-sift", "hesaff-sc")
    )
    digest = hashlib.sha256(json.dumps(words).encode()).hexdigest()[:16]
    assert generation["codebooks_digest"] == digest
