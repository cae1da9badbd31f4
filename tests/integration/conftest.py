"""Indices for tests of what becomes of them."""

import shutil
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import pytest
from index_shop import CONFIG as SHOP_CONFIG
from index_shop import Shop
from living_index import BARS, DEGREES, REMOVED, Life, add, index_first, remove
from PIL import Image

from contracts.config import IndexConfig
from coordinator.compacting import compact
from coordinator.engine.running import Engine
from index.opened import OpenedIndex


@pytest.fixture(scope="session")
def other_survey(small_survey: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five more images, of the same street, in degrees."""
    folder = tmp_path_factory.mktemp("other")
    lines = ["file,lon,lat"]
    for number in range(5):
        picture = Image.open(small_survey / f"{number:02d}.jpg")
        picture.transpose(Image.Transpose.FLIP_LEFT_RIGHT).save(folder / f"{number}.jpg")
        lines.append(f"{number}.jpg,{2.3450 + number * 1e-4:.4f},48.8570")
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture(scope="session")
def life(
    small_survey: Path,
    other_survey: Path,
    tmp_path_factory: pytest.TempPathFactory,
    engine: Engine,
) -> Life:
    root = tmp_path_factory.mktemp("life") / "index"
    whole = index_first(small_survey, root, engine)
    more = add(root, "", small_survey, engine)
    other = add(root, "b", other_survey, engine, DEGREES)
    remove(root, *REMOVED)
    return Life(root, whole, more, other, compact(root, nullcontext(engine), BARS))


@pytest.fixture
def same_engine(engine: Engine, monkeypatch: pytest.MonkeyPatch) -> None:
    """All commands use the tests' engine; asking a broker who listens takes two seconds."""
    monkeypatch.setattr(
        "coordinator.engine.running.running_engine", lambda *_, **__: nullcontext(engine)
    )


@pytest.fixture(scope="session")
def original(indexed: Callable[[IndexConfig], OpenedIndex]) -> Path:
    return indexed(SHOP_CONFIG).root


@pytest.fixture
def shop(original: Path, tmp_path: Path, same_engine: None) -> Shop:
    return Shop(Path(shutil.copytree(original, tmp_path / "index")))
