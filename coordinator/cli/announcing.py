"""What a verb that follows a job shows, logs and counts."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from contracts.progress import Progress
from coordinator.cli.show import bars, tell

if TYPE_CHECKING:  # prometheus_client and pydantic are imported when a verb runs
    from coordinator.following.events import Event, Listener
    from coordinator.watching.counting import OrderCounts
    from index.jobs import JobFolder

MetricsPort = Annotated[
    int | None,
    typer.Option(
        min=1,
        max=65535,
        metavar="PORT",
        help="Show counts for Prometheus at http://ADDRESS:PORT/metrics while it works.",
    ),
]
MetricsAddress = Annotated[
    str,
    typer.Option(metavar="ADDRESS", help="Where --metrics-port listens; 0.0.0.0: on all networks."),
]
HERE = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class Announced:
    """progress : to be told how far stages are. listen : to be told what happens to orders."""

    progress: Progress
    listen: "Listener"


@contextmanager
def announced(metrics_port: int | None, metrics_address: str) -> Iterator[Announced]:
    """Show, log and count what is told to it while the block runs.

    Raises
    ------
    BadConfig : the port is taken, or FLANEUR_LOG asks for what is not known.
    """
    from coordinator.watching.counting import OrderCounts
    from coordinator.watching.logged import log_event
    from workers.logs import install, style
    from workers.metrics import serve

    chosen = style("text")
    install(chosen, logging.INFO if chosen == "json" else logging.WARNING)
    counts = OrderCounts()
    server = serve(counts.registry, metrics_port, metrics_address) if metrics_port else None

    def listen(event: "Event") -> None:
        log_event(event)
        counts.hear(event)

    try:
        with bars() as shown:
            yield Announced(_Counted(shown, counts), listen)
    finally:
        if server is not None:
            server.shutdown()
            server.server_close()


def tell_what_it_did(job: "JobFolder") -> None:
    """Some lines of a job's report, and where the rest is."""
    from coordinator.watching.report import report_of
    from coordinator.watching.telling import in_brief

    for line in in_brief(report_of(job)):
        tell(line)
    tell(f"All of it: flaneur job report {job.root} {job.job}")


class _Counted:
    """Shows how far stages are, and counts their orders."""

    def __init__(self, shown: Progress, counts: "OrderCounts") -> None:
        self._shown, self._counts = shown, counts

    def begin(self, stage: str, total: int, done: int) -> None:
        self._counts.begin(stage, total, done)
        self._shown.begin(stage, total, done)

    def advance(self, stage: str) -> None:
        self._shown.advance(stage)
