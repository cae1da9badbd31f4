"""What the curve of sorted scores says of a ranking when the truth is not known.

A system that knows the answer puts a few images far above a flat tail (an L); one that guesses
declines slowly. It serves to weigh systems (Zheng et al. 2015) and to learn a choice of one.
"""

from collections.abc import Collection, Sequence
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from contracts.errors import WrongInput
from retrieval.fusion import Scores, rank
from retrieval.late_fusion import check_systems

N_CURVE = 400
"""Ranks of a curve, as in Zheng et al.'s public code."""

N_NEAREST = 10
"""Nearest reference curves that are averaged, as in that code."""

_HEAD = 10
"""First ranks left out of the search for references: there the right answers stand."""

_FLOOR = 1e-6
"""The least a score counts for in the product, as a share of its system's best."""

_PERSISTENCE = 0.9
"""p of rank-biased overlap."""


@dataclass(frozen=True, slots=True)
class Reference:
    """One system's curves of answers known to be wrong: (m, n_curve) float64, as `sorted_curve`."""

    curves: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CurveFeatures:
    """What the top n of one ranking's scores shows; all finite, all but `best` free of scale.

    best : s_1. second_gap : (s_1 - s_2) / s_1. mean_gap : (s_1 - mean of ranks 2..10) / s_1.
    z_score : (s_1 - median) / standard deviation, cf. NQC (Shtok, Kurland, Carmel, Raiber &
    Markovits, ACM TOIS 30(2), 2012). area : mean of the min-max curve, cf. Zheng et al. 2015;
    small = an L. gain : (mean of the first 5 - mean of all n) / mean of all n, cf. WIG (Zhou &
    Croft, SIGIR 2007).
    """

    best: float
    second_gap: float
    mean_gap: float
    z_score: float
    area: float
    gain: float

    def as_tuple(self) -> tuple[float, ...]:
        """List the features in the order in which they are declared."""
        return astuple(self)


def sorted_curve(scores: Scores, n_curve: int = N_CURVE) -> NDArray[np.float64]:
    """Sort the best n_curve scores, descending, made comparable between queries: (n_curve,).

    Missing ranks are untouched images, at 0 or the worst touched score, whichever is lower; a
    curve with a negative score is lifted to end at 0. It is divided by its Euclidean norm, since
    our scores, unlike the cosines of Zheng et al., grow with the number of keypoints. A min-max
    would not do: all curves would start at 1, none stand above its reference, and a strong first
    answer would make the area larger. All 0 if nothing was touched or every score is 0.

    Raises
    ------
    WrongInput : n_curve is below 2.
    """
    if n_curve < 2:
        raise WrongInput(f"a score curve of {n_curve} ranks was asked for; it needs 2 or more")
    top = _top(scores, n_curve)
    curve = np.full(n_curve, min(0.0, float(top[-1]) if len(top) else 0.0))
    curve[: len(top)] = top
    curve -= min(0.0, float(curve[-1]))
    if curve[0] == 0:
        return curve
    curve /= curve[0]
    return np.asarray(curve / np.linalg.norm(curve), dtype=np.float64)


def reference_curves(
    others: Sequence[Scores],
    relevant: Sequence[Collection[int]],
    n_curve: int = N_CURVE,
) -> Reference:
    """Gather one system's curves of irrelevant answers from queries other than the one to fuse.

    Parameters
    ----------
    others : one system's scores of other queries (of other places, in an evaluation).
    relevant : for each, the image ids to leave out; no curve if nothing touched is then left.

    Raises
    ------
    WrongInput : lists of different lengths, an id beyond the images, or no curve at all.
    """
    if len(others) != len(relevant):
        raise WrongInput(
            f"{len(others)} queries' scores came with {len(relevant)} sets of relevant images; "
            "give one set a query"
        )
    wrong = [_without(scores, ids) for scores, ids in zip(others, relevant, strict=True)]
    curves = [sorted_curve(scores, n_curve) for scores in wrong if scores.touched.any()]
    if not curves:
        raise WrongInput(
            f"none of {len(others)} queries found an irrelevant image, so there is no reference "
            "curve; give queries that touch more than their own answers"
        )
    return Reference(np.array(curves))


