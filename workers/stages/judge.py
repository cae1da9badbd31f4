"""Judge and rehearse: what the ranking of a photo is worth where the truth is known."""

import time
from dataclasses import asdict
from typing import Any

from contracts.errors import UnusableImage
from index.opened import OpenedIndex
from retrieval.evaluation import average_precision, judge
from retrieval.fusion import full_ranking, fuse
from workers.messages import JudgeMessage, RehearseMessage
from workers.stages.retrieve import (
    Photo,
    channel_query,
    choose,
    descriptors_of,
    nearest_words,
    open_index,
    read_photo,
    search_photo,
)


def judge_photo(request: JudgeMessage) -> dict[str, Any]:
    """AP and first hit of one query, as `evaluate --json` reports them.

    `error` : it cannot be read. `excluded` : it is the only image of its place.
    """
    started = time.perf_counter()
    index = open_index(request.index, request.generation)
    try:
        photo = read_photo(index, request.path)
    except UnusableImage as error:
        return {"query": request.query, "error": str(error)}
    chosen = choose(index, photo, request.search)
    ranking = full_ranking(search_photo(index, photo, chosen, request.search))
    seconds = time.perf_counter() - started
    relevant, junk = set(request.relevant), _junk(index, photo)
    if not relevant - junk:
        return {"query": request.query, "excluded": True}
    return asdict(
        judge(request.query, ranking, relevant, junk, chosen.detectors, chosen.k, seconds)
    )


def rehearse_photo(request: RehearseMessage) -> dict[str, Any]:
    """The AP of one training query with every pair and k, and each pair's complementarity."""
    index = open_index(request.index, request.generation)
    try:
        photo = read_photo(index, request.path)
    except UnusableImage as error:
        return {"query": request.query, "error": str(error)}
    relevant, junk = set(request.relevant), _junk(index, photo)
    if not relevant - junk:
        return {"query": request.query, "excluded": True}
    descriptors = descriptors_of(index, request.search)
    used = sorted({name for pair in request.pairs for name in pair})
    nearest = {
        name: nearest_words(index, photo, name, descriptors, max(request.ks)) for name in used
    }
    features = photo.complementarity(index.config.features.detectors)
    rows = []
    for pair in request.pairs:
        channels = [f"{det}-{desc}" for det in pair for desc in descriptors]
        distinct = index.distinct_words(channels) if "norm" in request.search.weights else None
        for k in request.ks:
            queries = [
                [
                    channel_query(index, name, found, k, request.search)
                    for name, found in nearest[detector].items()
                ]
                for detector in pair
            ]
            ranking = full_ranking(fuse(queries, index.n_images, request.search, distinct))
            rows.append(
                {
                    "pair": pair,
                    "k": k,
                    "ap": average_precision(ranking, relevant, junk),
                    "features": asdict(features[pair]),
                }
            )
    return {"query": request.query, "rows": rows}


def _junk(index: OpenedIndex, photo: Photo) -> set[int]:
    """The query itself, where it is indexed too."""
    return {
        image_id
        for image_id, sha256 in enumerate(index.catalogue.column("sha256"))
        if sha256 == photo.decoded.sha256
    }
