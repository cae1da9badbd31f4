"""A small index that a search in this process can open."""

from collections.abc import Callable

import pytest

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig
from index.opened import OpenedIndex

CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff", "mser", "star"), max_frames=100),
    codebooks=CodebookConfig(max_words=60),
)


@pytest.fixture(scope="session")
def small_index(indexed: Callable[[IndexConfig], OpenedIndex]) -> OpenedIndex:
    """The small survey, by three detectors and all descriptors."""
    return indexed(CONFIG)
