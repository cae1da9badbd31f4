"""What is told of work as it happens, on stderr: one JSON object a line, or text for people.

FLANEUR_LOG=json|text chooses. Passwords in addresses are hidden, whoever logs them.
"""

import logging
import os
import re
import sys
from collections.abc import MutableMapping
from typing import Any, Literal, TextIO

import structlog

from contracts.errors import BadConfig

VARIABLE = "FLANEUR_LOG"
Style = Literal["json", "text"]
OURS = "flaneur"
"""The logger of all that Flaneur itself tells; of others, such as Celery, warnings are told."""

_PASSWORD = re.compile(r"(?<=://)[^\s'\"]*(?=@)|(?<=password=)[^&\s'\"]+")
_OF_SHARDS = ("extract", "probe", "assign")

Event = MutableMapping[str, Any]


def style(otherwise: Style) -> Style:
    """How FLANEUR_LOG asks for lines.

    Raises
    ------
    BadConfig : it asks for something else.
    """
    asked = os.environ.get(VARIABLE) or otherwise
    if asked in ("json", "text"):
        return "json" if asked == "json" else "text"
    raise BadConfig(f"{VARIABLE} takes json or text; got {asked!r}.")


def about(stage: str, key: str) -> dict[str, str]:
    """How lines name what a task is about."""
    return {"stage": stage, "shard" if stage in _OF_SHARDS else "key": key}


def logger() -> structlog.stdlib.BoundLogger:
    """What Flaneur tells its lines to: `logger().warning("what happened", job=…)`."""
    made: structlog.stdlib.BoundLogger = structlog.wrap_logger(
        logging.getLogger(OURS),
        processors=[
            structlog.stdlib.filter_by_level,
            *_DESCRIBED,
            structlog.stdlib.ProcessorFormatter.wrap_for_formatter,
        ],
        wrapper_class=structlog.stdlib.BoundLogger,
        context_class=dict,
    )
    return made


def install(chosen: Style, level: int = logging.INFO) -> None:
    """From now on all lines of this process, Celery's too, go to stderr in this style.

    level : of our own lines.
    """
    formatter = structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=[*_DESCRIBED, structlog.stdlib.ExtraAdder()],
        processors=[
            structlog.stdlib.ProcessorFormatter.remove_processors_meta,
            structlog.processors.format_exc_info,
            _without_passwords,
            structlog.processors.JSONRenderer() if chosen == "json" else _in_words,
        ],
    )
    handler = _ToStderr()
    handler.setFormatter(formatter)
    root = logging.getLogger()
    root.handlers = [handler]
    root.setLevel(logging.WARNING)
    logging.getLogger(OURS).setLevel(level)


class _ToStderr(logging.StreamHandler[TextIO]):
    """Looks for stderr at every line: a progress bar may stand in for it."""

    def __init__(self) -> None:
        logging.Handler.__init__(self)

    @property
    def stream(self) -> TextIO:  # type: ignore[override]
        return sys.stderr


def _without_passwords(_: object, __: str, event: Event) -> Event:
    ordered = {**dict.fromkeys(("at", "level", "event")), **event}
    return {name: _hidden(value) for name, value in ordered.items()}


def _hidden(value: object) -> object:
    return _PASSWORD.sub("***", value) if isinstance(value, str) else value


def _in_words(_: object, __: str, event: Event) -> str:
    """A line for people: the time of day, what happened, and its particulars."""
    at, level = str(event.pop("at", ""))[11:19], event.pop("level", "info")
    event.pop("logger", None)
    event.pop("worker", None)
    said, raised = event.pop("event", ""), event.pop("exception", "")
    particulars = " ".join(f"{name}={value}" for name, value in event.items())
    line = f"{at} {level}: {said}  {particulars}".rstrip()
    told = f"{line}\n{raised}" if raised else line
    return "".join(char if char.isprintable() or char == "\n" else "\ufffd" for char in told)


def _who(_: object, __: str, event: Event) -> Event:
    from workers.lease import who

    return {"worker": who(), **event}


_DESCRIBED: list[structlog.typing.Processor] = [
    structlog.contextvars.merge_contextvars,
    structlog.stdlib.add_log_level,
    structlog.stdlib.add_logger_name,
    structlog.processors.TimeStamper(fmt="iso", utc=True, key="at"),
    _who,
]
