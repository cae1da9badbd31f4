"""`python -m benchmarks [NAME...]`: run them; by default all that print figures."""

import os
import sys
from pathlib import Path

from benchmarks import (
    codebooks,
    complementarity,
    features,
    fusion,
    index,
    kth,
    mcap,
    planned,
    pooled,
    poses,
    postings,
    queue,
    scaling,
    stereopolis,
)
from benchmarks.flow import run as flow
from benchmarks.placing import run as placing
from benchmarks.sets import run as sets

FIGURES = {"stereopolis": stereopolis.run, "kth": kth.run}
BENCHMARKS = {
    **FIGURES,
    "features": features.run,
    "fusion": fusion.run,
    "complementarity": complementarity.run,
    "pooled": pooled.run,
    "poses": poses.run,
    "mcap": mcap.run,
    "sets": sets.run,
    "placing": placing.run,
    "codebooks": codebooks.run,
    "postings": postings.run,
    "index": index.run,
    "planned": planned.run,
    "scaling": scaling.run,
    "flow": flow.run,
    "queue": queue.run,
}


def main() -> None:
    data = Path(os.environ.get("FLANEUR_TEST_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not data.is_dir():
        sys.exit(f"No real images at {data}; set FLANEUR_TEST_DATA.")
    unknown = [name for name in sys.argv[1:] if name not in BENCHMARKS]
    if unknown:
        sys.exit(f"No benchmark {', '.join(unknown)}; there are {', '.join(BENCHMARKS)}.")
    for name in sys.argv[1:] or FIGURES:
        print(f"\n## {name}\n")
        BENCHMARKS[name](data)


if __name__ == "__main__":
    main()
