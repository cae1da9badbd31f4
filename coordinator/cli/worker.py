"""`flaneur worker`: work for a coordinator elsewhere."""

import logging
import os
import socket
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from contracts.errors import BadConfig
from coordinator.cli.announcing import HERE, MetricsAddress, MetricsPort
from coordinator.cli.lists import Broker, names
from coordinator.cli.show import complain, tell

if TYPE_CHECKING:
    from redis import Redis

NAME = "worker"

log = logging.getLogger(__name__)


def command(
    broker: Broker = None,
    queues: Annotated[
        str, typer.Option(help="Which work to take.")
    ] = "extract,train,assign,merge,locate",
    processes: Annotated[
        int | None, typer.Option(min=1, help="Processes; default: one a core.")
    ] = None,
    check: Annotated[
        bool,
        typer.Option("--check", help="Only say whether a worker of this machine is heard there."),
    ] = False,
    metrics_port: MetricsPort = None,
    metrics_address: MetricsAddress = HERE,
    with_parent: Annotated[bool, typer.Option("--with-parent", hidden=True)] = False,
) -> int:
    """Work for a coordinator; stop with Ctrl-C or SIGTERM: what is begun is finished first."""
    from coordinator.engine.broker import BROKER_VARIABLE, broker_url, check_broker
    from coordinator.engine.exposure import exposure
    from coordinator.engine.running import available_cores
    from workers.app import QUEUES
    from workers.metrics import serve_worker
    from workers.roots import roots_here
    from workers.run import run_worker, worker_environment
    from workers.task_logs import follow_celery

    url = broker_url(broker)
    if url is None:
        raise BadConfig(f"A worker needs --broker redis://… (or {BROKER_VARIABLE}).")
    unknown = set(names(queues)) - set(QUEUES)
    if unknown or not names(queues):
        raise BadConfig(f"--queues takes any of {','.join(QUEUES)}; got {queues!r}.")
    server = check_broker(url)
    if check:
        return _heard(server)
    environment = {**worker_environment(), BROKER_VARIABLE: url}
    if any(os.environ.get(name) != value for name, value in environment.items()):
        # Numeric libraries read these once, as they are imported: begin again with them set. And
        # the address may hold a password, which nobody shall read in a list of processes.
        os.environ.update(environment)
        arguments = _without_broker(sys.argv[1:])
        os.execv(sys.executable, [sys.executable, "-m", "coordinator.cli", *arguments])  # noqa: S606
    follow_celery()
    if exposed := exposure(url, server):
        log.warning(exposed)
    if not roots_here() and "socket" not in url:
        log.warning(
            "This worker has no FLANEUR_ROOT_...: it opens whatever path a message names. Name "
            "the folders it is meant for, such as FLANEUR_ROOT_ARCHIVE=/data/archive."
        )
    n_processes = processes or available_cores()
    if metrics_port is not None:
        serve_worker(metrics_port, metrics_address, n_processes)
    run_worker(
        url,
        names(queues),
        n_processes,
        with_parent=with_parent,
        name=f"flaneur-{os.getpid()}",
    )
    return 0


def _heard(server: "Redis") -> int:
    """0 if a worker of this machine is heard at the server."""
    from workers.presence import listening

    here = [each for each in listening(server) if each.host == socket.gethostname()]
    for each in here:
        queues = ", ".join(each.queues)
        tell(f"{each.name}: Flaneur {each.version}, {each.processes} processes, {queues}")
    if not here:
        complain(f"No worker of {socket.gethostname()} is heard.")
    return 0 if here else 1


def _without_broker(arguments: Sequence[str]) -> list[str]:
    kept = list(arguments)
    for at in reversed(range(len(kept))):
        if kept[at] == "--broker":
            del kept[at : at + 2]
        elif kept[at].startswith("--broker="):
            del kept[at]
    return kept
