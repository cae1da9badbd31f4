"""A worker's lines: of every task as it begins and ends, with its job, stage and shard."""

import logging
import sys
from collections.abc import Mapping
from typing import Any

import structlog
from celery.signals import (
    setup_logging,
    task_failure,
    task_postrun,
    task_prerun,
    worker_ready,
    worker_shutting_down,
)
from celery.utils.log import get_multiprocessing_logger

from workers.logs import about, install, logger, style

_IDS = ("job", "query")
"""Fields of messages that say more of what a task is about than its own id does."""


def follow_celery() -> None:
    """Let Celery's own lines go the same way, and tell of every task as it begins and ends."""
    chosen = style("text" if sys.stderr.isatty() else "json")
    install(chosen)
    logging.captureWarnings(True)
    setup_logging.connect(_take_over, weak=False)
    worker_ready.connect(lambda **_: logger().info("worker ready"), weak=False)
    worker_shutting_down.connect(lambda **_: logger().info("worker ends"), weak=False)
    task_prerun.connect(_begun, weak=False)
    task_failure.connect(_failed, weak=False)
    task_postrun.connect(_ended, weak=False)


def _take_over(**_: object) -> None:
    """Celery puts in no handlers where this is connected; its pool's logger goes its own way."""
    get_multiprocessing_logger().propagate = True


def _begun(task_id: str, task: Any, args: Any = (), **_: object) -> None:
    ids = {name: value for name, value in _message(args).items() if name in _IDS}
    key = task_id.split(".", 3)[-1]  # run, number, name, key: coordinator/following/flow.py
    structlog.contextvars.clear_contextvars()
    structlog.contextvars.bind_contextvars(
        **ids, **about(task.name.removeprefix("flaneur."), key), task_id=task_id
    )
    logger().info("task begun")


def _failed(exception: BaseException, **_: object) -> None:
    logger().error("task failed", error=f"{type(exception).__name__}: {exception}")


def _ended(state: str | None = None, retval: Any = None, **_: object) -> None:
    if state == "SUCCESS":
        seconds = round(retval["seconds"], 3)
        if refused := retval.get("refused"):
            logger().warning("task refused", error=refused, seconds=seconds)
        else:
            logger().info("task done", seconds=seconds)
    elif state == "IGNORED":
        logger().info("task withdrawn")
    structlog.contextvars.clear_contextvars()


def _message(args: Any) -> Mapping[str, Any]:
    envelope = args[0] if args else None
    message = envelope.get("message") if isinstance(envelope, dict) else None
    return message if isinstance(message, dict) else {}
