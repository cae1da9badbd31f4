"""What happens to orders, as lines of the log."""

import logging

from coordinator.following.events import Event, Kind
from workers.logs import about, logger

_LEVELS: dict[Kind, int] = {
    "sent": logging.DEBUG,
    "done": logging.INFO,
    "failed": logging.ERROR,
    "lost": logging.WARNING,
    "refused": logging.WARNING,
    "given_up": logging.ERROR,
    "paused": logging.WARNING,
    "resumed": logging.WARNING,
    "waiting": logging.WARNING,
    "back": logging.WARNING,
}

_SAID: dict[Kind, str] = {
    "sent": "task sent",
    "done": "task done",
    "failed": "task failed",
    "lost": "task lost: its worker was not heard of any more, so it is sent again",
    "refused": "a worker refuses tasks",
    "given_up": "task given up: every process that began it died",
    "paused": "paused",
    "resumed": "goes on",
    "waiting": "the broker is away; waiting for it",
    "back": "the broker is back",
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
    logger().log(_LEVELS[event.kind], _SAID[event.kind], **said)
