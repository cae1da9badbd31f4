"""Empty tasks through real Celery: how many a second, and whether memory stays as it is."""

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
from redis import Redis

from benchmarks.flow.empty import N_PROCESSES, routed
from benchmarks.table import print_table
from coordinator.engine.embedded import embedded_server
from coordinator.following.events import Order
from coordinator.following.follow import Follower
from workers.app import make_app, queue_key
from workers.server import connect

PRIORITY = 7


def run(n: int) -> None:
    """Print a line for each tenth of the tasks."""
    with tempfile.TemporaryDirectory() as folder, embedded_server(Path(folder)) as url:
        app = make_app(url)
        routed(app)
        follower = Follower(app, "flow", 4 * N_PROCESSES, lambda: None, priority=PRIORITY)
        with _workers(url):
            list(follower.outcomes([_order(0)]))  # they have started
            rows = list(_followed(follower, connect(url), n))
    print_table(
        (
            "tasks",
            "tasks/s",
            "coordinator CPU ms/task",
            "coordinator RSS MiB",
            "server MiB",
            "keys",
            "longest queue",
        ),
        rows,
    )


def _followed(follower: Follower, server: Redis, n: int) -> Iterator[tuple[str, ...]]:
    longest, began, cpu = 0, time.perf_counter(), time.process_time()
    orders = (_order(number) for number in range(1, n + 1))
    for done, outcome in enumerate(follower.outcomes(orders), 1):
        if outcome.value is None:
            raise SystemExit(outcome.error)
        if done % (n // 100) == 0:
            longest = max(longest, server.llen(queue_key("extract", PRIORITY)))
        if done % (n // 10) == 0:
            seconds = time.perf_counter() - began
            cpu_ms = 1000 * (time.process_time() - cpu) / (n // 10)
            memory = server.info("memory")["used_memory"]
            yield (
                f"{done:,}",
                f"{n // 10 / seconds:.0f}",
                f"{cpu_ms:.2f}",
                f"{psutil.Process().memory_info().rss / 2**20:.1f}",
                f"{memory / 2**20:.2f}",
                str(server.dbsize()),
                str(longest),
            )
            began, cpu = time.perf_counter(), time.process_time()


def _order(number: int) -> Order:
    return Order("empty", f"{number:06d}", {"index": "/data/index", "shard": number})


@contextmanager
def _workers(url: str) -> Iterator[None]:
    code = "import sys; from benchmarks.flow.empty import work; work(sys.argv[1])"
    command = [sys.executable, "-c", code, url]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.terminate()
