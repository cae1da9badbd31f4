"""The Celery app: JSON only, one message at a time, acknowledged when the work is done."""

from celery import Celery
from kombu.entity import Exchange, Queue

from workers.server import point_at

QUEUES = ("extract", "train", "assign", "merge", "locate")
LOWEST_PRIORITY = 9
"""Whatever is sent by priority 0 is begun before all others, in every queue."""
SEPARATOR = ":"
"""Between the name of a queue and a priority: the key of its list of messages."""
VISIBILITY_TIMEOUT_S = 6 * 3600
"""Only the last resort: lost work is noticed by its lease, long before (workers/lease.py)."""
LOST_WAIT_S = 0.5
"""Between the death of a process and another's beginning its task anew."""
MEMORY_CAP_KIB = 4 * 1024 * 1024
"""A process above this is replaced after its task."""


def queue_key(queue: str, priority: int) -> str:
    """The list where the server keeps messages of a priority."""
    return f"{queue}{SEPARATOR}{priority}" if priority else queue


def make_app(broker_url: str | None = None) -> Celery:
    """An app for a server: redis://, rediss:// or a redis+socket:// path."""
    app = Celery("flaneur", include=["workers.tasks"])
    app.conf.update(
        accept_content=["json"],
        task_serializer="json",
        result_serializer="json",
        result_accept_content=["json"],
        task_queues=[Queue(name, Exchange(name), routing_key=name) for name in QUEUES],
        task_routes={
            **{f"flaneur.{name}": {"queue": name} for name in QUEUES},
            "flaneur.probe": {"queue": "extract"},
            "flaneur.join": {"queue": "merge"},
            "flaneur.judge": {"queue": "locate"},
            "flaneur.rehearse": {"queue": "locate"},
        },
        task_create_missing_queues=False,
        task_acks_late=True,
        task_reject_on_worker_lost=True,
        worker_prefetch_multiplier=1,
        worker_lost_wait=LOST_WAIT_S,
        worker_max_memory_per_child=MEMORY_CAP_KIB,
        worker_send_task_events=False,
        broker_transport_options={
            "visibility_timeout": VISIBILITY_TIMEOUT_S,
            "priority_steps": list(range(LOWEST_PRIORITY + 1)),
            "sep": SEPARATOR,
        },
        result_expires=24 * 3600,
        result_backend_always_retry=True,
        timezone="UTC",
        enable_utc=True,
    )
    if broker_url is not None:
        point_at(app, broker_url)
    return app


app = make_app()
"""The app that tasks are registered with; `run_worker` points it at its server."""
