"""Generations that name no files."""

from contracts.config import IndexConfig
from index.manifest import Generation


def a_generation(number: int = 1) -> Generation:
    config = IndexConfig()
    return Generation(
        number=number,
        made_by="index",
        created_at="2026-01-01T00:00:00+00:00",
        config=config,
        config_digest=config.digest(),
        crs="EPSG:2154",
        codebooks="0001",
        codebooks_digest="0" * 16,
        segments=(),
        files={},
    )
