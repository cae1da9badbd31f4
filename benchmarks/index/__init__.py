"""Indices of surveys of 10 thousand to a million images: built, opened and asked.

FLANEUR_INDEX_IMAGES names the sizes, such as 10000,100000,1000000; the last needs 25 GB of disk.
"""

import os
from pathlib import Path

from benchmarks.fusion.frequencies import print_frequencies
from benchmarks.fusion.measured import measure
from benchmarks.fusion.shared import print_shared
from benchmarks.index.measuring import measure_survey
from benchmarks.index.report import print_report
from benchmarks.index.survey import SCALES, simulated

_SIZES = "FLANEUR_INDEX_IMAGES"


def run(data: Path) -> None:
    """Measure the word use of real images, and simulate surveys of this use."""
    wanted = os.environ.get(_SIZES, str(SCALES[0].n_images)).split(",")
    scales = [scale for scale in SCALES if str(scale.n_images) in wanted]
    measured = []
    uses = measure(data, [scale.measured_words for scale in scales])
    for scale, channels in zip(scales, uses, strict=True):
        print_frequencies(channels)
        print()
        print_shared(channels, scale.n_words)
        print(flush=True)
        measured.append(measure_survey(simulated(scale, channels), scale.has_peer))
        print_report(measured)
        print(flush=True)
