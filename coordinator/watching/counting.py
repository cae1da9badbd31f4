"""What a coordinator counts, for Prometheus: its orders by stage."""

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram

from coordinator.following.events import Event
from workers.metrics import SECONDS

_ENDS = ("done", "failed", "given_up")


class OrderCounts:
    """Counts orders as it hears of them. registry : where Prometheus finds the counts."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self._flying: dict[str, set[str]] = {}
        self._events = Counter(
            "flaneur_orders",
            "Orders: sent, done, failed, lost (sent again), refused, given_up",
            ["stage", "event"],
            registry=self.registry,
        )
        self._in_flight = Gauge(
            "flaneur_orders_in_flight", "Sent, not back", ["stage"], registry=self.registry
        )
        self._total = Gauge(
            "flaneur_orders_planned", "Orders of a stage", ["stage"], registry=self.registry
        )
        self._before = Gauge(
            "flaneur_orders_done_before",
            "Those of them that earlier runs did",
            ["stage"],
            registry=self.registry,
        )
        self._seconds = Histogram(
            "flaneur_order_seconds",
            "Seconds of its task",
            ["stage"],
            buckets=SECONDS,
            registry=self.registry,
        )
        self._away = Gauge(
            "flaneur_broker_away", "1 while the broker is waited for", registry=self.registry
        )
        self._paused = Gauge("flaneur_paused", "1 while paused", registry=self.registry)

    def begin(self, stage: str, total: int, done: int) -> None:
        """A stage begins (contracts/progress.py)."""
        self._total.labels(stage).set(total)
        self._before.labels(stage).set(done)

    def hear(self, event: Event) -> None:
        """Count an event."""
        if event.kind in ("waiting", "back"):
            self._away.set(event.kind == "waiting")
        if event.kind in ("paused", "resumed"):
            self._paused.set(event.kind == "paused")
        if event.order is None:
            return
        stage = event.order.name
        self._events.labels(stage, event.kind).inc()
        flying = self._flying.setdefault(stage, set())
        if event.kind == "sent":  # for a second time too, after it was lost or refused
            flying.add(event.order.key)
        if event.kind in _ENDS:
            flying.discard(event.order.key)
        self._in_flight.labels(stage).set(len(flying))
        if event.kind == "done":
            self._seconds.labels(stage).observe(event.seconds)
