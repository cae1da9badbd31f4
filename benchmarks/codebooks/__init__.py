"""Large codebooks: how fast and how well words are found, made and opened, beside faiss.

`FLANEUR_BENCH_WORDS=10000,100000,1000000` chooses the sizes; a million words take an hour.
"""

import os
from pathlib import Path

from benchmarks.codebooks.points import described_points
from benchmarks.codebooks.sizes import print_sizes

_SIZES = "10000,100000"


def run(data: Path) -> None:
    """Print the table of sizes for every descriptor."""
    sizes = [int(size) for size in os.environ.get("FLANEUR_BENCH_WORDS", _SIZES).split(",")]
    print_sizes(described_points(data), sizes)
