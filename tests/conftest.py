"""What many tests need: real data where it is, a small survey, a running engine."""

import os
import signal
import uuid
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from store_address import store_environment

from workers.run import worker_environment

os.environ.update(worker_environment())  # before numba is imported: one cache with the workers'
os.environ.update(store_environment())  # before workers are started: they read there as well

import numpy as np
import pytest
from PIL import Image

from contracts.config import IndexConfig
from coordinator.cli.show import Bars
from coordinator.engine.running import Engine, running_engine
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from index.opened import OpenedIndex
from survey import ReadOptions

if TYPE_CHECKING:
    from object_store import Bucket, Server

REPOSITORY = Path(__file__).parents[1]

# A shell ignores Ctrl-C for what it starts in the background, and so would the commands tested.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def test_data() -> Path:
    """The folder of real images, or a skip that says where it was looked for."""
    folder = Path(os.environ.get("FLANEUR_TEST_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real images at {folder}; set FLANEUR_TEST_DATA")
    return folder


@pytest.fixture(scope="session")
def small_survey(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten posed images of random rectangles, 4 m apart along a street in Lambert-93."""
    folder = tmp_path_factory.mktemp("survey")
    lines = ["file,x,y,z,heading,pitch,roll,time"]
    for number in range(10):
        Image.fromarray(rectangles(number)).save(folder / f"{number:02d}.jpg", quality=92)
        place = f"{652000 + 4 * number},6862000,40,90,0,0"
        lines.append(f"{number:02d}.jpg,{place},2020-05-01T10:00:{number:02d}Z")
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    return folder


def rectangles(seed: int, width: int = 320, height: int = 240) -> np.ndarray:
    """A picture of 150 random rectangles: enough for every detector to find something."""
    rng = np.random.default_rng(seed)
    picture = np.full((height, width, 3), 128, dtype=np.uint8)
    for _ in range(150):
        x, y = rng.integers(0, width - 8), rng.integers(0, height - 8)
        w, h = rng.integers(6, 50, 2)
        picture[y : y + h, x : x + w] = rng.integers(0, 256, 3)
    return picture


@pytest.fixture(scope="session")
def engine() -> Iterator[Engine]:
    """A real server and two real worker processes."""
    with running_engine(None, 2) as running:
        yield running


@pytest.fixture(scope="session")
def indexed(
    small_survey: Path, tmp_path_factory: pytest.TempPathFactory, engine: Engine
) -> Callable[[IndexConfig], OpenedIndex]:
    """Index the small survey by a configuration, in a folder of its own."""

    def made(config: IndexConfig) -> OpenedIndex:
        root = tmp_path_factory.mktemp("index")
        intake = read_surveys([("", small_survey)], ReadOptions(crs="EPSG:2154"))
        job, plan = make_plan(root, intake, config, 4)
        run_job(job, plan, intake, nullcontext(engine), Bars(None))
        return OpenedIndex(root)

    return made


@pytest.fixture(scope="session")
def store() -> "Iterator[Server]":
    """A real server that speaks S3."""
    from object_store import serving  # moto takes a second to import

    with serving(os.environ["AWS_ENDPOINT_URL"]) as server:
        yield server


@pytest.fixture
def bucket(store: "Server") -> "Bucket":
    """An empty bucket of its own."""
    from object_store import new_bucket

    return new_bucket(f"town-{uuid.uuid4().hex[:12]}")
