"""A job's folder inside an index: its plan, its receipts, and what it has made so far.

What remains to be done is derived from here and never from a queue. A receipt counts only while
the files it names still have the digests it names.
"""

import hashlib
import json
import re
import shutil
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from contracts.config import IndexConfig
from contracts.errors import BadIndex, TaskFailed
from contracts.faults import first_fault
from contracts.records import PosedImage, Receipt
from index.files import is_inside, is_shown, read_text_file, sha256_of, write_bytes
from index.manifest import Name

SCRATCH = ("features", "partials", "pieces", "ids")
"""Folders of a job that nobody needs once it is committed."""

SHOWN_S = 60.0
"""How long a shared folder may take to show what another machine has written."""
_LOOK_S = 0.5
_JOB_ID = re.compile(r"[0-9a-f]{16}")
_WRITERS = 16
"""Shards' lists that are written at a time."""
_MAX_LIST_BYTES = 2**28
"""Of a plan or a shard's list: some half a million images."""

Parsed = TypeVar("Parsed")
Verb = Literal["index", "add", "compact"]
_RECEIPT = TypeAdapter(Receipt)
_REASONS = TypeAdapter(dict[int, str])
_IMAGES = TypeAdapter(list[PosedImage])


class JobPlan(BaseModel):
    """What a job is to do; written once, before any task is sent."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    job: str
    verb: Verb
    config: IndexConfig
    config_digest: str
    segment: Name
    codebooks: Name
    """Where its words are."""
    trains: bool
    """Whether the job makes these words; otherwise they are there before it begins."""
    compacts: tuple[Name, ...] = ()
    """Segments whose live images become one segment; then there are no shards."""
    n_images: int
    shard_size: int
    n_shards: int


@dataclass(frozen=True, slots=True)
class IndexedImage:
    """What extraction found out about one readable image. row : its place in the shard."""

    row: int
    sha256: str
    width_px: int
    height_px: int


_INDEXED = TypeAdapter(list[IndexedImage])


@dataclass(frozen=True, slots=True)
class JobFolder:
    """Names everything in `INDEX/jobs/<id>`; `root` is the index."""

    root: Path
    job: str

    def __post_init__(self) -> None:
        if not _JOB_ID.fullmatch(self.job):
            raise TaskFailed(f"{self.job[:40]!r} is not the id of a job (16 hex digits).")

    @property
    def path(self) -> Path:
        return self.root / "jobs" / self.job

    def images_of_shard(self, shard: int) -> Path:
        """The shard's images as planned."""
        return self.path / "shards" / f"{shard:06d}.json"

    def indexed_of_shard(self, shard: int) -> Path:
        """Those of them that could be read."""
        return self.path / "indexed" / f"{shard:06d}.json"

    def features(self, shard: int) -> Path:
        return self.path / "features" / f"{shard:06d}.npz"

    def partial(self, shard: int, channel: str) -> Path:
        """The shard's inverted index of a channel, as ascending keys."""
        return self.path / "partials" / channel / f"{shard:06d}.npy"

    def piece(self, channel: str, first_word: int) -> Path:
        """A range of words of a channel, merged and packed."""
        return self.path / "pieces" / channel / f"{first_word:07d}.npz"

    def excluded_of_shard(self, shard: int) -> Path:
        """Those of them that are left out, since they kill the processes that work on them."""
        return self.path / "excluded" / f"{shard:06d}.json"

    def new_ids(self, segment: str) -> Path:
        """The ids that a segment's images get when it is compacted; int64, -1 = left out."""
        return self.path / "ids" / f"{segment}.npy"

    def receipt_path(self, stage: str, key: str) -> Path:
        return self.path / "receipts" / stage / f"{key}.json"

    def write_plan(self, plan: JobPlan, shards: Iterable[Sequence[PosedImage]]) -> None:
        """Write the shards' lists first and the plan last: a plan on disk is a whole plan."""

        def write(numbered: tuple[int, Sequence[PosedImage]]) -> None:
            number, images = numbered
            write_bytes(self.images_of_shard(number), _IMAGES.dump_json(list(images)))

        with ThreadPoolExecutor(_WRITERS) as pool:  # each waits for the disk most of its time
            for _ in pool.map(write, enumerate(shards)):
                pass
        write_bytes(self.path / "plan.json", plan.model_dump_json(indent=1).encode())

    def read_plan(self) -> JobPlan:
        """The plan.

        Raises
        ------
        BadIndex : it cannot be read, is damaged, or is another job's.
        """
        path = self.path / "plan.json"
        plan = _checked(path, JobPlan.model_validate_json)
        if plan.job != self.job:
            raise BadIndex(f"{path} is the plan of job {plan.job[:40]!r}. {_again(path)}")
        return plan

    def has_plan(self) -> bool:
        return (self.path / "plan.json").is_file()

    def read_images(self, shard: int) -> list[PosedImage]:
        """The shard's images as planned.

        Raises
        ------
        BadIndex : the list cannot be read or is damaged.
        """
        return _checked(self.images_of_shard(shard), _IMAGES.validate_json)

    def write_indexed(self, shard: int, images: Sequence[IndexedImage]) -> str:
        return write_bytes(self.indexed_of_shard(shard), _INDEXED.dump_json(list(images)))

    def read_indexed(self, shard: int) -> list[IndexedImage]:
        """Those of them that could be read.

        Raises
        ------
        BadIndex : the list cannot be read or is damaged.
        """
        return _checked(self.indexed_of_shard(shard), _INDEXED.validate_json)

    def write_excluded(self, shard: int, reasons: Mapping[int, str]) -> None:
        """Leave images out, by their rows. reasons : for people."""
        write_bytes(self.excluded_of_shard(shard), _REASONS.dump_json(dict(reasons)))

    def read_excluded(self, shard: int) -> dict[int, str]:
        """Why which rows of a shard are left out.

        Raises
        ------
        BadIndex : the list is damaged.
        """
        path = self.excluded_of_shard(shard)
        if not is_shown(path):
            return {}
        return _checked(path, _REASONS.validate_json)

    def relative(self, path: Path) -> str:
        """A path as receipts name it: relative to the index."""
        return path.relative_to(self.root).as_posix()

    def write_receipt(self, receipt: Receipt) -> None:
        write_bytes(
            self.receipt_path(receipt.stage, receipt.key), _RECEIPT.dump_json(receipt, indent=1)
        )

    def read_receipt(self, stage: str, key: str) -> Receipt | None:
        """The receipt, or None where there is none or it cannot be read."""
        try:
            return _RECEIPT.validate_json(read_text_file(self.receipt_path(stage, key)))
        except (OSError, ValidationError):
            return None

    def valid_receipt(self, stage: str, key: str) -> Receipt | None:
        """The receipt, if every file it names still has its digest."""
        receipt = self.read_receipt(stage, key)
        if receipt is None:
            return None
        for name, digest in receipt.outputs.items():
            path = self.root / name
            if not (is_inside(name) and path.is_file()) or sha256_of(path) != digest:
                return None
        return receipt

    def awaited_receipt(self, stage: str, key: str) -> Receipt | None:
        """The receipt of a task that was just done elsewhere: a shared folder may be slow."""
        gives_up_at = time.monotonic() + SHOWN_S
        while (receipt := self.read_receipt(stage, key)) is None:
            if time.monotonic() > gives_up_at:
                return None
            time.sleep(_LOOK_S)
            is_shown(self.receipt_path(stage, key))
        return receipt

    def assigned(self, shard: int, words: str) -> Receipt | None:
        """The valid receipt of a shard that was assigned to these words (`words_digest`)."""
        receipt = self.valid_receipt("assign", f"{shard:06d}")
        return receipt if receipt is not None and receipt.made_from == words else None

    def words_digest(self, channels: Iterable[str]) -> str:
        """A digest of the words that there are; "" while some are not."""
        digest = hashlib.sha256()
        for channel in channels:
            trained = self.read_receipt("train", channel)
            if trained is None:
                return ""
            digest.update(json.dumps(trained.outputs, sort_keys=True).encode())
        return digest.hexdigest()

    def write_skipped(self, rows: Sequence[dict[str, str]]) -> None:
        write_bytes(
            self.path / "skipped.json", json.dumps(rows, indent=1, ensure_ascii=False).encode()
        )

    @property
    def is_closed(self) -> bool:
        """Whether nothing is to be done for it any more."""
        return (self.path / "closed").exists()

    def close(self) -> None:
        """Nothing is to be done any more: remove what only the job itself needed.

        A worker that was late, or is given a message that was late, sees it and leaves nothing.
        """
        if not self.is_closed:
            write_bytes(self.path / "closed", b"")
        self.drop_scratch()

    def open_again(self) -> None:
        """There is work to do, whatever was before."""
        (self.path / "closed").unlink(missing_ok=True)

    def drop_scratch(self) -> None:
        """Remove what only the job itself needed."""
        for name in SCRATCH:
            shutil.rmtree(self.path / name, ignore_errors=True)


def jobs_of(root: Path) -> list[JobFolder]:
    """The jobs begun in an index; what else lies in its `jobs/` is not ours."""
    names = sorted(path.name for path in (root / "jobs").glob("*") if path.is_dir())
    return [JobFolder(root, name) for name in names if _JOB_ID.fullmatch(name)]


def _checked(path: Path, parse: Callable[[bytes], Parsed]) -> Parsed:
    try:
        return parse(read_text_file(path, _MAX_LIST_BYTES))
    except OSError as error:
        raise BadIndex(
            f"{path} cannot be read ({error.strerror}). Workers must see the index under the same "
            f"path as the coordinator; otherwise: {_again(path)}"
        ) from error
    except ValidationError as error:
        where, what = first_fault(error)
        told = f"{where}: {what}" if where else what
        raise BadIndex(f"{path} is damaged ({told}). {_again(path)}") from error


def _again(path: Path) -> str:
    folder = path.parent if path.name == "plan.json" else path.parents[1]
    return f"Remove the folder {folder} and run the same command again."
