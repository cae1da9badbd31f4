"""What a generation is: everything a reader must know, in one JSON file.

`CURRENT` names the live generation; files of a generation are never changed once it is committed
(index/commits.py), so a reader keeps the one that it opened. docs/index-format.md has all of it.
"""

import hashlib
import json
import re
from itertools import accumulate
from pathlib import Path
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from contracts.config import IndexConfig
from contracts.errors import BadIndex
from contracts.faults import first_fault
from index.files import is_inside, read_text_file

FORMAT_VERSION = 3
_POINT = "Restore it, or write the number of one in `generations/` into it."

_MEND = "Restore it, go back with `flaneur rollback`, or index again into a new folder."

Name = Annotated[str, Field(pattern=r"^[0-9]{4,9}$")]
"""Of a segment, a set of codebooks or a folder of tombstones: a number, never used twice."""
Count = Annotated[int, Field(ge=0, lt=2**32)]
Degrees = Annotated[float, Field(ge=-360, le=360, allow_inf_nan=False)]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class FileEntry(_Record):
    """A file that a generation relies on; paths are relative to the index."""

    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    size: Annotated[int, Field(ge=0)]


class SurveyEntry(_Record):
    """A survey that went in, as it was named."""

    name: str
    path: str
    format: str
    n_images: int
    attribution: str = ""


class SegmentEntry(_Record):
    """Images that were indexed together, and how many of them have been removed since.

    jobs : that made it, or whose segments were compacted into it.
    tombstones : folder under `tombstones/` that says which images are removed; None: none is.
    quantisation : by channel, the mean squared distance of its descriptors to their words.
    """

    name: Name
    jobs: tuple[str, ...]
    n_images: Count
    n_removed: Count = 0
    tombstones: Name | None = None
    n_postings: Annotated[int, Field(ge=0)]
    n_skipped: int
    surveys: tuple[SurveyEntry, ...]
    quantisation: dict[str, Annotated[float, Field(ge=0, allow_inf_nan=False)]]

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.n_removed > (self.n_images if self.tombstones else 0):
            raise ValueError(
                f"{self.n_removed} of {self.n_images} images removed, tombstones {self.tombstones}"
            )
        return self


