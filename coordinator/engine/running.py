"""The engine: a broker and workers, brought along or pointed at.

With no broker given, a server is started on a socket in a fresh temporary folder, with worker
processes beside it, and both are stopped at the end. The code path is the same either way.
"""

import logging
import os
import shutil
import tempfile
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from celery import Celery

from coordinator.engine.broker import broker_url, check_broker, check_workers
from coordinator.engine.embedded import embedded_server, watch_embedded
from coordinator.engine.exposure import exposure
from coordinator.engine.local_workers import LocalWorkers
from coordinator.following.events import Listener, unheard
from coordinator.following.follow import Follower, go_on
from index.control import Wish
from workers.app import QUEUES, make_app

JOB_QUEUES = ("extract", "train", "assign", "merge")
"""What a job of indexing sends to."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Engine:
    """A running engine. n_workers : processes, local ones or those that listened at its start."""

    app: Celery
    follower: Follower
    n_workers: int


@contextmanager
def running_engine(
    broker: str | None,
    n_workers: int | None,
    queues: Sequence[str] = QUEUES,
    *,
    priority: int = 0,
    wish: Callable[[], Wish] = go_on,
    listen: Listener = unheard,
) -> Iterator[Engine]:
    """Start what is needed, and stop at the end what was started.

    queues : that will be sent to. priority, wish, listen : of whatever is sent, see `Follower`.

    Raises
    ------
    BrokerUnreachable : nothing answers at the broker given, or no worker of our version listens
        there on each of `queues`.
    """
    url = broker_url(broker)
    with ExitStack() as stack:
        if url is not None:
            server = check_broker(url)
            if exposed := exposure(url, server):
                log.warning(exposed)
            app = make_app(url)
            count = check_workers(server, url, queues)
            watch = _nothing
        else:
            folder = Path(tempfile.mkdtemp(prefix="flaneur-"))
            stack.callback(shutil.rmtree, folder, ignore_errors=True)
            url = stack.enter_context(embedded_server(folder))
            app = make_app(url)
            count = n_workers or available_cores()
            local = stack.enter_context(LocalWorkers(url, queues, count, folder / "worker.log"))
            watch = partial(_watch_ours, url, local)
        follower = Follower(
            app,
            uuid.uuid4().hex[:12],
            4 * count,
            watch,
            priority=priority,
            wish=wish,
            listen=listen,
        )
        yield Engine(app, follower, count)


def available_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _watch_ours(url: str, workers: LocalWorkers) -> None:
    watch_embedded(url)
    workers.watch()


def _nothing() -> None:
    """Workers elsewhere are somebody else's to watch."""
