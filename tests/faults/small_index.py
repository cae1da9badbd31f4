"""A small index at every point of its life, made in this process by the workers' own stages."""

import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig, Where
from contracts.records import Receipt
from coordinator.adding import plan_addition, run_addition
from coordinator.compacting import compact
from coordinator.engine.running import Engine
from coordinator.following.events import Order
from coordinator.following.flow import Outcome
from coordinator.indexing import run_job
from coordinator.intake import Intake, read_surveys
from coordinator.plan import make_plan
from coordinator.pruning import prune
from coordinator.removing import remove_images
from index.commits import roll_back
from index.files import sha256_of
from index.jobs import JobFolder
from index.opened import OpenedIndex
from survey import ReadOptions
from workers.app import make_app
from workers.stages.assign import assign_shard
from workers.stages.extract import extract_shard
from workers.stages.join import join_channel
from workers.stages.merge import merge_words
from workers.stages.train import train_channel

CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("hesaff",), descriptors=("sift",), max_frames=60),
    codebooks=CodebookConfig(codebook_ratio=0.8, max_words=120),
)
CHANNEL = "hesaff-sift"
NOBODY = make_app("redis+socket:///nobody/listens")
Change = Callable[[Path], object]


class Silent:
    """Nobody watches."""

    def begin(self, stage: str, total: int, done: int) -> None: ...
    def advance(self, stage: str) -> None: ...


class _Reached(Exception):
    """The stage before which the work was to end."""


@dataclass(frozen=True, slots=True)
class Here:
    """Does the tasks of a job in this process, up to the stage `before`."""

    before: str = ""
    run_id: str = "here"

    def heeding(self, *_: object) -> "Here":
        return self

    def outcomes(self, orders: Iterable[Order | None]) -> Iterator[Outcome]:
        for order in orders:
            if order is not None:
                if order.name == self.before:
                    raise _Reached
                receipt = _do(order.name, order.message)
                yield Outcome(order, {"counts": receipt.counts, "anew": True}, None)

    def engine(self) -> nullcontext[Engine]:
        return nullcontext(Engine(NOBODY, self, 1))


def _do(name: str, message: dict[str, Any]) -> Receipt:
    job, channel = JobFolder(Path(message["index"]), message["job"]), message.get("channel", "")
    if name == "extract":
        return extract_shard(job, message["shard"], str)
    if name == "train":
        return train_channel(job, channel)
    if name == "assign":
        return assign_shard(job, message["shard"], message["first_image_id"])
    if name == "merge":
        words = range(message["first_word"], message["stop_word"])
        return merge_words(job, channel, words, message["n_images"])
    return join_channel(job, channel, message["first_words"], message["n_images"])


def read(survey: Path, name: str = "") -> Intake:
    return read_surveys([(name, survey)], ReadOptions(crs="EPSG:2154"))


def index_survey(root: Path, intake: Intake, here: Here = Here()) -> None:
    """`flaneur index`."""
    job, plan = make_plan(root, intake, CONFIG, 2)
    run_job(job, plan, intake, here.engine(), Silent())


def add_survey(root: Path, intake: Intake, here: Here = Here()) -> None:
    """`flaneur add`; run again, there is nothing to add."""
    index = OpenedIndex(root)
    if intake.images[0].uri not in index.catalogue.column("uri"):
        job, plan = plan_addition(index, intake, 2)
        run_addition(job, plan, intake, here.engine(), Silent())


def remove_two(root: Path) -> None:
    """`flaneur remove` of an image of each survey; run again, there is nothing to remove."""
    if OpenedIndex(root).kept is None:
        remove_images(root, Where(), ("01.jpg", "later/03.jpg"), (), Silent())


def compact_all(root: Path) -> None:
    """`flaneur compact`."""
    compact(root, Here().engine(), Silent())


def go_back(root: Path) -> None:
    """`flaneur rollback --to 2`."""
    roll_back(root, 2)


