"""A job's folder inside an index: its plan, its receipts, and what it has made so far.

What remains to be done is derived from here and never from a queue. A receipt counts only while
the files it names still have the digests it names.
"""

import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from contracts.config import IndexConfig
from contracts.errors import BadIndex, TaskFailed
from contracts.records import PosedImage, Receipt
from index.files import sha256_of, write_bytes

_JOB_ID = re.compile(r"[0-9a-f]{16}")
_RECEIPT = TypeAdapter(Receipt)
_IMAGES = TypeAdapter(list[PosedImage])


class JobPlan(BaseModel):
    """What a job is to do; written once, before any task is sent."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    job: str
    config: IndexConfig
    config_digest: str
    segment: str
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

    def partial(self, shard: int, channel: str) -> tuple[Path, Path]:
        """The shard's inverted index of a channel: (indptr, image ids)."""
        folder = self.path / "partials" / f"{shard:06d}"
        return folder / f"{channel}.indptr.npy", folder / f"{channel}.ids.npy"

    def receipt_path(self, stage: str, key: str) -> Path:
        return self.path / "receipts" / stage / f"{key}.json"

    def write_plan(self, plan: JobPlan, shards: Sequence[Sequence[PosedImage]]) -> None:
        """Write the shards' lists first and the plan last: a plan on disk is a whole plan."""
        for number, images in enumerate(shards):
            write_bytes(self.images_of_shard(number), _IMAGES.dump_json(list(images)))
        write_bytes(self.path / "plan.json", plan.model_dump_json(indent=1).encode())

    def read_plan(self) -> JobPlan:
        return JobPlan.model_validate_json(_read(self.path / "plan.json"))

    def has_plan(self) -> bool:
        return (self.path / "plan.json").is_file()

    def read_images(self, shard: int) -> list[PosedImage]:
        return _IMAGES.validate_json(_read(self.images_of_shard(shard)))

    def write_indexed(self, shard: int, images: Sequence[IndexedImage]) -> str:
        return write_bytes(self.indexed_of_shard(shard), _INDEXED.dump_json(list(images)))

    def read_indexed(self, shard: int) -> list[IndexedImage]:
        return _INDEXED.validate_json(_read(self.indexed_of_shard(shard)))

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
            return _RECEIPT.validate_json(self.receipt_path(stage, key).read_bytes())
        except (OSError, ValidationError):
            return None

    def valid_receipt(self, stage: str, key: str) -> Receipt | None:
        """The receipt, if every file it names still has its digest."""
        receipt = self.read_receipt(stage, key)
        if receipt is None:
            return None
        for name, digest in receipt.outputs.items():
            path = self.root / name
            if not path.is_file() or sha256_of(path) != digest:
                return None
        return receipt

    def write_skipped(self, rows: Sequence[dict[str, str]]) -> None:
        write_bytes(
            self.path / "skipped.json", json.dumps(rows, indent=1, ensure_ascii=False).encode()
        )

    def drop_scratch(self) -> None:
        """Remove what only the job itself needed."""
        for name in ("features", "partials"):
            shutil.rmtree(self.path / name, ignore_errors=True)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise BadIndex(
            f"{path} cannot be read ({error.strerror}). Workers must see the index under the same "
            "path as the coordinator; otherwise remove the job's folder and index again."
        ) from error
