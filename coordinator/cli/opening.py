"""Opening the index that a verb reads."""

from pathlib import Path
from typing import TYPE_CHECKING

from contracts.places import Place
from coordinator.cli.show import bars

if TYPE_CHECKING:  # faiss and pyproj are imported when a verb runs
    from index.fetched import Held
    from index.opened import OpenedIndex


def opened_index(index: Place) -> "OpenedIndex":
    """The live generation of an index, with a bar while it is fetched from a store.

    Raises
    ------
    BadIndex : as `OpenedIndex`.
    """
    from index.opened import OpenedIndex

    if isinstance(index, Path):
        return OpenedIndex(index.absolute())
    with bars() as progress:
        return OpenedIndex(index, progress=progress)


def folder_of(index: Place) -> "Held":
    """The folder of an index, or of what was fetched of it from a store.

    Raises
    ------
    BadIndex : no index is published there, or the store does not answer.
    """
    from index.fetched import at_hand

    if isinstance(index, Path):
        return at_hand(index.absolute())
    with bars() as progress:
        return at_hand(index, progress=progress)
