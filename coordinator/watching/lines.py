"""How a job goes, in words: lines for people, the same on a terminal and in a file."""

from collections.abc import Sequence
from pathlib import Path

from coordinator.watching.progress import JobProgress
from coordinator.watching.seeing import QUIET_S, Seen
from coordinator.watching.telling import duration
from workers.presence import Presence

UNKNOWN = "unknown"


def in_one_line(seen: Seen) -> str:
    """Where it stands, how fast it goes, and what went wrong."""
    at = seen.progress
    parts = [f"{at.verb} {at.job}", _state(seen), _stage(at)]
    parts.append(f"{at.images_done:,} of {at.images:,} images" if at.images else "")
    if seen.is_at_work:
        parts += [_speed(at), _left(at), f"{len(at.workers)} workers at it"]
    parts += [f"{number:,} {what}" for what, number in _wrong(at).items() if number]
    return ", ".join(part for part in parts if part)


def to_go_on(seen: Seen, root: Path) -> str | None:
    """What to do about a job that nobody works on; None: nothing."""
    at = seen.progress
    if seen.is_at_work or at.state == "finished":
        return None
    why = f"{at.told}. " if at.told and not seen.died else ""
    if at.verb == "batch":
        return f"{why}To go on: flaneur batch resume {at.job} --index {root}"
    return f"{why}To go on, run the same command again: {at.command or f'flaneur {at.verb} …'}"


def who_is_there(present: Sequence[Presence]) -> str:
    """The workers that listen at a broker."""
    if not present:
        return "no worker listens at the broker"
    hosts = len({each.host for each in present})
    processes = sum(each.processes for each in present)
    versions = ", ".join(sorted({each.version for each in present}))
    return f"{len(present)} workers on {hosts} hosts, {processes} processes, Flaneur {versions}"


def _state(seen: Seen) -> str:
    at = seen.progress
    if seen.died:
        return f"stopped without a word (process {at.pid} on {at.host}; last heard {at.updated_at})"
    if at.state == "waiting":
        return f"waits for the broker ({at.told})" if at.told else "waits for the broker"
    if at.state == "alone":
        return "waits for a worker: none listens"
    quiet = seen.is_at_work and seen.quiet_s > QUIET_S
    return f"{at.state}, silent for {duration(seen.quiet_s)}" if quiet else at.state


def _stage(at: JobProgress) -> str:
    stage = next((each for each in at.stages if each.name == at.stage), None)
    if stage is None or at.state == "finished":
        return ""
    return f"{stage.name} {stage.done:,} of {stage.total:,}"


def _speed(at: JobProgress) -> str:
    return "" if at.images_per_s is None else f"{at.images_per_s:.2f} images/s"


def _left(at: JobProgress) -> str:
    """An honest answer: the stage by its own pace, the whole job only where that is known."""
    if at.stage_left_s is None:
        return f"time left {UNKNOWN}"
    if at.left_s is None:
        return f"{duration(at.stage_left_s)} left of {at.stage}, of the job {UNKNOWN}"
    return f"{duration(at.left_s)} left"


def _wrong(at: JobProgress) -> dict[str, int]:
    return {
        "images skipped": at.skipped,
        "lost and sent again": at.lost,
        "workers refused": at.refused,
        "failed": at.failed,
    }
