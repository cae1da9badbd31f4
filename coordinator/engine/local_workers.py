"""Workers of our own beside a coordinator: started, watched, started again, stopped."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from contracts.errors import TaskFailed
from workers.logs import VARIABLE as LOG_VARIABLE
from workers.roots import PREFIX
from workers.run import worker_environment

RESTARTS = 3


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
                env={LOG_VARIABLE: "text", **_without_roots(), **worker_environment()},
            )


def _without_roots() -> dict[str, str]:
    """Our environment. Our own workers see every path as we do: there is nothing to confine."""
    return {name: value for name, value in os.environ.items() if not name.startswith(PREFIX)}


def _end(process: subprocess.Popen[bytes]) -> None:
    """Kill what is left of a worker and its pool."""
    with suppress(ProcessLookupError):  # all of them have ended
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    if process.stdin is not None:
        process.stdin.close()
