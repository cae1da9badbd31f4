"""A survey indexed with the words of another has the same words, and trains none."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig, SearchConfig
from coordinator.cli import main
from coordinator.engine.running import Engine
from coordinator.querying import locate_photos
from index.opened import OpenedIndex

CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff", "orb"), max_frames=60),
    codebooks=CodebookConfig(max_words=100),
)
LAMBERT_93 = ("--crs", "EPSG:2154")


@pytest.fixture(scope="module")
def first(indexed: Callable[[IndexConfig], OpenedIndex]) -> OpenedIndex:
    return indexed(CONFIG)


@pytest.fixture(scope="module")
def other_survey(small_survey: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three of the images, elsewhere."""
    folder = tmp_path_factory.mktemp("other")
    lines = (small_survey / "poses.csv").read_text().splitlines()
    (folder / "poses.csv").write_text("\n".join([lines[0], *lines[3:6]]) + "\n")
    for line in lines[3:6]:
        name = line.split(",")[0]
        shutil.copy(small_survey / name, folder / name)
    return folder


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(each) for each in arguments])


def words_of(root: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in root.glob("codebooks/*/*")}


def test_another_survey_is_indexed_with_words_that_are_there(
    first: OpenedIndex, other_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    broker = ("--broker", engine.app.conf.broker_url)
    words, root = tmp_path / "words", tmp_path / "index"
    assert run("codebook", "import", first.root, words).exit_code == 0
    shown = run("codebook", "show", words)
    assert first.generation.codebooks_digest in shown.stdout
    assert f"from {first.root}, generation 1" in shown.stdout

    told = run("index", other_survey, root, *LAMBERT_93, "--codebooks", words, *broker)
    assert told.exit_code == 0, told.output
    assert "extract: done" in told.output
    assert "train" not in told.output
    assert words_of(root) == words_of(first.root)
    opened = OpenedIndex(root)
    assert opened.generation.codebooks_digest == first.generation.codebooks_digest
    assert opened.config == first.config

    photo = str(other_survey / "03.jpg")
    (located,) = locate_photos(opened, [photo], SearchConfig(), engine.follower, lambda: None)
    assert located.of_kind("match")[0]["properties"]["image"] == "03.jpg"
    assert run("verify", root, "--all").exit_code == 0

    again = run("index", other_survey, root, *LAMBERT_93, "--codebooks", first.root, "--json")
    assert again.exit_code == 0, again.output
    assert json.loads(again.stdout)["extracted_now"] == 0
    assert len(list((root / "codebooks").iterdir())) == 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--detectors", "hesaff,mser"), "--detectors: the words of --codebooks are not for mser"),
        (("--max-frames", "50"), "are for 60 frames of hesaff an image, not 50"),
        (("--max-words", "9"), "--max-words and --seed are for training words"),
        (("--seed", "0"), "--max-words and --seed are for training words"),
    ],
)
def test_words_for_something_else_are_refused_before_any_work(
    first: OpenedIndex, other_survey: Path, tmp_path: Path, options: tuple[str, ...], said: str
) -> None:
    root = tmp_path / "index"
    told = run("index", other_survey, root, *LAMBERT_93, "--codebooks", first.root, *options)
    assert told.exit_code == 2
    assert said in told.output
    assert not root.exists()


def test_damaged_words_are_refused_by_name_and_nothing_is_begun(
    first: OpenedIndex, other_survey: Path, tmp_path: Path
) -> None:
    source = Path(shutil.copytree(first.root, tmp_path / "source"))
    (damaged,) = source.glob("codebooks/*/orb-sc.npy")
    damaged.write_bytes(damaged.read_bytes()[:-1] + b"\xff")
    told = run("index", other_survey, tmp_path / "i", *LAMBERT_93, "--codebooks", source)
    assert told.exit_code == 2
    assert f"{damaged} is not the file that was written" in told.output
    assert not (tmp_path / "i").exists()
    verified = run("verify", source)
    assert verified.exit_code == 2
    assert f"{damaged} has the sha256" in verified.output
