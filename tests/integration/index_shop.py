"""An index, and the `flaneur` command to work on it."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig
from coordinator.cli import main

CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff",), descriptors=("sift",), max_frames=60),
    codebooks=CodebookConfig(max_words=100),
)
OPTIONS = (
    *("--crs", "EPSG:2154", "--detectors", "hesaff", "--descriptors", "sift"),
    *("--max-frames", "60", "--max-words", "100"),
)


@dataclass(frozen=True)
class Shop:
    """An index of the small survey's ten images, and the command to work on it."""

    root: Path

    def say(self, verb: str, *arguments: str | Path) -> tuple[int, str]:
        """Exit code and what a person reads."""
        answer = CliRunner().invoke(main, [verb, *map(str, arguments)])
        assert answer.exception is None or isinstance(answer.exception, SystemExit)
        return answer.exit_code, answer.stderr

    def ask(self, verb: str, *arguments: str | Path) -> dict[str, Any]:
        """What a program reads."""
        answer = CliRunner().invoke(main, [verb, *map(str, arguments), "--json"])
        assert answer.exit_code == 0, answer.stderr
        return dict(json.loads(answer.stdout))
