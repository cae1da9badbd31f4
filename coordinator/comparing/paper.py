"""What Bhowmik, Weng, Gouet-Brunet and Soheilian report in JURSE 2017, to set beside ours."""

from collections.abc import Mapping

from contracts.config import Detector

Figures = tuple[float | None, float | None]
"""Of Paris DB and PCD DB; None: not printed."""

ByPair = Mapping[tuple[Detector, Detector], Figures]

PARIS, CROSS_DOMAIN = "Paris DB", "PCD DB"

PREDICTED: ByPair = {
    ("hesaff", "mser"): (0.548, 0.535),
    ("hesaff", "star"): (0.547, 0.549),
    ("hesaff", "har"): (0.481, 0.537),
    ("hesaff", "orb"): (0.501, 0.512),
    ("hesaff", "colsym"): (0.512, 0.497),
    ("mser", "star"): (0.526, 0.494),
    ("mser", "har"): (0.481, 0.519),
    ("mser", "orb"): (0.510, 0.465),
    ("mser", "colsym"): (0.429, 0.468),
    ("star", "har"): (0.481, 0.521),
    ("star", "orb"): (0.456, 0.461),
    ("star", "colsym"): (0.457, 0.458),
    ("har", "orb"): (0.458, 0.493),
    ("har", "colsym"): (0.384, 0.485),
    ("orb", "colsym"): (0.410, 0.375),
}
"""Table I: mAP' of Paris DB and PCD DB."""

FUSED: ByPair = {
    ("hesaff", "mser"): (0.589, None),
    ("hesaff", "star"): (0.570, 0.409),
    ("hesaff", "har"): (None, 0.398),
    ("har", "colsym"): (0.371, None),
    ("orb", "colsym"): (None, 0.227),
}
"""Table II, k = 2, by fusion of inverted indices."""

LATE: ByPair = {
    ("hesaff", "mser"): (0.541, None),
    ("hesaff", "star"): (0.535, 0.365),
    ("hesaff", "har"): (None, 0.362),
}
"""Table II, k = 2, by late fusion."""

SINGLE: Mapping[Detector, Figures] = {
    "hesaff": (0.546, 0.351),
    "mser": (0.523, None),
    "star": (None, 0.287),
}
"""Table III, k = 2."""

BY_K: Mapping[tuple[Detector, Detector, int], Figures] = {
    ("hesaff", "mser", 2): (0.589, None),
    ("hesaff", "mser", 5): (0.571, None),
    ("hesaff", "mser", 10): (0.531, None),
    ("hesaff", "star", 2): (0.570, 0.409),
    ("hesaff", "star", 5): (0.544, 0.402),
    ("hesaff", "star", 10): (0.512, 0.372),
    ("hesaff", "har", 2): (None, 0.398),
    ("hesaff", "har", 5): (None, 0.393),
    ("hesaff", "har", 10): (None, 0.354),
}
"""Table IV, fixed choices."""

ADAPTIVE = (0.597, 0.445)
"""Table IV, the adaptive choice."""

SHARE_OF_K_2 = (0.91, 0.50)
"""Of the queries of Fig. 2, as the text says."""
