"""Faults inside a process that nobody can produce from outside, heard at every file.

`FLANEUR_TEST_FAULTS` names a folder of switches, empty files that a test makes and removes:

- `slow`: opening, renaming and removing take 20 ms, as in a shared folder far away.
- `deadly/<name>`: who opens an image of that name is killed at once, as if out of memory.
- `hold/<folder>`: who begins to write below a folder of that name stays there (`held/<pid>`).
"""

import os
import select
import signal
import sys
import time

SWITCHES = os.environ.get("FLANEUR_TEST_FAULTS", "")
SLOW_S = 0.02
_busy = False


def _heed(event: str, arguments: tuple[object, ...]) -> None:
    global _busy
    if _busy or event not in ("open", "os.rename", "os.remove"):
        return
    path = arguments[0]
    if not isinstance(path, str) or path.startswith(("/proc/", "/sys/", SWITCHES)):
        return
    _busy = True
    try:
        _do(path)
    finally:
        _busy = False


def _do(path: str) -> None:
    name = os.path.basename(path)  # noqa: PTH119 - pathlib is not imported this early
    if os.path.exists(f"{SWITCHES}/deadly/{name}"):  # noqa: PTH110
        os.kill(os.getpid(), signal.SIGKILL)
    if os.path.exists(f"{SWITCHES}/slow"):  # noqa: PTH110
        time.sleep(SLOW_S)
    if name.startswith("."):  # the part of a file that is being written
        for folder in path.split("/")[1:-1]:
            _stay(f"{SWITCHES}/hold/{folder}")


def _stay(switch: str) -> None:
    if os.path.exists(switch):  # noqa: PTH110
        held = f"{SWITCHES}/held/{os.getpid()}"
        os.close(os.open(held, os.O_CREAT | os.O_WRONLY))
        while os.path.exists(switch):  # noqa: PTH110
            time.sleep(0.01)
        os.unlink(held)  # noqa: PTH108


if SWITCHES:
    sys.addaudithook(_heed)
if "FAKETIME" in os.environ:  # libfaketime refuses how `time.sleep` asks
    time.sleep = lambda seconds: select.select((), (), (), seconds)
