"""Codebooks on disk: the words, the saved search structure, and the distances of a channel.

`codebooks/<segment>/<channel>.npy` (V, D) uint8, `.faiss` the structure, `.json` the rest.
"""

import json
from pathlib import Path

import faiss
import numpy as np
from numpy.typing import NDArray

from contracts.config import MAX_NEIGHBOURS
from contracts.errors import BadIndex
from index.files import map_array, sha256_of, write_array, write_bytes
from retrieval.codebooks import Codebook, WordSearcher, build_search


def codebook_paths(root: Path, segment: str, channel: str) -> dict[str, Path]:
    """The three files of a codebook, by what they hold."""
    stem = root / "codebooks" / segment / channel
    return {
        "words": stem.with_name(f"{channel}.npy"),
        "search": stem.with_name(f"{channel}.faiss"),
        "distances": stem.with_name(f"{channel}.json"),
    }


def write_codebook(paths: dict[str, Path], codebook: Codebook) -> dict[Path, str]:
    """Write a codebook and its search structure; returns path -> sha256."""
    structure: np.ndarray = faiss.serialize_index(build_search(codebook.words))
    distances = {
        "dmin": codebook.dmin,
        "dmax": codebook.dmax.tolist(),
        "d99": codebook.d99.tolist(),
    }
    return {
        paths["words"]: write_array(paths["words"], codebook.words),
        paths["search"]: write_bytes(paths["search"], structure.tobytes()),
        paths["distances"]: write_bytes(
            paths["distances"], json.dumps(distances, indent=1).encode()
        ),
    }


def read_searcher(paths: dict[str, Path], search_sha256: str) -> WordSearcher:
    """Open a codebook for searching.

    faiss trusts what it reads, so the structure is loaded only if its digest is `search_sha256`.
    """
    words = map_array(paths["words"], np.uint8, 2)
    try:
        distances = json.loads(paths["distances"].read_bytes())
        dmin = float(distances["dmin"])
        dmax, d99 = _of_each_k(distances["dmax"]), _of_each_k(distances["d99"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadIndex(
            f"{paths['distances']} is damaged or of an older Flaneur ({error!r}). "
            "Restore it or index again."
        ) from error
    if not paths["search"].is_file() or sha256_of(paths["search"]) != search_sha256:
        raise BadIndex(
            f"{paths['search']} is missing or not the file that was written. "
            "Restore it or index again."
        )
    structure = faiss.deserialize_index(np.fromfile(paths["search"], dtype=np.uint8))
    codebook = Codebook(words.astype(np.uint8, copy=False), dmin, dmax, d99)
    return WordSearcher(codebook, structure)


def _of_each_k(values: list[float]) -> NDArray[np.float32]:
    distances = np.array(values, dtype=np.float32)
    if distances.shape != (MAX_NEIGHBOURS,):
        raise ValueError(f"{distances.shape} distances, expected {MAX_NEIGHBOURS}")
    return distances
