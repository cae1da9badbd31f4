"""A small index that a search in this process can open."""

from contextlib import nullcontext
from pathlib import Path

import pytest

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig
from coordinator.cli.show import Bars
from coordinator.engine import Engine
from coordinator.indexing import run_job
from coordinator.plan import make_plan, read_surveys
from index.opened import OpenedIndex
from survey import ReadOptions

CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff", "mser", "star"), max_frames=100),
    codebooks=CodebookConfig(max_words=60),
)


@pytest.fixture(scope="session")
def small_index(
    small_survey: Path, tmp_path_factory: pytest.TempPathFactory, engine: Engine
) -> OpenedIndex:
    """The small survey, by three detectors and all descriptors."""
    root = tmp_path_factory.mktemp("small-index")
    intake = read_surveys([("", small_survey)], ReadOptions(crs="EPSG:2154"))
    job, plan = make_plan(root, intake, CONFIG, 4)
    run_job(job, plan, intake, nullcontext(engine), Bars(None))
    return OpenedIndex(root)
