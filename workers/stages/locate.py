"""Locate: retrieve what a photo shows, and place it on the map."""

import time
from typing import Any

import numpy as np

from contracts.config import SearchConfig
from contracts.errors import UnusableImage
from geo.geojson import error_feature
from index.opened import OpenedIndex
from index.selecting import candidates
from retrieval.bag_of_words import score_bag_of_words
from retrieval.fusion import Scores
from workers.messages import LocateMessage
from workers.stages.choose import choose
from workers.stages.place import ESTIMATE_FROM, place
from workers.stages.retrieve import (
    Chosen,
    Photo,
    best_matches,
    nearest_words,
    of_candidates,
    open_index,
    read_photo,
    search_photo,
)

PLAIN = Chosen((("hesaff",),), 1, None, "baseline: bag of words")


def locate_photo(request: LocateMessage) -> dict[str, Any]:
    """GeoJSON features of one photo: its matches and an estimate, or what is wrong with it."""
    started = time.perf_counter()
    index = open_index(request.index, request.generation)
    try:
        photo = read_photo(index, request.path)
    except UnusableImage as error:
        return {"features": [error_feature(request.query, str(error))], "seconds": 0.0}
    if request.plain:
        chosen, scores = PLAIN, _bag_of_words(index, photo, request.search)
    else:
        chosen = choose(index, photo, request.search)
        scores = search_photo(index, photo, chosen, request.search)
    wanted = max(request.search.top, ESTIMATE_FROM)
    matches = best_matches(index, scores, request.search, wanted)
    if matches:
        features = place(index, request.query, chosen, matches, request.search, scores)
    else:
        reason = "no image searched shares a visual word with it: does it show a place?"
        features = [error_feature(request.query, reason)]
    return {"features": features, "seconds": time.perf_counter() - started}


def _bag_of_words(index: OpenedIndex, photo: Photo, search: SearchConfig) -> Scores:
    """The baseline that everybody knows: hesaff-SIFT words, tf-idf, cosine."""
    channel = "hesaff-sift"
    word_ids, _ = nearest_words(index, photo, "hesaff", ["sift"], 1)[channel]
    idf = index.idf(channel)
    postings = index.lists(channel, np.arange(len(idf)), candidates(index, search.where).kept)
    scores = score_bag_of_words(word_ids[:, 0], postings, idf, index.n_images)
    return of_candidates(index, scores, search)
