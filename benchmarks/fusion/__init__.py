"""Fusion of a pair at 7,000 and 1,000,000 images, beside sparse matrix products."""

from pathlib import Path

from benchmarks.fusion import speed
from benchmarks.fusion.frequencies import print_frequencies
from benchmarks.fusion.measured import measure
from benchmarks.fusion.shared import print_shared


def run(data: Path) -> None:
    """Measure how real photos use the words of a real index, and time fusion on such postings."""
    measured = measure(data, [size.measured_words for size in speed.SIZES])
    for size, channels in zip(speed.SIZES, measured, strict=True):
        print_frequencies(channels)
        print()
        print_shared(channels, size.n_words)
        speed.run(size, channels)
