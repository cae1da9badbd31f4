"""What happens to orders, as lines of the log."""

import logging

from coordinator.following.events import Event, Kind
from workers.logs import about, logger

_LINES: dict[Kind, tuple[int, str]] = {
    "sent": (logging.DEBUG, "task sent"),
    "done": (logging.INFO, "task done"),
    "failed": (logging.ERROR, "task failed"),
    "lost": (
        logging.WARNING,
        "task lost: its worker was not heard of any more, so it is sent again",
    ),
    "refused": (logging.WARNING, "a worker refuses tasks"),
    "given_up": (logging.ERROR, "task given up: every process that began it died"),
    "paused": (logging.WARNING, "paused"),
    "resumed": (logging.WARNING, "goes on"),
    "waiting": (logging.WARNING, "the broker is away; waiting for it"),
    "back": (logging.WARNING, "the broker is back"),
    "alone": (
        logging.WARNING,
        "no worker listens; start one (flaneur worker): the work goes on with the first",
    ),
    "joined": (logging.WARNING, "a worker listens again"),
}


def log_event(event: Event) -> None:
    """Log what happened to an order: a `Listener`."""
    fields: dict[str, object] = {
        **(about(event.order.name, event.order.key) if event.order else {}),
        "by": event.worker,
        "seconds": round(event.seconds, 3),
        "error": event.told,
    }
    said = {name: value for name, value in fields.items() if value}
    level, line = _LINES[event.kind]
    logger().log(level, line, **said)
