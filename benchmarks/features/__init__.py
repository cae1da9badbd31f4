"""Features against ground truth and against programs that no one here wrote."""

import sys
from pathlib import Path


def run(data: Path) -> None:
    """Print all tables; peers are an extra."""
    try:
        from benchmarks.features import counts, memory, peers, quality, speed
    except ModuleNotFoundError as error:
        sys.exit(f"{error}. The peers are an extra: pip install -e '.[peers]'")
    for title, part in (
        ("Quality", quality),
        ("Peers", peers),
        ("Frames of old photographs", counts),
        ("Speed", speed),
        ("Memory", memory),
    ):
        print(f"\n## {title}\n")
        part.run(data)
