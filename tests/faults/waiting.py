"""Waiting for what must come."""

import time
from collections.abc import Callable

PATIENCE_S = 120.0


def wait_until(true: Callable[[], object], what: str) -> None:
    """Look again and again.

    Raises
    ------
    AssertionError : it does not come.
    """
    gives_up_at = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < gives_up_at, f"waited {PATIENCE_S:.0f} s in vain for {what}"
        time.sleep(0.01)
