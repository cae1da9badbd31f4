"""`flaneur worker`: work for a coordinator elsewhere."""

import os
import sys
from typing import Annotated

import typer

from contracts.errors import BadConfig
from coordinator.cli.lists import Broker, names

NAME = "worker"


def command(
    broker: Broker = None,
    queues: Annotated[
        str, typer.Option(help="Which work to take.")
    ] = "extract,train,assign,merge,locate",
    processes: Annotated[
        int | None, typer.Option(min=1, help="Processes; default: one a core.")
    ] = None,
    with_parent: Annotated[bool, typer.Option("--with-parent", hidden=True)] = False,
) -> None:
    """Work for a coordinator; stop with Ctrl-C: what is begun is finished first."""
    from coordinator.engine import BROKER_VARIABLE, available_cores, check_broker
    from workers.app import QUEUES
    from workers.run import run_worker, worker_environment

    url = broker or os.environ.get(BROKER_VARIABLE)
    if url is None:
        raise BadConfig(f"A worker needs --broker redis://… (or {BROKER_VARIABLE}).")
    unknown = set(names(queues)) - set(QUEUES)
    if unknown or not names(queues):
        raise BadConfig(f"--queues takes any of {','.join(QUEUES)}; got {queues!r}.")
    check_broker(url)
    if any(os.environ.get(name) != value for name, value in worker_environment().items()):
        # Numeric libraries read these once, as they are imported: begin again with them set.
        os.environ.update(worker_environment())
        os.execv(sys.executable, [sys.executable, "-m", "coordinator.cli", *sys.argv[1:]])  # noqa: S606
    run_worker(
        url,
        names(queues),
        processes or available_cores(),
        with_parent=with_parent,
        name=f"flaneur-{os.getpid()}",
    )
