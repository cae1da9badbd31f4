"""Choose: the detectors and k that a photo is searched with: given, by a model, by default."""

from collections.abc import Collection, Sequence

from contracts.config import DESCRIPTORS, Descriptor, Detector, SearchConfig
from index.models import read_model
from index.opened import OpenedIndex
from index.selecting import candidates
from retrieval.candidates import Candidate, FirstLook, candidate_features
from retrieval.choice import Choice, ChoiceModel
from workers.stages.retrieve import (
    Chosen,
    Configured,
    Photo,
    densities,
    descriptors_of,
    detector_votes,
    sizes_of,
    words_of,
)

DEFAULT_PAIR: tuple[Detector, Detector] = ("mser", "har")
DEFAULT_K = 2
"""The pair and k where there is no model to ask (docs/decisions/0010)."""
KS = (2, 5, 10)
"""What `--k auto` chooses from, as in the paper's Table IV."""


def choose(
    index: Configured, photo: Photo, search: SearchConfig, junk: Collection[int] = ()
) -> Chosen:
    """Settle the detectors and k: as given, by the model, or the default that says so.

    junk : images that the choice may not see, such as the photo itself where it is indexed.
    """
    if search.pair != "auto" and search.k != "auto":
        return Chosen((search.pair,), search.k, None, "given")
    if search.pair != "auto" and len(search.pair) != 2:
        return Chosen(
            (search.pair,), DEFAULT_K, None, "given; k by default: models choose for pairs"
        )
    model, why_not = fitting_model(index, search)
    if model is None:
        pair = search.pair if search.pair != "auto" else default_pair(index)
        k = search.k if search.k != "auto" else DEFAULT_K
        return Chosen((pair,), k, None, f"default: {why_not}")
    made = _by_model(model, index, photo, search, junk)
    if search.k == "auto" or search.k == made.k:
        return Chosen(made.pairs, made.k, made.predicted_map, made.reason)
    return Chosen(made.pairs, search.k, None, f"{made.reason} with k = {made.k}")


def _by_model(
    model: ChoiceModel,
    index: Configured,
    photo: Photo,
    search: SearchConfig,
    junk: Collection[int],
) -> Choice:
    has = set(index.config.features.detectors)
    ks = {k for _, k in model.candidates()}
    asked = search.k
    # A k that no pair was tried with: what is best for the nearest that was.
    wanted = ks if asked == "auto" else {min(sorted(ks), key=lambda k: abs(k - asked))}
    allowed = [
        (pair, k)
        for pair, k in model.candidates()
        if (search.pair == "auto" or set(pair) == set(search.pair))
        and k in wanted
        and set(pair) <= has
    ]
    best = "best for all in training"
    if model.variant == "fixed":
        return model.best_fixed(allowed, best)
    if not set(model.detectors) <= has:
        missing = ", ".join(sorted(set(model.detectors) - has))
        return model.best_fixed(allowed, f"{best}: the model also wants {missing}")
    if not isinstance(index, OpenedIndex):
        return model.best_fixed(allowed, f"{best}: the model also asks the index")
    return model.choose(features_of(index, photo, search, model, junk), allowed)


def features_of(
    index: OpenedIndex,
    photo: Photo,
    search: SearchConfig,
    model: ChoiceModel,
    junk: Collection[int] = (),
) -> dict[Candidate, tuple[float, ...]]:
    """What the model wants to know of every pair and k."""
    ks = sorted({k for _, k in model.candidates()})
    look = None
    if model.needs_look:
        words = words_of(index, photo, model.detectors, max(ks), search)
        votes = detector_votes(index, words, ks, search)
        unseen = candidates(index, search.where).places(junk)
        look = FirstLook(votes, sizes_of(index, model.detectors, search), unseen)
    return candidate_features(
        photo.complementarity(model.detectors),
        densities(index, model.detectors, search),
        ks,
        look,
    )


def default_pair(index: Configured) -> tuple[Detector, ...]:
    """The default pair, or the first detectors of an index that lacks one of it."""
    detectors = index.config.features.detectors
    return DEFAULT_PAIR if set(DEFAULT_PAIR) <= set(detectors) else detectors[:2]


def fitting_model(index: Configured, search: SearchConfig) -> tuple[ChoiceModel | None, str]:
    """The index's own model, or the shipped one, if it was trained for such a search."""
    model = read_model(index.root)
    if model is None:
        return None, "no model"
    if len(set(model.detectors) & set(index.config.features.detectors)) < 2:
        return None, "the model chooses pairs and the index has fewer than two of its detectors"
    untrained = set(() if search.pair == "auto" else search.pair) - set(model.detectors)
    if untrained:
        return None, f"the model was trained without {', '.join(sorted(untrained))}"
    trained = SearchConfig(
        descriptors=_in_order(model.descriptors), vote=model.vote, weights=model.weights
    )
    asked = search.model_copy(
        update={
            "descriptors": _in_order(descriptors_of(index, search)),
            "weights": tuple(sorted(search.weights)),
            "pair": trained.pair,
            "k": trained.k,
            "top": trained.top,
            "where": trained.where,
        }
    )
    if trained != asked:
        return None, "the model was trained with other descriptors, vote or weights"
    return model, ""


def _in_order(descriptors: Sequence[Descriptor]) -> tuple[Descriptor, ...]:
    """As they are always listed: their order means nothing to a search."""
    return tuple(name for name in DESCRIPTORS if name in descriptors)
