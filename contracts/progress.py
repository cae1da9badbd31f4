"""What is told of work while it goes on."""

from typing import Protocol


class Progress(Protocol):
    """What shows how far a stage is."""

    def begin(self, stage: str, total: int, done: int) -> None: ...
    def advance(self, stage: str) -> None: ...
