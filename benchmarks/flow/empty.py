"""A task that does nothing but what every task does: its envelope, its lease and its result."""

from celery import Celery

from workers import tasks
from workers.app import app
from workers.messages import Message
from workers.roots import Roots
from workers.server import point_at

N_PROCESSES = 2


class EmptyMessage(Message):
    index: str
    shard: int


def routed(app: Celery) -> None:
    """Send empty tasks to the queue of extraction."""
    app.conf.task_routes = {**app.conf.task_routes, "flaneur.empty": {"queue": "extract"}}


@tasks.task("empty", EmptyMessage)
def empty(request: EmptyMessage, _: Roots) -> dict[str, object]:
    """What a task of a job returns."""
    return {"stage": "empty", "key": f"{request.shard:06d}", "counts": {"images": 32}}


def work(url: str) -> None:
    """Work until told to stop."""
    point_at(app, url)
    routed(app)
    options = ("--loglevel=ERROR", "--without-gossip", "--without-mingle")
    app.worker_main(["worker", "--queues=extract", f"--concurrency={N_PROCESSES}", *options])
