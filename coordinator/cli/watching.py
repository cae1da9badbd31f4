"""`flaneur status --watch`: jobs and batches as they go, until Ctrl-C."""

import json
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

import typer
from redis import RedisError
from rich.console import Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from coordinator.cli.outputs import utf_8
from coordinator.cli.show import stdout
from coordinator.export.harmless import harmless
from coordinator.watching.lines import in_one_line, to_go_on, who_is_there
from coordinator.watching.seeing import Seen, Sight

EVERY_S = 2.0
PLAIN_EVERY_S = 10.0
MOST_WORKERS = 20
IDLE = "Nothing is at work, and nothing was."


def watch(root: Path, present: Callable[[], str | None], as_json: bool) -> None:
    """Show how the jobs of an index go, until Ctrl-C.

    present : a line on who listens at the broker. as_json : a line a look.
    """
    sight = Sight(root)
    with suppress(KeyboardInterrupt):
        if as_json:
            _watch_json(sight)
        elif stdout.is_terminal:
            _watch_live(root, sight, present)
        else:
            _watch_plain(root, sight, present)


def present_at(broker: str | None) -> Callable[[], str | None]:
    """Asks, each time it is called, who listens at a broker; None: no broker is given.

    Raises
    ------
    BrokerUnreachable : it does not answer now.
    """
    if broker is None:
        return lambda: None
    from coordinator.engine.broker import check_broker
    from workers.presence import listening

    server = check_broker(broker)

    def ask() -> str:
        try:
            return who_is_there(listening(server))
        except RedisError as error:
            return f"the broker does not answer ({error})"

    return ask


def _watch_live(root: Path, sight: Sight, present: Callable[[], str | None]) -> None:
    with Live(console=stdout, auto_refresh=False, screen=False) as live:
        while True:
            live.update(_drawn(root, sight.look(), present()), refresh=True)
            time.sleep(EVERY_S)


def _watch_plain(root: Path, sight: Sight, present: Callable[[], str | None]) -> None:
    told: list[str] = []
    while True:
        lines = [*_lines(root, sight.look()), *filter(None, [present()])]
        for line in lines:
            if line not in told:
                typer.echo(utf_8(harmless(f"{time.strftime('%H:%M:%S')} {line}")))
        told = lines
        time.sleep(PLAIN_EVERY_S)


def _watch_json(sight: Sight) -> None:
    while True:
        jobs = [
            {**asdict(each.progress), "died": each.died, "quiet_s": round(each.quiet_s, 1)}
            for each in sight.look()
        ]
        typer.echo(utf_8(json.dumps({"jobs": jobs}, ensure_ascii=False)))
        time.sleep(EVERY_S)


def _lines(root: Path, seen: Sequence[Seen]) -> list[str]:
    if not seen:
        return [IDLE]
    told = ((in_one_line(each), to_go_on(each, root)) for each in seen)
    return [line for pair in told for line in pair if line]


def _drawn(root: Path, seen: Sequence[Seen], present: str | None) -> Group:
    shown: list[RenderableType] = [Text(IDLE)] if not seen else []
    for each in seen:
        shown += [Text(harmless(in_one_line(each)), style="bold"), _bars(each)]
        advice = to_go_on(each, root)
        if advice:
            shown.append(Text(harmless(advice), style="red"))
        shown += [_at_work(each)] if each.is_at_work else []
        shown.append(Text(""))
    shown += [Text(harmless(present))] if present else []
    return Group(*shown)


def _bars(seen: Seen) -> Table:
    table = Table.grid(padding=(0, 1))
    for stage in seen.progress.stages:
        bar = ProgressBar(total=max(stage.total, 1), completed=stage.done, width=40)
        table.add_row(Text(f"  {stage.name:8}"), bar, Text(f"{stage.done:,}/{stage.total:,}"))
    return table


def _at_work(seen: Seen) -> Table:
    table = Table.grid(padding=(0, 2))
    for each in seen.progress.workers[:MOST_WORKERS]:
        table.add_row(Text(f"  {harmless(each.worker)}"), Text(harmless(each.task)))
    more = len(seen.progress.workers) - MOST_WORKERS
    if more > 0:
        table.add_row(Text(f"  … and {more} more"))
    return table
