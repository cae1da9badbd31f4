"""What a person wishes of a job or a batch that is at work: go on, pause, or be cancelled.

It lies in a file of the job's own folder: any machine that sees the folder can say it, and a
broker that loses its data does not lose it.
"""

import json
from pathlib import Path
from typing import Literal, get_args

from index.files import read_text_file, write_bytes

Wish = Literal["run", "pause", "cancel"]


def read_wish(folder: Path) -> Wish:
    """What is wished of the work in `folder`; where nothing (readable) is said: run."""
    try:
        wish = json.loads(read_text_file(_path(folder))).get("wish")
    except (OSError, ValueError, AttributeError):
        return "run"
    return wish if wish in get_args(Wish) else "run"


def write_wish(folder: Path, wish: Wish) -> None:
    """Say what is wished; whoever is at work there heeds it within seconds."""
    write_bytes(_path(folder), json.dumps({"wish": wish}).encode())


def begin_again(folder: Path) -> None:
    """Whoever starts the work wishes it to run, whatever was wished before."""
    if read_wish(folder) != "run":
        write_wish(folder, "run")


def _path(folder: Path) -> Path:
    return folder / "control.json"
