"""`flaneur publish`: an index goes into an object store, where any machine can search it."""

import json
from pathlib import Path
from typing import Annotated

import typer

from contracts.errors import BadConfig
from contracts.places import Place
from coordinator.cli.lists import OwnIndex, given_place
from coordinator.cli.outputs import utf_8
from coordinator.cli.show import bars, tell

NAME = "publish"


def command(
    index: OwnIndex,
    url: Annotated[
        Place,
        typer.Argument(
            parser=given_place, metavar="URL", help="Where it goes, such as s3://bucket/town."
        ),
    ],
    as_json: Annotated[bool, typer.Option("--json", help="Report as JSON on stdout.")] = False,
) -> None:
    """Copy the live generation of an index into a store. Run again, it sends what is missing.

    Whoever searches there sees the former generation until the new one is there as a whole.
    Credentials and the address of the store come from the environment (AWS_ACCESS_KEY_ID,
    AWS_ENDPOINT_URL).
    """
    from index.store import publish

    if isinstance(url, Path):
        raise BadConfig(f"{url} is no URL; expected such as s3://bucket/town")
    with bars() as progress:
        done = publish(index.absolute(), url, progress)
    report = {
        "index": str(index.absolute()),
        "url": str(url),
        "generation": done.generation,
        "files": done.n_files,
        "bytes": done.n_bytes,
        "files_sent": done.n_sent,
        "bytes_sent": done.bytes_sent,
    }
    if as_json:
        typer.echo(utf_8(json.dumps(report, ensure_ascii=False)))
        return
    tell(
        f"{url}: generation {done.generation}, {done.n_files:,} files, {done.n_bytes:,} bytes; "
        f"{done.n_sent:,} files, {done.bytes_sent:,} bytes sent"
    )