def weights(
    curves: Sequence[NDArray[np.float64]],
    references: Sequence[Reference],
    n_nearest: int = N_NEAREST,
) -> NDArray[np.float64]:
    """Weigh the systems by how L-shaped their curves are, w_i = (1/A_i) / sum_j (1/A_j).

    A_i is the area under system i's curve once the mean of its n_nearest references, nearest in
    the tail, is subtracted and the difference scaled to 0..1. The tail leaves out the first 10
    ranks, or half of a shorter curve (the public code one: the query, which its database holds).
    A constant difference says nothing: A = 1, the largest there is, as in that code. Zheng, Wang,
    Tian, He, Liu & Tian, "Query-adaptive late fusion for image search and person
    re-identification", CVPR 2015, equations 2 to 4.

    Parameters
    ----------
    curves, references : of one query, one each a system, in one order; each curve (n_curve,) as
        `sorted_curve`. One that is all 0 has weight 0: its system found nothing.

    Returns
    -------
    (n_systems,) float64 that sum to 1; equal if no system found anything.

    Raises
    ------
    WrongInput : systems, or lengths of curves, do not fit.
    """
    _check_references(curves, references, n_nearest)
    inverse = np.array(
        [
            1.0 / _area_above(curve, reference.curves, n_nearest) if curve.any() else 0.0
            for curve, reference in zip(curves, references, strict=True)
        ]
    )
    total = inverse.sum()
    if total == 0:
        return np.full(len(curves), 1.0 / len(curves))
    return np.asarray(inverse / total, dtype=np.float64)


def query_adaptive(
    systems: Sequence[Scores], references: Sequence[Reference], n_nearest: int = N_NEAREST
) -> Scores:
    """Fuse by the product of s_i ** w_i, w_i from `weights`: Zheng et al. 2015, equation 1.

    A product needs positive factors: a system's negative scores are lifted until the worst
    touched one is 0, and its best is made 1. In the published product a 0 silences all other
    systems and ties every image it befalls: here no score, an untouched image's included, counts
    for less than 1e-6, so that images which one system missed come late but in order.

    Parameters
    ----------
    systems, references : one each a system, in one order; no reference made with this query.

    Raises
    ------
    WrongInput : the systems score different numbers of images, or as `weights`.
    """
    check_systems(systems)
    if len(systems) != len(references):
        raise _misfit(len(systems), len(references))
    curves = [
        sorted_curve(system, reference.curves.shape[1])
        for system, reference in zip(systems, references, strict=True)
    ]
    logs = np.zeros(len(systems[0].values), dtype=np.float64)
    for system, weight in zip(systems, weights(curves, references, n_nearest), strict=True):
        logs += weight * np.log(_positive(system))
    touched = np.any([system.touched for system in systems], axis=0)
    return Scores(np.where(touched, np.exp(logs), 0.0), touched)


