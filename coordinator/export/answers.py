"""Answers kept on disk as they come, so that each can be written more than once."""

import json
from collections.abc import Iterable, Iterator
from typing import IO

from coordinator.querying import Located


class KeptAnswers:
    """Answers in a scratch file, one JSON object a line, in the order they came."""

    def __init__(self, scratch: IO[bytes]) -> None:
        self._scratch = scratch
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def keep(self, answers: Iterable[Located]) -> Iterator[Located]:
        """The same answers, each kept before it is handed on."""
        for answer in answers:
            line = json.dumps([answer.query, answer.features, answer.seconds])
            self._scratch.write(line.encode() + b"\n")
            self._count += 1
            yield answer

    def __iter__(self) -> Iterator[Located]:
        """All that were kept, from the first."""
        self._scratch.seek(0)
        for line in self._scratch:
            query, features, seconds = json.loads(line)
            yield Located(query, tuple(features), seconds)
