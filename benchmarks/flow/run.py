"""Print all figures of following."""

from pathlib import Path

from benchmarks.flow import broker, memory

N_TASKS = 60_000
N_ORDERS = 1_000_000


def run(_: Path) -> None:
    """Empty tasks through Celery, then orders without a broker."""
    broker.run(N_TASKS)
    memory.run(N_ORDERS)
