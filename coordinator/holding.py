"""Answers that came before their turn, held in a file so that memory does not grow with them."""

import json
from tempfile import SpooledTemporaryFile
from typing import Self

from geo.geojson import Feature

IN_MEMORY_BYTES = 1 << 25


class HeldAnswers:
    """Features of photos, by the photo's number, each put there once and taken once.

    While one photo keeps a worker busy, others are answered by the thousand.
    """

    def __init__(self) -> None:
        self._file = SpooledTemporaryFile[bytes](IN_MEMORY_BYTES)
        self._offsets: dict[int, int] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __contains__(self, number: int) -> bool:
        return number in self._offsets

    def put(self, number: int, features: tuple[Feature, ...], seconds: float) -> None:
        """Hold the answer to a photo."""
        if not self._offsets:
            self._file.seek(0)
            self._file.truncate()
        self._offsets[number] = self._file.seek(0, 2)
        self._file.write(json.dumps([features, seconds]).encode() + b"\n")

    def take(self, number: int) -> tuple[tuple[Feature, ...], float]:
        """The answer to a photo, which is held no longer."""
        self._file.seek(self._offsets.pop(number))
        features, seconds = json.loads(self._file.readline())
        return tuple(features), seconds
