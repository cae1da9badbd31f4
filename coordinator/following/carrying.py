"""What carries orders to workers, and what it brings back: between a flow and its courier."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

from coordinator.following.events import Order

Json = dict[str, Any]


class BrokerAway(Exception):
    """The broker does not answer now; the message says how."""


@dataclass(frozen=True, slots=True)
class Landing:
    """What came back of a task. died : its process did, or was ended after too long a time.

    lost : its result could not be stored. error : of a failed task. told : why, for people.
    """

    task_id: str
    kind: Literal["done", "failed", "refused", "died", "lost"]
    value: Json | None = None
    error: BaseException | None = None
    told: str = ""
    worker: str = ""
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class Sighting:
    """A task that has not landed. starts : times it was begun. held : by a worker, now.

    waiting : messages in the queue that it was put into.
    """

    starts: int
    held: bool
    waiting: int


class Courier(Protocol):
    """Carries orders to workers and brings back what comes of them.

    Every call may raise BrokerAway, and is then made again: what is sent twice counts once.
    """

    def room(self) -> int:
        """How many orders the workers that listen have room for; 0: none listens."""

    def send(self, orders: Mapping[str, Order]) -> None:
        """Put orders into their queues. orders : by the ids of their tasks."""

    def landed(self, wait_s: float) -> Sequence[Landing]:
        """What has landed and was heard of; waits for the first, if need be."""

    def look(self, orders: Mapping[str, Order]) -> tuple[list[Landing], dict[str, Sighting]]:
        """Which tasks have landed, heard of or not, and how it is with the others."""

    def withdraw(self) -> None:
        """Let no worker begin any more what was sent."""
