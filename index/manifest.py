"""What a generation is: everything a reader must know, in one JSON file.

`CURRENT` names the live generation and is swapped by an atomic rename, so a reader sees the old
one or the new one, never a mixture; files of a generation are never changed once it is live.
"""

import fcntl
import hashlib
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

from contracts.config import IndexConfig
from contracts.errors import BadIndex
from contracts.faults import first_fault
from index.files import write_bytes

FORMAT_VERSION = 2


class FileEntry(BaseModel):
    """A file that a generation relies on; paths are relative to the index."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    sha256: str
    size: int


class SurveyEntry(BaseModel):
    """A survey that went in, as it was named."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    name: str
    path: str
    format: str
    n_images: int
    attribution: str = ""


class Generation(BaseModel):
    """One state of an index."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    format_version: int = FORMAT_VERSION
    number: int
    job: str
    created_at: str
    config: IndexConfig
    config_digest: str
    crs: str | None
    area: tuple[float, float, float, float] | None = None
    """West, south, east, north in WGS 84 degrees, west of 180 beyond east; None: no poses."""
    allow_ballpark: bool = False
    n_images: int
    n_skipped: int
    n_postings: int
    surveys: tuple[SurveyEntry, ...]
    segment: str
    """Name of the folder under segments/ and codebooks/, and stem of the catalogue."""
    files: dict[str, FileEntry]

    def digest(self) -> str:
        """First 16 hex digits of the SHA-256 of all of it, and so of every file it names."""
        text = json.dumps(self.model_dump(mode="json"), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def commit(root: Path, generation: Generation) -> None:
    """Make `generation` the live one; atomic, and safe against a second writer."""
    name = f"{generation.number:06d}"
    text = json.dumps(generation.model_dump(mode="json"), indent=1, sort_keys=True)
    with write_lock(root):
        write_bytes(root / "generations" / f"{name}.json", text.encode())
        write_bytes(root / "CURRENT", f"{name}\n".encode())


def live_generation(root: Path) -> Generation:
    """Read the generation that `CURRENT` names.

    Raises
    ------
    BadIndex : `root` is not an index, is unfinished, damaged, or of a later format.
    """
    current = root / "CURRENT"
    if not current.is_file():
        raise BadIndex(_why_not_an_index(root))
    name = current.read_text(encoding="ascii", errors="replace").strip()
    if not (name.isascii() and name.isdigit()):
        raise BadIndex(f"{current} holds {name[:40]!r}, expected the number of a generation.")
    path = root / "generations" / f"{name}.json"
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise BadIndex(f"{path} cannot be read ({error}). Restore it or index again.") from error
    version = content.get("format_version") if isinstance(content, dict) else None
    if isinstance(version, int) and version != FORMAT_VERSION:
        mend = "Upgrade Flaneur" if version > FORMAT_VERSION else "Index the survey again"
        raise BadIndex(
            f"{root} has format version {version}; this Flaneur reads {FORMAT_VERSION}. {mend}."
        )
    try:
        return Generation.model_validate(content)
    except ValidationError as error:
        where, what = first_fault(error)
        raise BadIndex(f"{path}: {where}: {what}. Restore it or index again.") from error


def _why_not_an_index(root: Path) -> str:
    if not root.exists():
        return f"{root} does not exist. Make an index with: flaneur index SURVEY {root}"
    if (root / "jobs").is_dir():
        return f"{root} is not finished. Run the same `flaneur index` again to go on."
    return f"{root} is not a Flaneur index (no CURRENT in it). Check the path."


@contextmanager
def write_lock(root: Path) -> Iterator[None]:
    """Hold the index for writing; released by the system even if the process dies."""
    root.mkdir(parents=True, exist_ok=True)
    with (root / ".lock").open("w") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise BadIndex(
                f"{root} is being written by another process. Wait for it to end."
            ) from error
        yield
