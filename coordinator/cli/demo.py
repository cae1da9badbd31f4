"""`flaneur demo`: the whole of Flaneur in under three minutes, on a town of its own."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from coordinator.cli.lists import Workers
from coordinator.cli.show import bars, stdout

if TYPE_CHECKING:
    from coordinator.demo import Answer, DemoReport

NAME = "demo"


def command(
    out: Annotated[Path, typer.Option(help="Folder for the survey, the index and results.")] = Path(
        "demo-out"
    ),
    workers: Workers = None,
) -> None:
    """Render a small town, index it, and locate old photos of it."""
    from coordinator.demo import run_demo
    from coordinator.engine.running import running_engine

    started = time.perf_counter()
    with running_engine(None, workers) as engine, bars() as progress:
        report = run_demo(out, engine, progress)
    stdout.print(_table(report))
    stdout.print(_summary(report, time.perf_counter() - started), markup=False, soft_wrap=True)


def _table(report: "DemoReport") -> Table:
    table = Table(title="Where was it taken? Metres from the truth; * = on the right facade")
    for name in ("query", "style", "detectors", "k"):
        table.add_column(name, no_wrap=True)
    for name in ("Flaneur", "bag of words", "random"):
        table.add_column(name, justify="right", no_wrap=True)
    for row in report.rows:
        ours = row.flaneur
        table.add_row(
            row.query.file.split("-")[0],
            row.query.style,
            "-".join(ours.detectors),
            str(ours.k),
            *(_cell(answer) for answer in (ours, row.plain, row.chance)),
        )
    return table


def _cell(answer: "Answer") -> str:
    metres = "no answer" if answer.metres is None else f"{answer.metres:.1f} m"
    cell = f"{metres} {'*' if answer.right_facade else ' '}"
    return f"[green]{cell}[/green]" if answer.right else cell


def _summary(report: "DemoReport", seconds: float) -> str:
    from coordinator.demo import RIGHT_WITHIN_M, share_right

    rows, generation = report.rows, report.index.generation
    right = [
        share_right(rows, lambda row: row.flaneur),
        share_right(rows, lambda row: row.plain),
        share_right(rows, lambda row: row.chance),
    ]
    return (
        f"Within {RIGHT_WITHIN_M:.0f} m and on the right facade: "
        f"Flaneur {right[0]} of {len(rows)}, bag of words {right[1]}, random {right[2]}.\n"
        f"{generation.n_live} images indexed, {report.index.images_extracted} of them now, "
        f"{report.index.bytes_on_disk / max(generation.n_live, 1):,.0f} bytes an image; "
        f"{report.seconds_per_photo:.2f} s a photo; {seconds:.0f} s in all.\n"
        f"Open {report.page} in a browser, and {report.geopackage} in QGIS."
    )
