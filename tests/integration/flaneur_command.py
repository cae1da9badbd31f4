"""The `flaneur` command in a process of its own, as a user runs it."""

import os
import subprocess
import sys
from pathlib import Path

FLANEUR = (sys.executable, "-m", "coordinator.cli")


def run(
    *arguments: str | Path, folder: Path | None = None, **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run to the end, for two minutes at most: a hang fails."""
    return subprocess.run(
        [*FLANEUR, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), **environment},
    )
