"""Running a worker: threads, caches and warm kernels first, then Celery's own loop."""

import os
import resource
import signal
import socket
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from celery.signals import worker_shutting_down
from redis import RedisError

from workers.presence import Presence, announce
from workers.server import connect, point_at

THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)


def worker_environment() -> dict[str, str]:
    """Environment of a worker: one thread a process, kernels cached where a user may write.

    Set before numpy, faiss or numba are imported, for they read it once.
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "flaneur" / "numba"
    return {
        **dict.fromkeys(THREAD_VARIABLES, "1"),
        "NUMBA_CACHE_DIR": os.environ.get("NUMBA_CACHE_DIR", str(cache)),
    }


def run_worker(
    broker_url: str, queues: Sequence[str], n_processes: int, *, with_parent: bool, name: str
) -> None:
    """Work until told to stop. with_parent : stop, server and all, when stdin closes."""
    # Every mapped array holds a file: an index of many segments has more than the usual 1,024.
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))
    import cv2
    import faiss

    from retrieval.features import compile_kernels
    from retrieval.warm import compile_search_kernels
    from workers import tasks  # noqa: F401 - registers the tasks before processes are forked
    from workers.app import app
    from workers.messages import our_version

    cv2.setNumThreads(1)
    faiss.omp_set_num_threads(1)
    compile_kernels()
    compile_search_kernels()
    point_at(app, broker_url)
    announce(
        connect(broker_url),
        Presence(
            name=f"{name}@{socket.gethostname()}",
            host=socket.gethostname(),
            pid=os.getpid(),
            processes=n_processes,
            queues=tuple(queues),
            version=our_version(),
        ),
    )
    worker_shutting_down.connect(_be_ended_by_the_next, weak=False)
    if with_parent:
        threading.Thread(target=_stop_with_parent, args=(broker_url,), daemon=True).start()
    app.worker_main(
        [
            "--quiet",  # no banner among the lines of the log
            "worker",
            f"--queues={','.join(queues)}",
            f"--concurrency={n_processes}",
            f"--hostname={name}@%h",
            "--loglevel=WARNING",
            "--without-gossip",
            "--without-mingle",
        ]
    )


def _be_ended_by_the_next(how: str, **_: object) -> None:
    """A second SIGTERM ends what the first lets finish; Celery would not heed it."""
    if how == "Warm":
        signal.signal(signal.SIGTERM, signal.getsignal(signal.SIGQUIT))


def _stop_with_parent(broker_url: str) -> None:
    """A coordinator that was killed closes our stdin: end its server, and with it ourselves."""
    while os.read(0, 1):  # unbuffered: forked processes close sys.stdin, whose lock we would hold
        pass
    with suppress(RedisError):  # already gone
        connect(broker_url).shutdown(nosave=True)
    os.killpg(os.getpgid(0), signal.SIGKILL)
