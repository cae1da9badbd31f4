"""The answers of a batch, appended to one file as they come.

A line is one JSON object: that a photo's bytes have a digest, what the photo of a digest was
answered, or why a photo cannot be had. Nothing is ever changed in it: a line that a killed process
left unfinished is no line, and what it was to say is asked again.
"""

import json
import os
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Self

from geo.geojson import Feature, error_feature, renamed_feature
from index.files import open_regular

SYNC_S = 1.0
"""What a power cut may take; a process that dies takes nothing."""


class Journal:
    """The journal, open for adding to it; one process at a time."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._synced_at = time.monotonic()

    def __enter__(self) -> Self:
        self._file = self._path.open("ab", buffering=0)
        try:
            self._write(b"\n")  # ends what a killed process may have begun
        except OSError:
            self._file.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        os.fsync(self._file.fileno())
        self._file.close()

    def digested(self, number: int, sha256: str) -> None:
        """Photo `number` of the batch has these bytes."""
        self._add({"photo": number, "sha256": sha256})

    def answered(self, sha256: str, features: Sequence[Feature], seconds: float) -> None:
        """What the workers said to these bytes."""
        self._add({"sha256": sha256, "features": list(features), "seconds": seconds})

    def failed(self, number: int, error: str) -> None:
        """Photo `number` cannot be had."""
        self._add({"photo": number, "error": error})

    def ask_again(self, number: int) -> None:
        """Forget why photo `number` could not be had, or what its bytes are."""
        self._add({"photo": number})

    def forget(self, sha256: str) -> None:
        """Forget what the workers said to these bytes."""
        self._add({"sha256": sha256})

    def _add(self, entry: dict[str, object]) -> None:
        self._write(json.dumps(entry, allow_nan=False).encode() + b"\n")
        if time.monotonic() - self._synced_at > SYNC_S:
            os.fsync(self._file.fileno())
            self._synced_at = time.monotonic()

    def _write(self, line: bytes) -> None:
        left = memoryview(line)
        try:
            while left:  # a full disk may take a part
                left = left[self._file.write(left) :]
        except OSError as error:  # which names no file
            raise OSError(error.errno, error.strerror, str(self._path)) from error


@dataclass(slots=True)
class Answers:
    """What a journal says so far.

    digests : of the bytes, by photo. errors : by photo. offsets : of the line that answers these
    bytes. failed : digests whose answer is an error.
    """

    path: Path
    digests: dict[int, str] = field(default_factory=dict)
    errors: dict[int, str] = field(default_factory=dict)
    offsets: dict[str, int] = field(default_factory=dict)
    failed: set[str] = field(default_factory=set)

    @classmethod
    def read(cls, path: Path) -> "Answers":
        """Read a journal, which may grow meanwhile; a batch not yet begun has none."""
        found = cls(path)
        with suppress(FileNotFoundError), open_regular(path) as lines:
            offset = 0
            for line in lines:
                if (entry := _entry(line)) is not None:
                    found._take(entry, offset)
                offset += len(line)
        return found

    def is_done(self, number: int) -> bool:
        """Whether a photo has its answer."""
        return number in self.errors or self.digests.get(number, "") in self.offsets

    def count(self) -> tuple[int, int]:
        """How many photos have their answer, and for how many of them it is an error."""
        of_bytes = [sha256 for sha256 in self.digests.values() if sha256 in self.offsets]
        failed = sum(sha256 in self.failed for sha256 in of_bytes)
        return len(of_bytes) + len(self.errors), failed + len(self.errors)

    def _take(self, entry: dict[str, Any], offset: int) -> None:
        if "photo" not in entry:
            self.failed.discard(entry["sha256"])
            self.offsets.pop(entry["sha256"], None)
            if "features" in entry:
                self.offsets[entry["sha256"]] = offset
                if is_error(entry["features"]):
                    self.failed.add(entry["sha256"])
            return
        number = entry["photo"]
        self.digests.pop(number, None)
        self.errors.pop(number, None)
        if "sha256" in entry:
            self.digests[number] = entry["sha256"]
        elif "error" in entry:
            self.errors[number] = entry["error"]


class AnswerReader:
    """Reads single answers of a journal, by what `Answers` says of it."""

    def __init__(self, answers: Answers, file: IO[bytes]) -> None:
        self._answers = answers
        self._file = file

    def answer(self, number: int, query: str) -> tuple[tuple[Feature, ...], float]:
        """The features of a photo that has its answer, by its own name, and a worker's seconds."""
        error = self._answers.errors.get(number)
        if error is not None:
            return (error_feature(query, error),), 0.0
        self._file.seek(self._answers.offsets[self._answers.digests[number]])
        entry = json.loads(self._file.readline())
        features = tuple(renamed_feature(feature, query) for feature in entry["features"])
        return features, entry["seconds"]


def is_error(features: Sequence[Feature]) -> bool:
    """Whether an answer says why there is none."""
    return any(feature["properties"]["kind"] == "error" for feature in features)


def _entry(line: bytes) -> dict[str, Any] | None:
    if not line.endswith(b"\n"):  # being written
        return None
    try:
        entry = json.loads(line)
    except ValueError:  # a line begun by a process that was killed, or an empty one
        return None
    return entry if isinstance(entry, dict) else None
