"""A job's report in words."""

from collections.abc import Iterator

from coordinator.watching.report_records import JobReport

MOST = 20
"""Rows of a list that are told; report.json has all."""

TROUBLE_IN_WORDS = {
    "lost": "sent again, as their worker was not heard of any more",
    "refused": "refusals by workers",
    "failed": "failed",
    "given_up": "given up, as every process that began them died",
    "waiting": "times the broker was away",
    "alone": "times no worker listened",
}
"""By the kind of an event."""


def in_words(report: JobReport) -> str:
    """The whole report as plain text."""
    return "\n".join(_lines(report)) + "\n"


def in_brief(report: JobReport) -> list[str]:
    """Some lines for the end of a command: time by stage, and what went wrong."""
    stages = ", ".join(f"{each.stage} {duration(each.wall_s)}" for each in report.stages)
    lines = [f"Time by stage: {stages}"] if stages else []
    lines += [f"{number} {TROUBLE_IN_WORDS[kind]}" for kind, number in report.counts.items()]
    if sum(each.images for each in report.skipped) > MOST:  # fewer are named one by one
        lines += [f"{each.images:,} skipped: {each.reason}" for each in report.skipped[:3]]
    return lines


def duration(seconds: float) -> str:
    """Such as 3 d 4 h, 2 h 5 min, 1 min 30 s, 4.2 s."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    hours, minutes = divmod(minutes, 60)
    if hours < 48:
        return f"{hours} h {minutes} min"
    return f"{hours // 24} d {hours % 24} h"


def _lines(report: JobReport) -> Iterator[str]:
    speed = "" if report.images_per_s is None else f", {report.images_per_s:.2f} a second"
    yield f"Job {report.job} ({report.verb}), {report.images:,} images"
    yield f"{report.images_extracted:,} extracted{speed}; {duration(report.seconds)} in all"
    yield from _section("Runs", (_run(report, at) for at in range(len(report.runs))))
    commands = dict.fromkeys(run.command for run in report.runs if run.command)
    yield from _section("Commands", iter(commands))
    yield from _section(
        "Stages: tasks, time, and seconds of all tasks together",
        (
            f"{each.stage:8} {each.tasks:>9,}  {duration(each.wall_s):>12}  {each.task_s:,.1f} s"
            for each in report.stages
        ),
    )
    yield from _section(
        "Slowest",
        (
            f"{each.seconds:8.1f} s  {each.stage} {each.key}  {each.worker}"
            for each in report.slowest
        ),
    )
    yield from _section(
        "Skipped images by reason",
        (f"{each.images:,}  {each.reason}  (such as {each.example})" for each in report.skipped),
    )
    yield from _section(
        "Troubles",
        (f"{number:,} {TROUBLE_IN_WORDS[kind]}" for kind, number in report.counts.items()),
    )
    yield from _section(
        "The last of them",
        (
            f"{each.at}  {each.kind}  {each.task}  {each.worker}  {each.told}"
            for each in report.troubles
        ),
    )
    yield from _section(
        "Workers: tasks and seconds",
        (f"{each.worker}  {each.tasks:,}  {each.seconds:,.1f} s" for each in report.workers),
    )


def _run(report: JobReport, at: int) -> str:
    run = report.runs[at]
    how = run.how or ("killed" if at < len(report.runs) - 1 else "killed, or still at work")
    told = f": {run.told}" if run.told else ""
    return f"{run.begun_at}  {run.coordinator}  {duration(run.seconds)}  {how}{told}"


def _section(title: str, rows: Iterator[str]) -> Iterator[str]:
    told = [" ".join(row.splitlines()) for row in rows]
    if told:
        yield ""
        yield title
        yield from (f"  {row}".rstrip() for row in told[:MOST])
        if len(told) > MOST:
            yield f"  … and {len(told) - MOST} more in report.json"
