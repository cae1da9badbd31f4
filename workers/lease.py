"""Leases: how the coordinator sees that a task is being worked on.

A running task renews a key that expires by itself; no clocks are compared, so machines may
disagree about the time. A task that was begun too often is given up: it kills its workers.
"""

import json
import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from redis import Redis, RedisError

from contracts.errors import TaskFailed

LEASE_S = 60.0
"""How long a worker that is not heard of is believed to be at work."""
RENEWALS = 6
"""Times a lease is renewed before it would lapse."""
MAX_STARTS = 3
STARTS_KEPT_S = 24 * 3600


class GivenUp(TaskFailed):
    """Each process that began the task died."""


def lease_key(task_id: str) -> str:
    return f"flaneur:lease:{task_id}"


def starts_key(task_id: str) -> str:
    return f"flaneur:starts:{task_id}"


def who() -> str:
    """This process, as others are told of it."""
    return f"{socket.gethostname()}:{os.getpid()}"


@contextmanager
def lease(server: Redis, task_id: str, lease_s: float) -> Iterator[None]:
    """Hold the lease of a task while it runs.

    Raises
    ------
    GivenUp : the task was begun before, and each time its process died.
    """
    starts = int(server.incr(starts_key(task_id)))
    server.expire(starts_key(task_id), STARTS_KEPT_S)
    if starts > MAX_STARTS:
        raise GivenUp(
            f"Task {task_id} was begun {MAX_STARTS} times and its worker process died each time "
            "(out of memory?). Give workers more memory, or exclude the image that does it."
        )
    done = threading.Event()
    content = json.dumps({"worker": who(), "task": task_id})

    def renew() -> None:
        while True:
            with suppress(RedisError):  # a server that restarts is told again next time
                server.set(lease_key(task_id), content, px=int(lease_s * 1000))
            if done.wait(lease_s / RENEWALS):
                return

    keeper = threading.Thread(target=renew, name=f"lease-{task_id}", daemon=True)
    keeper.start()
    try:
        yield
    finally:
        done.set()
        keeper.join()