@contextmanager
def folder_in_memory() -> Iterator[Path]:
    """Where hundreds of copies cost little; on the disk where the system has no such place."""
    memory = Path("/dev/shm")  # noqa: S108 - the name is not guessable
    place = memory if os.access(memory, os.W_OK) else None
    with tempfile.TemporaryDirectory(dir=place, prefix="flaneur-faults-") as folder:
        yield Path(folder)


def picture(seed: int) -> NDArray[np.uint8]:
    """Random rectangles: enough for a detector to find something."""
    rng = np.random.default_rng(seed)
    pixels = np.full((120, 160, 3), 128, dtype=np.uint8)
    for _ in range(150):
        x, y, width, height = rng.integers((0, 0, 6, 6), (152, 112, 50, 50))
        pixels[y : y + height, x : x + width] = rng.integers(0, 256, 3)
    return pixels


def make_surveys(folder: Path) -> tuple[Path, Path]:
    """A survey of three images, and a later one of two further down the street."""
    surveys = folder / "survey", folder / "later"
    for survey, numbers in zip(surveys, (range(3), range(3, 5)), strict=True):
        survey.mkdir()
        lines = ["file,x,y,z,heading,pitch,roll,time"]
        for number in numbers:
            Image.fromarray(picture(number)).save(survey / f"{number:02d}.jpg", quality=92)
            place = f"{652000 + 4 * number},6862000,40,90,0,0"
            lines.append(f"{number:02d}.jpg,{place},2020-05-01T10:00:{number:02d}Z")
        (survey / "poses.csv").write_text("\n".join(lines) + "\n")
    return surveys


@dataclass(frozen=True, slots=True)
class Chapter:
    """One change in the life of an index. before : the index before it. change : again and again.

    after : what the index holds once it is made. files : that are there then.
    tidies : whether the change is about what is there.
    """

    before: Path
    change: Change
    after: "Contents"
    files: frozenset[str]
    tidies: bool = False


@dataclass(frozen=True, slots=True)
class Contents:
    """What an index holds, whatever its generations are called and when they were made.

    segments : names, sizes and numbers of images. digests : of every file, by its name.
    """

    segments: tuple[tuple[object, ...], ...]
    digests: tuple[tuple[str, str], ...]


def contents(root: Path) -> Contents:
    """What the live generation holds; every file is what was written.

    Raises
    ------
    AssertionError : a file is not.
    """
    generation = OpenedIndex(root).generation
    for name, entry in generation.files.items():
        assert sha256_of(root / name) == entry.sha256, name
    digests = {
        re.sub(r"^tombstones/\d+", "tombstones", name): entry.sha256
        for name, entry in generation.files.items()
    }
    segments = tuple(
        (segment.name, segment.n_images, segment.n_removed, segment.n_postings)
        for segment in generation.segments
    )
    return Contents(segments, tuple(sorted(digests.items())))


def life(folder: Path, surveys: tuple[Path, Path]) -> dict[str, Chapter]:
    """Take an index through all changes, keeping it as it was before each."""
    root = folder / "life"
    survey, later = read(surveys[0]), read(surveys[1], "later")
    with suppress(_Reached):
        index_survey(root, survey, Here(before="merge"))
    chapters = {"index": _chapter(root, folder / "1", partial(index_survey, intake=survey))}
    with suppress(_Reached):
        add_survey(root, later, Here(before="merge"))
    chapters["add"] = _chapter(root, folder / "2", partial(add_survey, intake=later))
    chapters["remove"] = _chapter(root, folder / "3", remove_two)
    chapters["compact"] = _chapter(root, folder / "4", compact_all)
    chapters["rollback"] = _chapter(root, folder / "5", go_back)
    roll_back(root, 4)
    chapters["prune"] = replace(_chapter(root, folder / "6", prune), tidies=True)
    return chapters


def _chapter(root: Path, before: Path, change: Change) -> Chapter:
    shutil.copytree(root, before)
    change(root)
    return Chapter(before, change, contents(root), files_in(root))


def files_in(root: Path) -> frozenset[str]:
    """The names of all files that are there."""
    names = (path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file())
    return frozenset(names)