def curve_features(scores: Scores, n: int = 100) -> CurveFeatures:
    """Describe the n best scores; see `CurveFeatures`.

    Untouched images count, as 0 or the worst touched score if that is negative. Where scores are
    negative, s_1 as a divisor becomes the largest magnitude and a mean that of the magnitudes,
    which is the same for positive ones. Without spread z_score is 0 and area 1; a single image
    has no gaps.
    """
    top = _top(scores, n)
    largest = float(np.abs(top).max(initial=0.0))
    if largest == 0:
        return CurveFeatures(0.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    scaled = top / largest
    spread, span = float(scaled.std()), float(scaled[0] - scaled[-1])
    return CurveFeatures(
        best=float(top[0]),
        second_gap=float(scaled[0] - scaled[min(1, len(top) - 1)]),
        mean_gap=float(scaled[0] - scaled[1:10].mean()) if len(top) > 1 else 0.0,
        z_score=float(scaled[0] - np.median(scaled)) / spread if span and spread else 0.0,
        area=float((scaled - scaled[-1]).mean()) / span if span else 1.0,
        gain=float((scaled[:5].mean() - scaled.mean()) / np.abs(scaled).mean()),
    )


def agreement(a: Scores, b: Scores, n: int = 10) -> float:
    """Compare the first n answers of two rankings: 0 = none in common, 1 = the same.

    Rank-biased overlap, the mean over depths d of the share of the first d that both have,
    weighted by p ** (d - 1), p = 0.9, cut at n and divided by the sum of the weights (Webber,
    Moffat & Zobel, ACM TOIS 28(4), 2010). Depths that neither ranking reaches are left out;
    two rankings without an answer agree in nothing.
    """
    first = np.array([match.image_id for match in rank(a, n)], dtype=np.int64)
    second = np.array([match.image_id for match in rank(b, n)], dtype=np.int64)
    n_depths = max(len(first), len(second))
    if n_depths == 0:
        return 0.0
    in_first, in_second = np.nonzero(first[:, np.newaxis] == second)
    joined_at = np.bincount(np.maximum(in_first, in_second), minlength=n_depths)
    overlap = np.cumsum(joined_at) / np.arange(1, n_depths + 1)
    share = _PERSISTENCE ** np.arange(n_depths)
    return float((overlap * share).sum() / share.sum())


def _top(scores: Scores, n: int) -> NDArray[np.float64]:
    """Sort the n best scores of all images, descending; untouched images come last."""
    values = scores.values[scores.touched]
    if len(values) > n:
        values = np.partition(values, len(values) - n)[len(values) - n :]
    values = np.sort(values)[::-1]
    n_untouched = min(n, len(scores.values)) - len(values)
    return np.append(values, np.full(n_untouched, min(0.0, values[-1] if len(values) else 0.0)))


def _without(scores: Scores, ids: Collection[int]) -> Scores:
    gone = np.array(sorted(ids), dtype=np.int64)
    if len(gone) and not 0 <= gone[0] <= gone[-1] < len(scores.values):
        raise WrongInput(
            f"relevant image ids {gone[0]} to {gone[-1]} do not fit scores of "
            f"{len(scores.values)} images; take both from one index"
        )
    return Scores(np.delete(scores.values, gone), np.delete(scores.touched, gone))


def _area_above(
    curve: NDArray[np.float64], references: NDArray[np.float64], n_nearest: int
) -> float:
    """Mean of the scaled difference, within 1 / n_curve .. 1."""
    tail = slice(min(_HEAD, len(curve) // 2), None)
    sq_dist = ((references[:, tail] - curve[tail]) ** 2).sum(axis=1)
    nearest = np.argsort(sq_dist, kind="stable")[:n_nearest]
    above = curve - references[nearest].mean(axis=0)
    above -= above.min()
    highest = above.max()
    return float((above / highest).mean()) if highest > 0 else 1.0


def _positive(system: Scores) -> NDArray[np.float64]:
    """Scores as factors: within _FLOOR .. 1, untouched images at _FLOOR."""
    factors = np.full(len(system.values), _FLOOR)
    values = system.values[system.touched]
    if len(values):
        lifted = values - min(0.0, float(values.min()))
        best = lifted.max()
        factors[system.touched] = np.maximum(lifted / best if best > 0 else lifted, _FLOOR)
    return factors


def _check_references(
    curves: Sequence[NDArray[np.float64]], references: Sequence[Reference], n_nearest: int
) -> None:
    if not curves or len(curves) != len(references):
        raise _misfit(len(curves), len(references))
    if n_nearest < 1:
        raise WrongInput(f"n_nearest is {n_nearest}; average 1 reference curve or more")
    for curve, reference in zip(curves, references, strict=True):
        shape = reference.curves.shape
        if len(shape) != 2 or shape[0] < 1 or curve.shape != shape[1:] or shape[1] < 2:
            raise WrongInput(
                f"a score curve of shape {curve.shape} came with references of shape {shape}; "
                "expected (n_curve,) and (m, n_curve), with m of 1 and n_curve of 2 or more"
            )


def _misfit(n_systems: int, n_references: int) -> WrongInput:
    return WrongInput(
        f"{n_systems} systems came with references for {n_references}; "
        "give one system or more, and one set of reference curves each"
    )
