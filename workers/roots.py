"""Roots: folders and object stores that may be mounted elsewhere on every machine.

`FLANEUR_ROOT_ARCHIVE=/data/archive` says where this machine has what all call ARCHIVE. A worker
that has any root opens nothing outside them.
"""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from contracts.errors import BadConfig, Refused
from contracts.places import is_url

PREFIX = "FLANEUR_ROOT_"


def roots_here() -> dict[str, str]:
    """The roots of this machine, by name.

    Raises
    ------
    BadConfig : one is neither an absolute path nor the URL of a store.
    """
    return {
        variable.removeprefix(PREFIX): _settled(variable, value)
        for variable, value in sorted(os.environ.items())
        if variable.startswith(PREFIX) and value
    }


def _settled(variable: str, value: str) -> str:
    if not re.fullmatch(f"{PREFIX}[A-Za-z0-9_]+", variable):
        raise BadConfig(f"{variable}: a root's name is of letters, digits and _.")
    if value.startswith("file:") or not (value.startswith("/") or is_url(value)):
        raise BadConfig(
            f"{variable}={value}: expected an absolute path, such as /data/archive, or the URL of "
            "a store, such as s3://bucket/archive."
        )
    return value.rstrip("/") or "/"


@dataclass(frozen=True, slots=True)
class Roots:
    """How paths of the coordinator become ours. theirs, ours : place of each root by name."""

    theirs: Mapping[str, str]
    ours: Mapping[str, str]

    def local(self, path: str) -> str:
        """Where this machine has what the coordinator calls `path`.

        Of roots that lie in one another, the innermost that both have counts.

        Raises
        ------
        Refused : it lies outside of all our roots.
        """
        here = self._moved(path)
        if self.ours and not any(_is_really_under(here, place) for place in self.ours.values()):
            raise Refused(
                f"{here} lies outside of this worker's roots ({', '.join(self.ours.values())}). "
                f"Name the folder it is in by a {PREFIX}... on the coordinator and on every worker."
            )
        return here

    def _moved(self, path: str) -> str:
        named = [
            (place, self.ours[name])
            for name, place in self.theirs.items()
            if name in self.ours and _is_under(path, place)
        ]
        if not named:
            return path
        theirs, ours = max(named, key=lambda pair: len(pair[0]))
        below = path[len(theirs) :].lstrip("/")
        return f"{ours.rstrip('/')}/{below}" if below else ours


def _is_under(path: str, place: str) -> bool:
    return path == place or path.startswith(f"{place.rstrip('/')}/")


def _is_really_under(path: str, place: str) -> bool:
    """By its letters in a store, behind all links in a file system."""
    if is_url(place):
        parts = {unquote(part) for part in path.removeprefix(place).split("/")}
        plain = parts.isdisjoint({".", ".."}) and "::" not in path
        return plain and _is_under(path, place)
    if is_url(path) or "\0" in path or not path.startswith("/"):
        return False
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(place))
