"""Warming compiles what a search runs."""

from retrieval import complementarity, fusion_kernels, fusion_words
from retrieval.warm import compile_search_kernels


def test_the_kernels_of_a_search_are_compiled_by_warming() -> None:
    compile_search_kernels()
    for kernel in (
        fusion_words._keep_words,
        fusion_kernels.least_of_best,
        fusion_kernels.vote_union,
        fusion_kernels.vote_intersection,
        fusion_kernels.vote_pairwise,
        complementarity._inverse_distances,
        complementarity._leader_clusters,
    ):
        assert kernel.signatures, kernel
