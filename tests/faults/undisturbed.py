"""The survey that is indexed under faults, and what an index of it is when nothing happens."""

from dataclasses import dataclass, field
from pathlib import Path

from PIL import Image
from small_index import Contents, Here, Silent, contents, picture, read

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig
from coordinator.indexing import run_job
from coordinator.plan import make_plan

N_IMAGES = 24
SHARD_SIZE = 2
CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff", "mser"), descriptors=("sift",), max_frames=60),
    codebooks=CodebookConfig(max_words=60),
)
OPTIONS = (
    *("--crs", "EPSG:2154", "--shard-size", str(SHARD_SIZE), "--max-frames", "60"),
    *("--detectors", "hesaff,mser", "--descriptors", "sift", "--max-words", "60"),
)
"""The same, said to `flaneur index`."""


def name_of(number: int) -> str:
    return f"{number:02d}.jpg"


@dataclass(slots=True)
class Undisturbed:
    """A survey of random rectangles along a street, 4 m apart, and what indices of it hold."""

    folder: Path
    _known: dict[tuple[int, ...], Contents] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.survey.mkdir(parents=True)
        for number in range(N_IMAGES):
            Image.fromarray(picture(number)).save(self.survey / name_of(number), quality=92)
        self._write_table(())

    @property
    def survey(self) -> Path:
        return self.folder / "survey"

    def contents(self, without: tuple[int, ...] = ()) -> Contents:
        """What an index holds, made in this process, if some images had never been there."""
        if without not in self._known:
            self._write_table(without)
            root = self.folder / "-".join(["index", *map(str, without)])
            intake = read(self.survey)
            job, plan = make_plan(root, intake, CONFIG, SHARD_SIZE + 1)
            run_job(job, plan, intake, Here().engine(), Silent())
            self._known[without] = contents(root)
            self._write_table(())
        return self._known[without]

    def _write_table(self, without: tuple[int, ...]) -> None:
        lines = ["file,x,y,z,heading,pitch,roll,time"]
        for number in sorted(set(range(N_IMAGES)) - set(without)):
            place = f"{652000 + 4 * number},6862000,40,90,0,0"
            lines.append(f"{name_of(number)},{place},2020-05-01T10:00:{number:02d}Z")
        (self.survey / "poses.csv").write_text("\n".join(lines) + "\n")
