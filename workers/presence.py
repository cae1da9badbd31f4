"""Presence: each worker tells the server that it is there, by a key that expires by itself.

A thread of the worker's main process tells it, so that a busy pool does not silence it.
"""

import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any

from celery.signals import worker_ready, worker_shutting_down
from pydantic import BaseModel, ConfigDict, ValidationError
from redis import Redis, RedisError

from workers.lease import RENEWALS

PRESENT_S = 30.0
"""How long a worker that is not heard of is believed to be there."""
ALL = "flaneur:workers"
"""A set of names: to find all workers without looking through every key of the server."""


class Presence(BaseModel):
    """A worker that listens. name : as Celery calls it. processes : tasks it runs at a time."""

    model_config = ConfigDict(frozen=True, extra="ignore")  # a later version may tell more

    name: str
    host: str
    pid: int
    processes: int
    queues: tuple[str, ...]
    version: str


def listening(server: Redis) -> list[Presence]:
    """All workers that are there, of any version, in the order of their names."""
    found: set[Any] = server.smembers(ALL)
    names = sorted(name.decode() for name in found)
    if not names:
        return []
    told = dict(zip(names, server.mget([_key(name) for name in names]), strict=True))
    if gone := [name for name, content in told.items() if content is None]:
        server.srem(ALL, *gone)  # one that was only late adds its name again
    return list(_readable(content for content in told.values() if content is not None))


def _readable(told: Iterable[Any]) -> Iterator[Presence]:
    for content in told:
        with suppress(ValidationError):  # of a version that tells other things
            yield Presence.model_validate_json(content)


def processes_on(present: Sequence[Presence], queues: Sequence[str], version: str) -> int:
    """How many tasks at a time those of a version can do that listen on any of the queues."""
    return sum(
        each.processes
        for each in present
        if each.version == version and not set(queues).isdisjoint(each.queues)
    )


def announce(server: Redis, presence: Presence) -> None:
    """Tell of this worker from when it takes tasks until it takes no more."""
    over = threading.Event()
    teller = threading.Thread(
        target=_tell, args=(server, presence, over), name="presence", daemon=True
    )
    worker_ready.connect(lambda **_: teller.start(), weak=False)
    worker_shutting_down.connect(lambda **_: over.set(), weak=False)


def _tell(server: Redis, presence: Presence, over: threading.Event) -> None:
    key, content = _key(presence.name), presence.model_dump_json()
    while not over.is_set():
        with suppress(RedisError), server.pipeline() as pipeline:  # away: told again next time
            pipeline.set(key, content, px=int(PRESENT_S * 1000))
            pipeline.sadd(ALL, presence.name)
            pipeline.execute()
        over.wait(PRESENT_S / RENEWALS)
    with suppress(RedisError):  # it will expire
        server.delete(key)


def _key(name: str) -> str:
    return f"flaneur:worker:{name}"
