"""What a worker counts, for Prometheus to fetch over HTTP.

Tasks run in forked processes that come and go: each counts in a file of its own in a folder
(prometheus_client's multiprocess mode), so that what a process counted stays when it dies, however
it dies. prometheus_client reads the folder's name from the environment as it is imported, so it is
imported here and not above.
"""

import atexit
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from celery.signals import task_postrun, task_prerun, worker_process_init

from contracts.errors import BadConfig

if TYPE_CHECKING:
    from wsgiref.simple_server import WSGIServer

    from prometheus_client import CollectorRegistry
    from prometheus_client.metrics_core import Metric

FOLDER_VARIABLE = "PROMETHEUS_MULTIPROC_DIR"
SECONDS = (0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60, 120, 300, 900, 3600)


def serve(registry: "CollectorRegistry", port: int, address: str) -> "WSGIServer":
    """Show what is counted at http://address:port/metrics, from a thread of its own.

    Raises
    ------
    BadConfig : the port is taken, or the address is not this machine's.
    """
    from prometheus_client import start_http_server

    try:
        server, _ = start_http_server(port, address, registry)
    except OSError as error:
        raise BadConfig(
            f"Metrics cannot be shown at {address}:{port} ({error.strerror or error}). Is another "
            "worker or coordinator there? Choose another --metrics-port, one for each."
        ) from error
    return server


def serve_worker(port: int, address: str, n_processes: int) -> None:
    """Count the tasks of this worker's processes, which are forked later, and show them.

    Raises
    ------
    BadConfig : as `serve`.
    """
    folder = tempfile.mkdtemp(prefix="flaneur-metrics-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[FOLDER_VARIABLE] = folder
    from prometheus_client import CollectorRegistry
    from prometheus_client.multiprocess import MultiProcessCollector

    registry = CollectorRegistry()
    MultiProcessCollector(registry, folder)  # type: ignore[no-untyped-call]
    registry.register(_Processes(n_processes))
    server = serve(registry, port, address)
    # A process that outlives a killed worker must not keep the port.
    worker_process_init.connect(lambda **_: server.socket.close(), weak=False)
    counts = _Counts()
    task_prerun.connect(counts.begun, weak=False)
    task_postrun.connect(counts.ended, weak=False)


class _Counts:
    """Counts tasks as they begin and end, in the process that works on them."""

    def __init__(self) -> None:
        from prometheus_client import Counter, Gauge, Histogram

        self._begun = Counter("flaneur_tasks_begun", "Tasks that were begun", ["task"])
        self._ended = Counter(
            "flaneur_tasks",
            "Tasks that ended: done, failed, refused or withdrawn",
            ["task", "outcome"],
        )
        self._seconds = Histogram(
            "flaneur_task_seconds", "Seconds of a task that was done", ["task"], buckets=SECONDS
        )
        self._images = Counter("flaneur_images", "Images: extracted or skipped", ["outcome"])
        self._last = Gauge(
            "flaneur_last_lease_timestamp_seconds",
            "When a task was last begun or ended",
            multiprocess_mode="max",
        )

    def begun(self, task: Any, **_: object) -> None:
        self._begun.labels(_name(task)).inc()
        self._last.set(time.time())

    def ended(self, task: Any, state: str | None = None, retval: Any = None, **_: object) -> None:
        outcome = _outcome(state, retval)
        self._ended.labels(_name(task), outcome).inc()
        self._last.set(time.time())
        if outcome != "done":
            return
        self._seconds.labels(_name(task)).observe(retval["seconds"])
        if _name(task) == "extract":
            for kind, number in _images(retval["value"]["counts"]):
                self._images.labels(kind).inc(number)


class _Processes:
    """Told by the worker's main process."""

    def __init__(self, number: int) -> None:
        self._number, self._started = number, time.time()

    def collect(self) -> "Iterator[Metric]":
        from prometheus_client.core import GaugeMetricFamily

        yield GaugeMetricFamily(
            "flaneur_worker_processes", "Tasks that this worker does at a time", self._number
        )
        yield GaugeMetricFamily(
            "flaneur_worker_start_timestamp_seconds", "When the worker started", self._started
        )


def _images(counts: dict[str, int]) -> Iterator[tuple[str, int]]:
    yield "extracted", counts["images"]
    yield "skipped", counts["skipped"]


def _outcome(state: str | None, retval: Any) -> str:
    if state == "SUCCESS":
        return "refused" if "refused" in retval else "done"
    return "withdrawn" if state == "IGNORED" else "failed"


def _name(task: Any) -> str:
    return str(task.name).removeprefix("flaneur.")
