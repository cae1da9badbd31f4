"""How fast work goes: over the last minutes, and at least over its last twenty pieces."""

import time
from collections import deque
from collections.abc import Callable

WINDOW_S = 600.0
AT_LEAST = 20
_TOGETHER_S = 1.0
"""Pieces that end within it are kept as one: their number in the window stays bounded."""


class Pace:
    """Counts pieces of work as they end. clock : seconds, such as `time.monotonic`."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._since = clock()
        self._ended: deque[tuple[float, int]] = deque()

    def add(self, number: int = 1) -> None:
        """So many ended now."""
        now = self._clock()
        if self._ended and now - self._ended[-1][0] < _TOGETHER_S:
            at, before = self._ended.pop()
            self._ended.append((at, before + number))
        else:
            self._ended.append((now, number))
        while len(self._ended) > AT_LEAST and now - self._ended[0][0] > WINDOW_S:
            self._since, _ = self._ended.popleft()

    def per_s(self) -> float | None:
        """Pieces a second; None: not one has ended yet."""
        number = sum(number for _, number in self._ended)
        passed = self._clock() - self._since
        return number / passed if number and passed > 0 else None

    def left_s(self, number: int) -> float | None:
        """Seconds that `number` more will take if it goes on so; None: nobody can tell."""
        if number == 0:
            return 0.0
        per_s = self.per_s()
        return None if per_s is None else number / per_s
