"""The journal of a job: a line for everything that happened to its orders, over all its runs.

A line a finished order and none for what is sent, so that it grows with the work alone. Times are
those of the coordinator's clock; no other machine's is compared with them.
"""

import json
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import IO

from pydantic import TypeAdapter, ValidationError

from index.files import open_regular

MAX_TOLD = 500
"""Characters of a reason that are kept."""


@dataclass(frozen=True, slots=True)
class Record:
    """Something that happened.

    kind : of an `Event`; or run (a coordinator began), stage (it came to one), end (of that run).
    seconds : that a worker took; of `end`, of the run. images, skipped : of a shard that was
    extracted; of `stage`, `total` orders of which `done` were done before.
    """

    at: str
    kind: str
    stage: str = ""
    key: str = ""
    worker: str = ""
    seconds: float = 0.0
    told: str = ""
    images: int = 0
    skipped: int = 0
    total: int = 0
    done: int = 0


_RECORD = TypeAdapter(Record)


def utc_now() -> str:
    """The time in UTC, to the millisecond."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def path_of(folder: Path) -> Path:
    return folder / "events.jsonl"


class Journal:
    """Appends records to the journal in a job's folder.

    What cannot be written is lost, for the work goes on: `write` raises, and can be called again.
    """

    def __init__(self, folder: Path) -> None:
        self._path = path_of(folder)
        self._stream: IO[bytes] | None = None

    def write(self, record: Record) -> None:
        """Append a record, in one piece.

        Raises
        ------
        OSError : the disk is full, say.
        """
        short = replace(record, told=record.told[:MAX_TOLD], seconds=round(record.seconds, 3))
        said = {name: value for name, value in asdict(short).items() if value}
        line = json.dumps(said) + "\n"
        if self._stream is None:
            self._stream = self._path.open("ab", buffering=0)
            line = f"\n{line}"  # what was begun before, and cut off, ends here
        try:
            self._stream.write(line.encode())
        except OSError:
            self.close()
            raise

    def close(self) -> None:
        """Let go of the file; another record opens it again."""
        if self._stream is not None:
            with suppress(OSError):
                self._stream.close()
            self._stream = None


def read_journal(folder: Path) -> Iterator[Record]:
    """The records of a job, from the first; a line that was cut off is passed over."""
    try:
        stream = open_regular(path_of(folder))
    except OSError:
        return
    with stream:
        for line in stream:
            with suppress(ValidationError):
                yield _RECORD.validate_json(line)
