"""Codebooks on disk: the words, the saved search structure, and the distances of a channel.

`codebooks/<segment>/<channel>.npy` (V, D) uint8, `.faiss` the structure, `.json` the rest.
"""

import json
from pathlib import Path

import faiss
import numpy as np

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
    distances = {"dmin": codebook.dmin, "dmax": [float(value) for value in codebook.dmax]}
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
        dmin, dmax = float(distances["dmin"]), np.array(distances["dmax"], dtype=np.float32)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadIndex(
            f"{paths['distances']} is damaged ({error}). Restore it or index again."
        ) from error
    if not paths["search"].is_file() or sha256_of(paths["search"]) != search_sha256:
        raise BadIndex(
            f"{paths['search']} is missing or not the file that was written. "
            "Restore it or index again."
        )
    structure = faiss.deserialize_index(np.fromfile(paths["search"], dtype=np.uint8))
    return WordSearcher(Codebook(words.astype(np.uint8, copy=False), dmin, dmax), structure)
