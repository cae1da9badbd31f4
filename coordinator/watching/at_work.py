"""What the workers of a broker are at: their leases say it."""

from contextlib import suppress
from itertools import islice

from pydantic import TypeAdapter, ValidationError
from redis import Redis

from coordinator.watching.progress import AtWork
from workers.lease import lease_key

MOST = 1000
"""Processes that are listed."""

_AT_WORK = TypeAdapter(AtWork)


def at_work(server: Redis, run_id: str) -> tuple[AtWork, ...]:
    """Every worker process that is at an order of a follower, in the order of their names.

    Raises
    ------
    RedisError : the server does not answer.
    """
    keys = list(islice(server.scan_iter(lease_key(f"{run_id}*"), count=MOST), MOST))
    held: list[AtWork] = []
    for content in server.mget(keys) if keys else ():
        with suppress(ValidationError):  # it ended meanwhile, or is of another version
            held.append(_AT_WORK.validate_json(content or b""))
    return tuple(sorted(held, key=lambda each: (each.worker, each.task)))
