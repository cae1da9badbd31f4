"""`python -m benchmarks [NAME...]`: run them; by default all that print figures."""

import os
import sys
from pathlib import Path

from benchmarks import default_model, features, kth, stereopolis, workers

FIGURES = {"stereopolis": stereopolis.run, "kth": kth.run, "workers": workers.run}
BENCHMARKS = {**FIGURES, "features": features.run, "default-model": default_model.run}


def main() -> None:
    data = Path(os.environ.get("FLANEUR_TEST_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not data.is_dir():
        sys.exit(f"No real images at {data}; set FLANEUR_TEST_DATA.")
    for name in sys.argv[1:] or FIGURES:
        print(f"\n## {name}\n")
        BENCHMARKS[name](data)


if __name__ == "__main__":
    main()