class Generation(_Record):
    """One state of an index. A segment's images follow those of the segments before it."""

    format_version: int = FORMAT_VERSION
    number: Annotated[int, Field(ge=1)]
    made_by: str
    """The verb, such as `add`."""
    created_at: str
    config: IndexConfig
    config_digest: str
    crs: str | None
    area: tuple[Degrees, Degrees, Degrees, Degrees] | None = None
    """West, south, east, north in WGS 84 degrees, west of 180 beyond east; None: no poses."""
    allow_ballpark: bool = False
    codebooks: Name
    codebooks_digest: str
    """What tells its words from those of other indices."""
    segments: tuple[SegmentEntry, ...]
    files: dict[str, FileEntry]

    @field_validator("files")
    @classmethod
    def _stay_inside(cls, files: dict[str, FileEntry]) -> dict[str, FileEntry]:
        for name in files:
            if not is_inside(name):
                raise ValueError(f"the file {name[:80]!r} lies outside the index")
        return files

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        names = [segment.name for segment in self.segments]
        if len(set(names)) != len(names):
            raise ValueError(f"a segment is named twice among {', '.join(names)[:80]}")
        if self.n_images >= 2**32:
            raise ValueError(f"{self.n_images} images are more than 32 bits can tell apart")
        return self

    @property
    def n_images(self) -> int:
        """Ids given, those of removed images too."""
        return sum(segment.n_images for segment in self.segments)

    @property
    def n_live(self) -> int:
        """Images that can be found."""
        return self.n_images - sum(segment.n_removed for segment in self.segments)

    @property
    def n_postings(self) -> int:
        return sum(segment.n_postings for segment in self.segments)

    @property
    def n_skipped(self) -> int:
        return sum(segment.n_skipped for segment in self.segments)

    @property
    def jobs(self) -> frozenset[str]:
        """Every job whose images it holds."""
        return frozenset(job for segment in self.segments for job in segment.jobs)

    @property
    def surveys(self) -> tuple[SurveyEntry, ...]:
        """All that went in, in the order in which they did."""
        return tuple(survey for segment in self.segments for survey in segment.surveys)

    @property
    def placed(self) -> tuple[tuple[SegmentEntry, slice], ...]:
        """Each segment, and the ids of its images."""
        ends = accumulate(segment.n_images for segment in self.segments)
        return tuple(
            (segment, slice(end - segment.n_images, end))
            for segment, end in zip(self.segments, ends, strict=True)
        )

    @property
    def sizes(self) -> dict[str, int]:
        """Bytes of every file that it relies on, by name."""
        return {name: entry.size for name, entry in self.files.items()}

    @property
    def n_bytes(self) -> int:
        return sum(self.sizes.values())

    def file(self, name: str) -> FileEntry:
        """What is said of a file.

        Raises
        ------
        BadIndex : nothing is.
        """
        if name not in self.files:
            raise BadIndex(
                f"Generation {self.number} does not name {name}. Restore its file in "
                "`generations/` or index again."
            )
        return self.files[name]

    def digest(self) -> str:
        """First 16 hex digits of the SHA-256 of all of it, and so of every file it names."""
        text = json.dumps(self.model_dump(mode="json"), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def generation_path(root: Path, number: int) -> Path:
    return root / "generations" / f"{number:06d}.json"


def generation_numbers(root: Path) -> tuple[int, ...]:
    """Every generation that an index still has, the earliest first."""
    names = (path.stem for path in (root / "generations").glob("*.json"))
    return tuple(sorted(int(name) for name in names if re.fullmatch("[0-9]{6,9}", name)))


def live_number(root: Path) -> int:
    """The number of the live generation.

    Raises
    ------
    BadIndex : `root` is not an index, or is unfinished.
    """
    current = root / "CURRENT"
    if not current.is_file():
        raise BadIndex(_why_not_an_index(root))
    try:
        name = read_text_file(current, max_bytes=100).decode("ascii", errors="replace").strip()
    except OSError as error:
        raise BadIndex(f"{current} cannot be read ({error.strerror}). {_POINT}") from error
    if not re.fullmatch("[0-9]{1,9}", name):
        raise BadIndex(
            f"{current} holds {name[:40]!r}, expected the number of a generation. {_POINT}"
        )
    return int(name)


def read_generation(root: Path, number: int | None = None) -> Generation:
    """Read a generation; None: the live one.

    Raises
    ------
    BadIndex : `root` is not an index, is unfinished, damaged, or of another format.
    """
    number = live_number(root) if number is None else number
    path = generation_path(root, number)
    try:
        content = json.loads(read_text_file(path))
    except FileNotFoundError as error:
        there = ", ".join(map(str, generation_numbers(root))) or "none"
        raise BadIndex(f"{root} has no generation {number}; there are: {there}.") from error
    except (OSError, ValueError, RecursionError) as error:
        raise BadIndex(f"{path} cannot be read ({error}). {_MEND}") from error
    version = content.get("format_version") if isinstance(content, dict) else None
    if isinstance(version, int) and version != FORMAT_VERSION:
        mend = "Upgrade Flaneur" if version > FORMAT_VERSION else "Index the survey again"
        raise BadIndex(
            f"{root} has format version {version}; this Flaneur reads {FORMAT_VERSION}. {mend}."
        )
    try:
        generation = Generation.model_validate(content)
    except ValidationError as error:
        where, what = first_fault(error)
        raise BadIndex(f"{path}: {where}: {what}. {_MEND}") from error
    if generation.number != number:
        raise BadIndex(f"{path} says that it is generation {generation.number}. {_MEND}")
    return generation


def _why_not_an_index(root: Path) -> str:
    if not root.exists():
        return f"{root} does not exist. Make an index with: flaneur index SURVEY {root}"
    if (root / "jobs").is_dir():
        return f"{root} is not finished. Run the same `flaneur index` again to go on."
    return f"{root} is not a Flaneur index (no CURRENT in it). Check the path."
