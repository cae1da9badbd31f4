"""Codebooks on disk: the words, the saved search structure, and the distances of a channel.

`codebooks/<name>/<channel>.npy` (V, D) uint8 the words, memory-mapped; `.npz` their lists:
`centres` (C, D) uint8, `starts` (C+1,) int64, `word_ids` (V,) int32; `.json` the rest.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from contracts.config import MAX_NEIGHBOURS
from contracts.errors import BadIndex, VocabularyMismatch
from index.files import (
    map_array,
    read_member,
    read_text_file,
    sha256_of,
    write_array,
    write_arrays,
    write_bytes,
)
from index.manifest import Generation
from retrieval.codebooks import Codebook, WordSearcher, build_search
from retrieval.word_search import WordLists


@dataclass(frozen=True, slots=True)
class Words:
    """The codebooks of all channels of an index. name : their folder under `codebooks/`.

    files : sha256 by path relative to the index, of every channel. digest : of all words.
    n_words : by channel.
    """

    name: str
    digest: str
    files: dict[str, dict[str, str]]
    n_words: dict[str, int]


def codebook_paths(root: Path, name: str, channel: str) -> dict[str, Path]:
    """The three files of a codebook, by what they hold."""
    stem = root / "codebooks" / name / channel
    return {
        "words": stem.with_name(f"{channel}.npy"),
        "search": stem.with_name(f"{channel}.npz"),
        "distances": stem.with_name(f"{channel}.json"),
    }


def count_words(root: Path, name: str, channel: str) -> int:
    """How many words a channel has.

    Raises
    ------
    BadIndex : the file is missing or damaged.
    """
    return len(map_array(codebook_paths(root, name, channel)["words"], np.uint8, 2))


def words_of_generation(root: Path, generation: Generation) -> Words:
    """The words that an index was made with.

    Raises
    ------
    BadIndex : a codebook is missing or damaged.
    """
    files, n_words = {}, {}
    for channel in generation.config.features.channels():
        paths = codebook_paths(root, generation.codebooks, channel).values()
        names = [path.relative_to(root).as_posix() for path in paths]
        files[channel] = {name: generation.file(name).sha256 for name in names}
        n_words[channel] = count_words(root, generation.codebooks, channel)
    return Words(generation.codebooks, generation.codebooks_digest, files, n_words)


def codebooks_digest(files: Mapping[str, str]) -> str:
    """What tells two sets of words apart: 16 hex digits over channel -> sha256 of its words."""
    named = json.dumps(sorted(files.items())).encode()
    return hashlib.sha256(named).hexdigest()[:16]


def write_codebook(paths: dict[str, Path], codebook: Codebook) -> dict[Path, str]:
    """Write a codebook and its search structure; returns path -> sha256."""
    lists = build_search(codebook.words)
    distances = {
        "dmin": codebook.dmin,
        "dmax": codebook.dmax.tolist(),
        "d99": codebook.d99.tolist(),
    }
    arrays: dict[str, NDArray[np.generic]] = {
        "centres": lists.centres,
        "starts": lists.starts,
        "word_ids": lists.word_ids,
    }
    return {
        paths["words"]: write_array(paths["words"], codebook.words),
        paths["search"]: write_arrays(paths["search"], arrays),
        paths["distances"]: write_bytes(
            paths["distances"], json.dumps(distances, indent=1).encode()
        ),
    }


def read_searcher(paths: dict[str, Path], search_sha256: str) -> WordSearcher:
    """Open a codebook for searching. The words are mapped: processes share them.

    Parameters
    ----------
    paths : as `codebook_paths` gives them.
    search_sha256 : of the search structure; it is read only if that is its digest.

    Raises
    ------
    BadIndex : a file is missing, damaged or of another codebook.
    """
    words = map_array(paths["words"], np.uint8, 2)
    try:
        distances = json.loads(read_text_file(paths["distances"]))
        dmin = float(distances["dmin"])
        dmax, d99 = _of_each_k(distances["dmax"]), _of_each_k(distances["d99"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadIndex(
            f"{paths['distances']} is damaged or of an older Flaneur ({error!r}). "
            "Restore it or index again."
        ) from error
    try:
        return WordSearcher(
            Codebook(words, dmin, dmax, d99), _read_lists(paths["search"], search_sha256)
        )
    except VocabularyMismatch as error:
        raise BadIndex(
            f"{paths['words']} and {paths['search']} do not belong together ({error}). "
            "Restore both or index again."
        ) from error


def _read_lists(path: Path, sha256: str) -> WordLists:
    if not path.is_file() or sha256_of(path) != sha256:
        raise BadIndex(
            f"{path} is missing or not the file that was written. Restore it or index again."
        )
    return WordLists(
        read_member(path, "centres", np.uint8, 2),
        read_member(path, "starts", np.int64, 1),
        read_member(path, "word_ids", np.int32, 1),
    )


def _of_each_k(values: list[float]) -> NDArray[np.float32]:
    distances = np.array(values, dtype=np.float32)
    if distances.shape != (MAX_NEIGHBOURS,):
        raise ValueError(f"{distances.shape} distances, expected {MAX_NEIGHBOURS}")
    return distances
