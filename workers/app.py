"""The Celery app: JSON only, one message at a time, acknowledged when the work is done."""

from celery import Celery
from kombu.entity import Exchange, Queue

QUEUES = ("extract", "train", "assign", "merge", "locate")
VISIBILITY_TIMEOUT_S = 6 * 3600
"""Only the last resort: lost work is noticed by its lease, long before (workers/lease.py)."""
MEMORY_CAP_KIB = 4 * 1024 * 1024
"""A process above this is replaced after its task."""


def make_app(broker_url: str | None = None) -> Celery:
    """An app for a server: redis://, rediss:// or a redis+socket:// path."""
    app = Celery("flaneur", broker=broker_url, backend=broker_url, include=["workers.tasks"])
    app.conf.update(
        accept_content=["json"],
        task_serializer="json",
        result_serializer="json",
        result_accept_content=["json"],
        task_queues=[Queue(name, Exchange(name), routing_key=name) for name in QUEUES],
        task_routes={
            **{f"flaneur.{name}": {"queue": name} for name in QUEUES},
            "flaneur.join": {"queue": "merge"},
            "flaneur.judge": {"queue": "locate"},
            "flaneur.rehearse": {"queue": "locate"},
        },
        task_create_missing_queues=False,
        task_acks_late=True,
        task_reject_on_worker_lost=True,
        worker_prefetch_multiplier=1,
        worker_max_memory_per_child=MEMORY_CAP_KIB,
        worker_send_task_events=False,
        broker_connection_retry_on_startup=True,
        broker_transport_options={"visibility_timeout": VISIBILITY_TIMEOUT_S, "socket_timeout": 30},
        result_expires=24 * 3600,
        timezone="UTC",
        enable_utc=True,
    )
    return app


app = make_app()
"""The app that tasks are registered with; `run_worker` points it at its server."""
