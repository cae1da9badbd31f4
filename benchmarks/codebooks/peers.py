"""What faiss offers for finding the nearest of many words, under one interface."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import faiss
import numpy as np
from numpy.typing import NDArray

from retrieval.codebooks import Codebook, WordSearcher, build_search

Find = Callable[[NDArray[np.uint8], int], NDArray[np.int64]]

_HNSW_WORDS = 200_000
"""Beyond, a graph takes too long to build here."""


@dataclass(frozen=True, slots=True)
class Way:
    """A way to find words. find : k word ids (n, k) of descriptors. megabytes : what it holds."""

    find: Find
    megabytes: float


def ours(codebook: Codebook) -> Way:
    """The search that an index stores."""
    lists = build_search(codebook.words)
    searcher = WordSearcher(codebook, lists)
    held = (codebook.words, lists.centres, lists.starts, lists.word_ids)
    return Way(
        lambda points, k: searcher.nearest(points, k)[0].astype(np.int64),
        sum(array.nbytes for array in held) / 1e6,
    )


def faiss_ways(words: NDArray[np.uint8]) -> Mapping[str, Callable[[], Way]]:
    """Every other way, to be built when it is its turn."""
    n_words, dimensions = words.shape
    n_lists = round(3.5 * np.sqrt(n_words))
    ivf = f"IVF{n_lists}"
    recipes: dict[str, tuple[str, dict[str, float]]] = {
        "exact (Flat)": ("Flat", {}),
        "HNSW32, efSearch 64": ("HNSW32,Flat", {"efSearch": 64}),
        "IVF-flat, 16 probes": (f"{ivf},Flat", {"nprobe": 16}),
        "IVF 4-bit fast scan, 24 probes, 40 refined": (
            f"{ivf},PQ{dimensions // 2}x4fs,Refine(Flat)",
            {"nprobe": 24, "k_factor_rf": 40},
        ),
    }
    return {
        name: partial(_built, words, recipe, settings)
        for name, (recipe, settings) in recipes.items()
        if not (recipe.startswith("HNSW") and n_words > _HNSW_WORDS)
    }


def _built(words: NDArray[np.uint8], recipe: str, settings: Mapping[str, float]) -> Way:
    index: Any = faiss.index_factory(words.shape[1], recipe)
    as_floats = words.astype(np.float32)
    index.train(as_floats)
    index.add(as_floats)
    parameters = faiss.ParameterSpace()
    for name, value in settings.items():
        parameters.set_index_parameter(index, name, value)

    def find(points: NDArray[np.uint8], k: int) -> NDArray[np.int64]:
        found: NDArray[np.int64] = index.search(points.astype(np.float32), k)[1]
        return found

    return Way(find, len(faiss.serialize_index(index)) / 1e6)
