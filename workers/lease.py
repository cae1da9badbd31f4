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

from contracts.errors import Cancelled, TaskFailed

LEASE_S = 60.0
"""How long a worker that is not heard of is believed to be at work."""
RENEWALS = 6
"""Times a lease is renewed before it would lapse."""
MAX_STARTS = 3
STARTS_KEPT_S = 24 * 3600
LANDED_KEPT_S = 3600
"""How long a coordinator may be busy with other things than to hear of what has landed."""


class GivenUp(TaskFailed):
    """Each process that began the task died."""


class Withdrawn(Cancelled):
    """The coordinator does not want the task any more."""


def lease_key(task_id: str) -> str:
    return f"flaneur:lease:{task_id}"


def starts_key(task_id: str) -> str:
    return f"flaneur:starts:{task_id}"


def landed_key(flow: str) -> str:
    """Where a coordinator hears of its tasks that have ended, as 'id worker'."""
    return f"flaneur:landed:{flow}"


def withdrawn_key(flow: str) -> str:
    """There once no task of a flow is to be begun any more."""
    return f"flaneur:withdrawn:{flow}"


def flow_of(task_id: str) -> str:
    """The stream of orders that a task is of."""
    return task_id.split(".", 1)[0]


def who() -> str:
    """This process, as others are told of it."""
    return f"{socket.gethostname()}:{os.getpid()}"


@contextmanager
def lease(server: Redis, task_id: str, lease_s: float) -> Iterator[None]:
    """Hold the lease of a task while it runs.

    Raises
    ------
    GivenUp : the task was begun before, and each time its process died.
    Withdrawn : nobody wants it any more.
    """
    content = json.dumps({"worker": who(), "task": task_id.split(".", 2)[-1].replace(".", " ", 1)})
    with suppress(RedisError):  # away for a moment: the lease is told when it is back
        _begin(server, task_id, content, lease_s)
    done = threading.Event()

    def renew() -> None:
        while not done.wait(lease_s / RENEWALS):
            with suppress(RedisError):  # a server that restarts is told again next time
                server.set(lease_key(task_id), content, px=int(lease_s * 1000))

    keeper = threading.Thread(target=renew, name=f"lease-{task_id}", daemon=True)
    keeper.start()
    try:
        yield
    finally:
        done.set()
        keeper.join()


def _begin(server: Redis, task_id: str, content: str, lease_s: float) -> None:
    with server.pipeline(transaction=False) as pipeline:
        pipeline.exists(withdrawn_key(flow_of(task_id)))
        pipeline.incr(starts_key(task_id))
        pipeline.expire(starts_key(task_id), STARTS_KEPT_S)
        pipeline.set(lease_key(task_id), content, px=int(lease_s * 1000))
        withdrawn, starts, *_ = pipeline.execute()
    if withdrawn:
        raise Withdrawn(f"Task {task_id} was withdrawn.")
    if starts > MAX_STARTS:
        raise GivenUp(
            f"it was begun {MAX_STARTS} times, and its worker process died each time (out of "
            "memory?). Give workers more memory."
        )


def release(server: Redis, task_id: str) -> None:
    """Forget that a task was begun, and wake the coordinator that waits for it."""
    landed = landed_key(flow_of(task_id))
    with server.pipeline(transaction=False) as pipeline:
        pipeline.delete(starts_key(task_id), lease_key(task_id))
        pipeline.lpush(landed, f"{task_id} {who()}")
        pipeline.expire(landed, LANDED_KEPT_S)
        pipeline.execute()
