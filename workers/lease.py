"""Leases: how the coordinator sees that a task is being worked on.

A running task renews a key that expires by itself; no clocks are compared, so machines may
disagree about the time. A task that was started too often is given up: it kills its workers.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from redis import Redis, RedisError

from contracts.errors import TaskFailed

RENEW_S = 10
EXPIRE_S = 60
MAX_STARTS = 4


def lease_key(task_id: str) -> str:
    return f"flaneur:lease:{task_id}"


def starts_key(task_id: str) -> str:
    return f"flaneur:starts:{task_id}"


@contextmanager
def lease(server: Redis, task_id: str) -> Iterator[None]:
    """Hold the lease of a task while it runs.

    Raises
    ------
    TaskFailed : the task was started before, and each time its process died.
    """
    starts = int(server.incr(starts_key(task_id)))
    server.expire(starts_key(task_id), 24 * 3600)
    if starts > MAX_STARTS:
        raise TaskFailed(
            f"Task {task_id} was started {MAX_STARTS} times and its worker process died each "
            "time (out of memory?). Give workers more memory, or exclude the image that does it."
        )
    done = threading.Event()

    def renew() -> None:
        while True:
            with suppress(RedisError):  # a server that restarts is told again next time
                server.set(lease_key(task_id), "held", ex=EXPIRE_S)
            if done.wait(RENEW_S):
                return

    keeper = threading.Thread(target=renew, name=f"lease-{task_id}", daemon=True)
    keeper.start()
    try:
        yield
    finally:
        done.set()
        keeper.join()
