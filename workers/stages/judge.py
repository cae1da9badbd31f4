"""Judge: what the ranking of a photo is worth where the truth is known."""

import time
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contracts.errors import UnusableImage
from index.opened import OpenedIndex
from index.selecting import candidates
from retrieval.evaluation import judge
from retrieval.fusion import full_ranking
from survey import DecodedImage
from workers.messages import JudgeMessage
from workers.stages.choose import choose
from workers.stages.retrieve import (
    Photo,
    open_index,
    read_photo,
    search_photo,
)

SHOWN = 10
"""Images of a judged ranking that are handed back, for people to look at."""


def judge_photo(request: JudgeMessage) -> dict[str, Any]:
    """AP and first hit of one query, as `evaluate --json` reports them, and `top`, its best ten.

    The query itself, where it is indexed too, is junk, as in the Holidays package. The published
    program of Oxford and Paris counts it as found instead, since it is in the good list: every
    query there has one relevant image more, and nearly always at rank 1.

    `error` : it cannot be read, or its box lies outside. `excluded` : it is the only image of its
    place.
    """
    started = time.perf_counter()
    query = read_query(request)
    if not isinstance(query, Query):
        return query
    index, photo, relevant, junk = query.index, query.photo, query.relevant, query.junk
    chosen = choose(index, photo, request.search, junk)
    scores = search_photo(index, photo, chosen, request.search)
    ids = candidates(index, request.search.where).ids
    order = full_ranking(scores)
    ranking = ids[order]
    seconds = time.perf_counter() - started
    result = judge(request.query, ranking, relevant, junk, chosen.detectors, chosen.k, seconds)
    top = [
        {
            "image_id": image,
            "score": float(score),
            "hit": image in relevant - junk,
            "junk": image in junk,
        }
        for image, score in zip(ranking[:SHOWN].tolist(), scores.values[order[:SHOWN]], strict=True)
    ]
    return {**asdict(replace(result, choice=chosen.choice)), "top": top}


@dataclass(frozen=True, slots=True)
class Query:
    """A query that can be judged. relevant, junk : image ids; some relevant one is not junk."""

    index: OpenedIndex
    photo: Photo
    relevant: set[int]
    junk: set[int]


def read_query(request: JudgeMessage) -> Query | dict[str, Any]:
    """Decode a query, only what lies in its box usable; or the answer that says why it is not."""
    index = open_index(request.index, request.generation)
    try:
        photo = read_photo(index, request.path)
        if request.box is not None:
            photo = replace(photo, usable=_inside(request.box, photo.decoded))
    except UnusableImage as error:
        return {"query": request.query, "error": str(error)}
    # What the truth calls junk, and the query itself where it is indexed too.
    itself = index.images_of_file(photo.decoded.sha256)
    query = Query(index, photo, set(request.relevant), {*request.junk, *itself})
    if not query.relevant - query.junk:
        return {"query": request.query, "excluded": True}
    return query


def _inside(box: tuple[float, float, float, float], decoded: DecodedImage) -> NDArray[np.bool_]:
    """The pixels of the decoded photo whose centre lies in a box of the original; (h, w)."""
    x1, y1, x2, y2 = box
    height, width = decoded.rgb.shape[:2]
    x = (np.arange(width) + 0.5) * (decoded.width_px / width)
    y = (np.arange(height) + 0.5) * (decoded.height_px / height)
    inside: NDArray[np.bool_] = ((y1 <= y) & (y < y2))[:, None] & ((x1 <= x) & (x < x2))
    if not inside.any():
        raise UnusableImage(
            f"the query's box {x1:g} {y1:g} {x2:g} {y2:g} holds no pixel of the photo, which is "
            f"{decoded.width_px} x {decoded.height_px}; correct the box or the photo"
        )
    return inside
