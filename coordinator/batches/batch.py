"""A batch on disk: a folder with its plan, its photos and, as they come, its answers.

batches/<name>/
  batch.json       what is asked, of which generation; written last: who has it is a whole batch
  photos.jsonl     the photos in their order
  search-….json    the search, which messages name
  answers.jsonl    what is known so far (journal.py)
  progress.json    how it goes, told by whoever works on it
  control.json     what a person wishes: run, pause, cancel
  fetched/         photos from elsewhere
  log.txt          of a batch that goes on by itself
"""

import fcntl
import hashlib
import re
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from contracts.config import SearchConfig
from contracts.errors import BadConfig, BadIndex
from contracts.faults import first_fault
from coordinator.batches.photos import Photo, read_photos, write_photos
from index.files import read_text_file, write_bytes

BATCHES = "batches"
"""The folder of an index's batches."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_PATIENCE_S = 2.0
"""Who only looks whether anybody is at work holds the lock for a moment."""
_AGAIN = "Delete the batch's folder and submit it again."


class BatchPlan(BaseModel):
    """What a batch asks; written once. sources : as given, made absolute. about : of its results.

    generation_digest : of the generation that all its photos are located against.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    name: str
    made_at: str
    generation: int
    generation_digest: str
    search: SearchConfig
    priority: Annotated[int, Field(ge=0, le=9)]
    sources: tuple[str, ...]
    n_photos: int
    about: dict[str, Any]


@dataclass(frozen=True, slots=True)
class BatchFolder:
    """Names everything of a batch. place : the folder of all batches."""

    place: Path
    name: str

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            raise BadConfig(
                f"{self.name[:80]!r} is no name of a batch; take up to 64 letters, digits, "
                "dots, dashes and underscores, a letter or digit first."
            )

    @property
    def path(self) -> Path:
        return self.place / self.name

    @property
    def answers(self) -> Path:
        return self.path / "answers.jsonl"

    @property
    def log(self) -> Path:
        return self.path / "log.txt"

    @property
    def fetched(self) -> Path:
        return self.path / "fetched"

    def search_file(self, search: SearchConfig) -> Path:
        """By its digest: workers keep what they read of it."""
        digest = hashlib.sha256(search.model_dump_json().encode()).hexdigest()[:16]
        return self.path / f"search-{digest}.json"

    def exists(self) -> bool:
        return self._plan.exists()

    def write(self, plan: BatchPlan, photos: Sequence[Photo]) -> None:
        """Put a batch there; its plan last.

        Raises
        ------
        BadConfig : another process put one there meanwhile.
        """
        self.path.mkdir(parents=True, exist_ok=True)
        with (self.path / ".submitting").open("a") as stream:
            fcntl.flock(stream, fcntl.LOCK_EX)
            if self.exists():
                raise BadConfig(
                    f"Another process submitted a batch {self.name} meanwhile. Run the same "
                    "command again to go on with it, or give this one another name."
                )
            write_bytes(self.search_file(plan.search), plan.search.model_dump_json().encode())
            write_photos(self._photos, photos)
            write_bytes(self._plan, plan.model_dump_json(indent=1).encode())

    def read(self) -> BatchPlan:
        """The plan.

        Raises
        ------
        BadConfig : there is no such batch; names those there are.
        BadIndex : it cannot be read, or is damaged.
        """
        try:
            return BatchPlan.model_validate_json(read_text_file(self._plan))
        except FileNotFoundError as error:
            known = ", ".join(each.name for each in batches_in(self.place)) or "none"
            raise BadConfig(
                f"{self.place} has no batch {self.name}; it has {known}. "
                "Submit it with `flaneur batch submit`."
            ) from error
        except ValidationError as error:
            where, what = first_fault(error)
            raise BadIndex(f"{self._plan} is damaged ({where}: {what}). {_AGAIN}") from error
        except OSError as error:
            raise BadIndex(f"{self._plan} cannot be read ({error.strerror}). {_AGAIN}") from error

    def photos(self) -> Iterator[Photo]:
        """Its photos in their order. Errors as `read_photos`."""
        return read_photos(self._photos)

    @contextmanager
    def worked_on(self) -> Iterator[None]:
        """Be the one process that works on it; the lock ends with the process.

        Raises
        ------
        BadConfig : another is.
        """
        with self._plan.open("rb+") as stream:
            gives_up_at = time.monotonic() + _PATIENCE_S
            while not _locked(stream.fileno(), fcntl.LOCK_EX):
                if time.monotonic() > gives_up_at:
                    raise BadConfig(
                        f"Another process works on the batch {self.name} already; see "
                        "`flaneur batch status`."
                    )
                time.sleep(_PATIENCE_S / 20)
            yield

    def is_worked_on(self) -> bool:
        """Whether a process is at work on it; who may only read may ask too."""
        with self._plan.open("rb") as stream:
            return not _locked(stream.fileno(), fcntl.LOCK_SH)

    @property
    def _plan(self) -> Path:
        return self.path / "batch.json"

    @property
    def _photos(self) -> Path:
        return self.path / "photos.jsonl"


def batches_in(place: Path) -> list[BatchFolder]:
    """All batches of a folder, by name."""
    found = (path.parent.name for path in place.glob("*/batch.json"))
    return [BatchFolder(place, name) for name in sorted(found) if _NAME.fullmatch(name)]


def _locked(descriptor: int, kind: int) -> bool:
    try:
        fcntl.flock(descriptor, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
