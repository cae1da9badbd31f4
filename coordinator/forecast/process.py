"""What this process holds and waits for, as Linux tells it; other systems do not."""

from dataclasses import dataclass
from pathlib import Path

_STATUS = Path("/proc/self/status")
_FORGET = Path("/proc/self/clear_refs")
_SCHEDULED = Path("/proc/self/schedstat")
_KIB = 1024


@dataclass(frozen=True, slots=True)
class Held:
    """Bytes of memory. own : shared with no process that this one did not start. mapped : of
    files, mostly compiled libraries, which all processes of a machine share. peak : of both
    together, the most since `forget_peak`."""

    own: int
    mapped: int
    peak: int


def held() -> Held | None:
    """What the process holds at this moment; None where the system does not say."""
    if not _STATUS.exists():
        return None
    lines = (line.partition(":") for line in _STATUS.read_text().splitlines())
    fields = {name: value for name, _, value in lines}
    own, mapped, peak = (
        int(fields[name].split()[0]) * _KIB for name in ("RssAnon", "RssFile", "VmHWM")
    )
    return Held(own, mapped, peak)


def forget_peak() -> None:
    """Let the peak count from now on, where the system can do that."""
    if _FORGET.exists():
        _FORGET.write_text("5")  # man 5 proc_pid_clear_refs: resets the peak resident set size


def waited_for_a_core_s() -> float:
    """Seconds that this thread was ready to run while others ran; 0 where it is not told."""
    if not _SCHEDULED.exists():
        return 0.0
    return int(_SCHEDULED.read_text().split()[1]) * 1e-9
