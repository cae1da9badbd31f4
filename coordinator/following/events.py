"""What happens to orders while they are followed: for whoever shows, logs or counts it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

Kind = Literal[
    "sent",
    "done",
    "failed",
    "lost",
    "refused",
    "given_up",
    "paused",
    "resumed",
    "waiting",
    "back",
    "alone",
    "joined",
]
"""lost : its worker was not heard of for too long, so it was sent again. given_up : it was begun
too often. waiting : the broker is away; back : it is not. alone : no worker listens;
joined : one does again."""


@dataclass(frozen=True, slots=True)
class Order:
    """One task to send. name : 'extract', … key : what it is about, for messages and ids.

    limit_s : its process is killed after that long.
    """

    name: str
    key: str
    message: dict[str, Any] = field(hash=False)
    limit_s: float = 3600.0


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened. seconds : that a worker took. told : why, for people.

    value : what a task that is done returned.
    """

    kind: Kind
    order: Order | None = None
    worker: str = ""
    seconds: float = 0.0
    told: str = ""
    value: dict[str, Any] | None = None


Listener = Callable[[Event], None]


def unheard(_: Event) -> None:
    """A listener for those who do not care."""
