"""Choice models for the small index, fitted on made-up queries that look like one photo."""

import numpy as np

from contracts.config import Detector, SearchConfig, VariantName
from retrieval.candidates import Candidate
from retrieval.choice import ChoiceModel
from retrieval.choice_fit import fit_choice
from retrieval.trials import Trials

NAMES: tuple[Detector, ...] = ("hesaff", "mser", "star")
SEARCH = SearchConfig()
WINNER: Candidate = (("mser", "star"), 5)
"""Best in training, of every model here."""
SECOND: Candidate = (("hesaff", "star"), 2)


def trained(
    known: dict[Candidate, tuple[float, ...]],
    variant: VariantName,
    detectors: tuple[Detector, ...] = NAMES,
) -> ChoiceModel:
    """A model of queries like the photo, where `WINNER` did best and `SECOND` next."""
    candidates = tuple(known)
    ap = np.tile([{WINNER: 0.9, SECOND: 0.6}.get(each, 0.2) for each in candidates], (5, 1))
    together = (ap[:, :, np.newaxis] + ap[:, np.newaxis]) / 2
    ks = np.array([k for _, k in candidates])
    together[:, ks[:, np.newaxis] != ks] = np.nan
    scale = 0.5 + np.arange(5) / 4
    features = scale[:, np.newaxis, np.newaxis] * np.array(list(known.values()))
    names = np.array([f"q{number}" for number in range(5)])
    sets = np.array(["made up"] * 5)
    return fit_choice(
        Trials(tuple(names), names, sets, candidates, ap, together, features),
        detectors=detectors,
        descriptors=("sift", "surf", "sc"),
        vote=SEARCH.vote,
        weights=SEARCH.weights,
        index_digest=None,
        variants=(variant,),
    )


def of_six(known: dict[Candidate, tuple[float, ...]], variant: VariantName) -> ChoiceModel:
    """A model that also knows har, with which it did better than with anything else."""
    more = known | {((name, "har"), k): known[WINNER] for name in NAMES for k in (2, 5)}
    model = trained(
        dict(sorted(more.items(), key=lambda each: (each[0][1], [*map(_place, each[0][0])]))),
        variant,
        (*NAMES, "har"),
    )
    best = model.fixed[-1].model_copy(update={"mean_ap": 0.95})
    assert "har" in best.pair
    return model.model_copy(update={"fixed": (best, *model.fixed[:-1])})


def _place(name: Detector) -> int:
    return (*NAMES, "har").index(name)
