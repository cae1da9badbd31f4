"""Fusion of a pair at 7,000 and 1,000,000 images, beside sparse matrix products."""

import tempfile
from pathlib import Path

from benchmarks.fusion import measured, speed


def run(data: Path) -> None:
    """Measure how real photos use the words of a real index, and time fusion on such postings."""
    with tempfile.TemporaryDirectory() as scratch:
        channels = measured.measure(data, Path(scratch))
    measured.print_frequencies(channels)
    speed.run(channels)
