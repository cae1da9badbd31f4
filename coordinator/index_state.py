"""Records of the state that an index is in, as `flaneur status` tells it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class GenerationState:
    """faults : files of it that are missing or of another size, and how to mend it."""

    number: int
    made_by: str
    created_at: str
    images: int
    removed: int
    segments: int
    faults: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SegmentState:
    """A segment of the live generation; `postings` and `bytes` with those of removed images."""

    name: str
    images: int
    removed: int
    postings: int
    bytes: int
    surveys: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class CodebookState:
    """words : None where the file cannot be read."""

    channel: str
    words: int | None
    bytes: int


@dataclass(frozen=True, slots=True)
class JobState:
    """An unfinished job. done : receipts by stage; of extract and assign one a shard.

    verb : "", shards, channels and at_work (on this machine) : None where its plan is not written
    yet, or see `fault`.
    """

    job: str
    verb: str
    images: int
    shards: int | None
    channels: int | None
    done: dict[str, int]
    last_receipt_at: str | None
    at_work: bool | None
    fault: str | None


@dataclass(frozen=True, slots=True)
class IndexState:
    """live : None: nothing is committed yet, or it cannot be read, see `faults`.

    faults : of the live generation. hints : what else is worth doing or knowing.

    bytes_unneeded : that only older generations or nobody needs (`flaneur compact --prune`).
    """

    index: str
    live: int | None
    generations: tuple[GenerationState, ...]
    segments: tuple[SegmentState, ...]
    codebooks_digest: str | None
    codebooks: tuple[CodebookState, ...]
    jobs: tuple[JobState, ...]
    bytes: int
    bytes_unneeded: int
    instruction_sets: tuple[str, ...]
    faults: tuple[str, ...]
    hints: tuple[str, ...]
