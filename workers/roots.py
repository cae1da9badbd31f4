"""Roots: folders and object stores that may be mounted elsewhere on every machine.

`FLANEUR_ROOT_ARCHIVE=/data/archive` says where this machine has what all call ARCHIVE. A worker
that has any root opens nothing outside them.
"""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from contracts.errors import Refused

PREFIX = "FLANEUR_ROOT_"


def roots_here() -> dict[str, str]:
    """The roots of this machine, by name."""
    return {
        name.removeprefix(PREFIX): value.rstrip("/")
        for name, value in sorted(os.environ.items())
        if name.startswith(PREFIX) and value
    }


@dataclass(frozen=True, slots=True)
class Roots:
    """How paths of the coordinator become ours. theirs, ours : place of each root by name."""

    theirs: Mapping[str, str]
    ours: Mapping[str, str]

    def local(self, path: str) -> str:
        """Where this machine has what the coordinator calls `path`.

        Raises
        ------
        Refused : it lies outside of all our roots.
        """
        for name, place in self.theirs.items():
            if name in self.ours and _is_under(path, place):
                path = self.ours[name] + path[len(place) :]
                break
        if self.ours and not any(_is_really_under(path, place) for place in self.ours.values()):
            raise Refused(
                f"{path} lies outside of this worker's roots ({', '.join(self.ours.values())}). "
                f"Name the folder it is in by a {PREFIX}... on the coordinator and on every worker."
            )
        return path


def _is_under(path: str, place: str) -> bool:
    return path == place or path.startswith(f"{place}/")


def _is_really_under(path: str, place: str) -> bool:
    """By its letters in a store, behind all links in a file system."""
    if "://" in place:
        return _is_under(path, place) and ".." not in path.split("/")
    if "://" in path:
        return False
    return Path(path).resolve().is_relative_to(Path(place).resolve())
