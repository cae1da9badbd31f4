"""An index that has lived through everything, and ways to change such a one."""

import shutil
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig, Where
from coordinator.adding import find_new, plan_addition, run_addition
from coordinator.cli.show import Bars
from coordinator.compacting import CompactReport
from coordinator.engine.running import Engine
from coordinator.indexing import IndexReport, run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from coordinator.removing import remove_images
from index.commits import roll_back
from index.manifest import Generation
from index.opened import OpenedIndex
from survey import ReadOptions

CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff",), descriptors=("sift", "surf"), max_frames=60),
    codebooks=CodebookConfig(max_words=150),
)
CHANNELS = CONFIG.features.channels()
LAMBERT_93 = ReadOptions(crs="EPSG:2154")
DEGREES = ReadOptions(derive_headings=False)  # which depend on the images beside
FIRST = ReadOptions(crs="EPSG:2154", include=("0[0-5].jpg",))
REMOVED = ("01.jpg", "08.jpg", "b/2.jpg")
BARS = Bars(None)


@dataclass(frozen=True)
class Life:
    """An index of which every generation is kept: 1 index, 2 and 3 add, 4 remove, 5 compact."""

    root: Path
    whole: IndexReport
    more: IndexReport
    other: IndexReport
    compacted: CompactReport

    def opened(self, number: int) -> OpenedIndex:
        return OpenedIndex(self.root, number)


def index_first(survey: Path, root: Path, engine: Engine) -> IndexReport:
    intake = read_surveys([("", survey)], FIRST)
    job, plan = make_plan(root, intake, CONFIG, 4)
    return run_job(job, plan, intake, nullcontext(engine), BARS)


def add(
    root: Path, name: str, path: Path, engine: Engine, options: ReadOptions = LAMBERT_93
) -> IndexReport:
    opened = OpenedIndex(root)
    intake = find_new(opened, name, path, options).intake
    job, plan = plan_addition(opened, intake, 3)
    return run_addition(job, plan, intake, nullcontext(engine), BARS)


def remove(root: Path, *uris: str) -> Generation:
    removal = remove_images(root, Where(), uris, (), BARS)
    assert removal.generation is not None
    return removal.generation


def contents(index: OpenedIndex) -> dict[str, bytes]:
    """The bytes of the only segment and its catalogue, without its name."""
    (segment,) = index.generation.segments
    folder = index.root / "segments" / segment.name
    files = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*.npy")}
    files["catalogue"] = index.root / "catalogue" / f"{segment.name}.parquet"
    return {name: path.read_bytes() for name, path in files.items()}


def grown(life: Life, tmp_path: Path, number: int) -> Path:
    """A copy of the index as it was at a generation."""
    root = tmp_path / "index"
    shutil.copytree(life.root, root)
    for later in range(number + 1, 6):
        (root / "generations" / f"{later:06d}.json").unlink()
    roll_back(root, number)
    return root
