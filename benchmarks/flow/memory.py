"""Orders that are followed with a courier in memory: what the bookkeeping alone costs."""

import resource
import subprocess
import sys
import time
from collections import deque
from collections.abc import Iterator, Mapping

from benchmarks.table import print_table
from coordinator.following.carrying import Landing, Sighting
from coordinator.following.events import Order, unheard
from coordinator.following.flow import Ears, Flow, Terms

IN_FLIGHT = 2560
"""40 machines of 16 processes."""


class MemoryCourier:
    """Every order is done as soon as it is looked for."""

    def __init__(self, room: int) -> None:
        self._room = room
        self._sent: deque[str] = deque()
        self.longest = 0

    def room(self) -> int:
        return self._room

    def send(self, orders: Mapping[str, Order]) -> None:
        self._sent += orders
        self.longest = max(self.longest, len(self._sent))

    def landed(self, wait_s: float) -> list[Landing]:
        landings = [Landing(task_id, "done", {}, worker="here") for task_id in self._sent]
        self._sent.clear()
        return landings

    def look(self, orders: Mapping[str, Order]) -> tuple[list[Landing], dict[str, Sighting]]:
        return self.landed(0.0), {}

    def withdraw(self) -> None:
        self._sent.clear()


def shards(n: int) -> Iterator[Order]:
    """As many orders as a survey has shards, each made when it is asked for."""
    for shard in range(n):
        yield Order("extract", f"{shard:06d}", {"index": "/data/index", "shard": shard})


def follow(n: int, room: int = IN_FLIGHT) -> tuple[int, int]:
    """Follow `n` orders; returns how many came back, and how many were in flight at most."""
    courier = MemoryCourier(room)
    ears = Ears(wish=lambda: "run", listen=unheard, watch=lambda: None)
    flow = Flow(courier, "flow", Terms(), ears)
    return sum(1 for _ in flow.outcomes(shards(n))), courier.longest


def run(n: int) -> None:
    """In a process of its own, so that its memory is that of following alone."""
    command = [sys.executable, "-m", "benchmarks.flow.memory", str(n)]
    subprocess.run(command, check=True)


def main() -> None:
    n = int(sys.argv[1])
    began = time.perf_counter()
    came, longest = follow(n)
    seconds = time.perf_counter() - began
    head = ("orders", "came back", "in flight at most", "orders/s", "peak RSS MiB")
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    row = (f"{n:,}", f"{came:,}", f"{longest:,}", f"{came / seconds:,.0f}", f"{peak_mib:.0f}")
    print_table(head, [row])


if __name__ == "__main__":
    main()
