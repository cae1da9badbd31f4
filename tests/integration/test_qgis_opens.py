"""Results of a real search, opened and drawn by real QGIS."""

import base64
import io
import json
import os
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig, SearchConfig
from coordinator.engine.running import Engine
from coordinator.export.geopackage import write_geopackage
from coordinator.export.geopackage.layers import LAYERS
from coordinator.querying import Located, locate_photos
from index.opened import OpenedIndex

QGIS_PYTHON = Path("/usr/bin/python3")
CONFIG = IndexConfig(
    features=FeatureConfig(max_frames=120), codebooks=CodebookConfig(max_words=200)
)
BEST, SECOND, NUMBER = (179, 0, 0), (227, 74, 51), (255, 255, 255)
ESTIMATE = (8, 60, 140)


@pytest.fixture(scope="module")
def index(request: pytest.FixtureRequest) -> OpenedIndex:
    """The small survey, indexed if QGIS is here to look at what is found in it."""
    probe = [QGIS_PYTHON, "-c", "import qgis.core"]
    if not QGIS_PYTHON.exists() or subprocess.run(probe, capture_output=True).returncode:
        pytest.skip("no QGIS with Python (python3-qgis) for /usr/bin/python3")
    opened: OpenedIndex = request.getfixturevalue("indexed")(CONFIG)
    return opened


@pytest.fixture(scope="module")
def answers(index: OpenedIndex, small_survey: Path, engine: Engine) -> list[Located]:
    """Eight photos of the small survey located in it, and one that is not there."""
    names = [*(f"{number:02d}.jpg" for number in range(1, 9)), "gone.jpg"]
    photos = [str(small_survey / name) for name in names]
    return list(locate_photos(index, photos, SearchConfig(), engine.follower, lambda: None))


@pytest.fixture(scope="module")
def results(
    index: OpenedIndex, answers: list[Located], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """One photo found, and one that is not there."""
    out = tmp_path_factory.mktemp("qgis") / "results.gpkg"
    write_geopackage(out, [answers[3], answers[-1]], index)
    return out


@pytest.fixture(scope="module")
def crowd(
    index: OpenedIndex, answers: list[Located], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """All photos in one file."""
    out = tmp_path_factory.mktemp("qgis") / "crowd.gpkg"
    write_geopackage(out, answers, index)
    return out


@dataclass(frozen=True)
class Map:
    """What QGIS found in a file, and the picture it drew, (h, w, 3)."""

    layers: dict[str, dict[str, Any]]
    errors: list[str]
    picture: np.ndarray


@pytest.fixture(scope="module")
def maps(results: Path, crowd: Path) -> dict[str, Map]:
    """Maps drawn in one session of QGIS."""
    middle, north = 652000 + 18, 6862000
    far = [middle - 2000, north - 1500, middle + 2000, north + 1500]
    near = [middle - 40, north - 30, middle + 40, north + 30]
    wanted = {
        "all": (results, [layer.name for layer in LAYERS], []),
        "views": (results, ["views"], near),
        "one far": (results, ["matches"], far),
        "one near": (results, ["matches"], near),
        "many far": (crowd, ["matches"], far),
        "many near": (crowd, ["matches"], near),
    }
    pictures = {name: results.with_name(f"{name}.png") for name in wanted}
    jobs = [
        {"file": str(file), "layers": layers, "extent": extent, "picture": str(pictures[name])}
        for name, (file, layers, extent) in wanted.items()
    ]
    said = subprocess.run(
        [QGIS_PYTHON, Path(__file__).with_name("qgis_session.py"), json.dumps(jobs)],
        capture_output=True,
        text=True,
        timeout=120,
        env={
            "PATH": os.environ["PATH"],
            "QT_QPA_PLATFORM": "offscreen",
            "HOME": str(results.parent),
            "XDG_RUNTIME_DIR": str(results.parent),
            "LC_ALL": "C.UTF-8",
        },
    )
    assert said.returncode == 0, said.stderr
    told = json.loads(said.stdout.splitlines()[-1])
    drawn = {}
    for name, found in zip(wanted, told, strict=True):
        with Image.open(pictures[name]) as picture:
            drawn[name] = Map(found["layers"], found["errors"], np.asarray(picture.convert("RGB")))
    return drawn


def count(picture: np.ndarray, rgb: tuple[int, int, int]) -> int:
    return int((picture == rgb).all(axis=2).sum())


def test_qgis_opens_every_layer_with_its_style(maps: dict[str, Map]) -> None:
    found = maps["all"]
    assert found.errors == []
    for layer in LAYERS:
        opened = found.layers[layer.name]
        assert opened["valid"], layer.name
        assert opened["styled"], layer.name
        assert opened["crs"] == "EPSG:2154"
        assert opened["aliases"] == ["fid", *(column.alias for column in layer.columns)]
    assert found.layers["matches"]["renderer"] == "graduatedSymbol"
    assert found.layers["matches"]["count"] == 10
    assert found.layers["queries"]["labels"]


def test_ranks_and_estimates_differ_by_colour(maps: dict[str, Map]) -> None:
    for colour in (BEST, SECOND, NUMBER, ESTIMATE):
        assert count(maps["all"].picture, colour) > 30, colour


def test_map_tips_show_the_picture_and_the_name(maps: dict[str, Map]) -> None:
    for name, text in (("queries", "04.jpg"), ("matches", "rank 1 for 04.jpg")):
        tip = maps["all"].layers[name]["tip"]
        assert text in tip
        assert "[%" not in tip
        data = re.search(r'src="data:image/jpeg;base64,([^"]+)"', tip)
        assert data is not None
        with Image.open(io.BytesIO(base64.b64decode(data[1]))) as picture:
            assert picture.size == (200, 150)


def test_views_look_the_way_the_cameras_did(maps: dict[str, Map]) -> None:
    # The cameras stand along northing 6862000, from 652000 to 652036, and look to grid east;
    # the map is 80 m wide, from 651978.
    drawn = (maps["views"].picture != 255).any(axis=2)
    rows, columns = np.nonzero(drawn)
    assert rows.mean() == pytest.approx(drawn.shape[0] / 2, abs=3)
    pixels_a_metre = drawn.shape[1] / 80
    assert columns.min() == pytest.approx((652000 - 651978) * pixels_a_metre, abs=4)
    assert columns.max() == drawn.shape[1] - 1  # the easternmost looks beyond the edge


def test_one_photo_has_numbered_marks_on_any_map_and_many_photos_on_near_ones(
    maps: dict[str, Map],
) -> None:
    heights = {}
    for name in ("one far", "one near", "many far", "many near"):
        drawn = np.flatnonzero((maps[name].picture != 255).any(axis=2).any(axis=1))
        heights[name] = drawn.max() - drawn.min() + 1
    assert heights["one far"] == heights["one near"] == heights["many near"]
    assert heights["many far"] < 0.6 * heights["many near"]
