"""Where the photo of a query is read, in formats that only name it."""

from collections.abc import Sequence
from pathlib import Path

from contracts.errors import BadSurvey, BadTruth
from contracts.places import Place, place_of
from coordinator.truth.names import Names
from survey.files import list_images


class Photos:
    """Photos under a folder, then those of the index.

    Parameters
    ----------
    root : a folder that is searched with its subfolders; None: only the index is.
    indexed : names of the indexed images. paths : where each of them is read.

    Raises
    ------
    BadTruth : the folder cannot be listed.
    """

    def __init__(self, root: Path | None, indexed: Names, paths: Sequence[str]) -> None:
        self._root = root
        self._places: list[tuple[Names, Sequence[str]]] = []
        if root is not None:
            files = _listed(root)
            self._places.append((Names(list(files), suffixes=indexed.suffixes), [*files.values()]))
        if paths:
            self._places.append((indexed, paths))

    def path(self, query: str, name: str) -> Place:
        """Where the photo of this name is.

        Raises
        ------
        BadTruth : it is nowhere, or several have the name.
        """
        for names, paths in self._places:
            found = names.find(name)
            if len(found) > 1:
                raise BadTruth(
                    f"The photo of query {query} is {name}, which is several images "
                    f"({names.uris_of(found)}). Write more of its path."
                )
            if found:
                return place_of(paths[found[0]])
        where = "the index" if self._root is None else f"{self._root} nor the index"
        raise BadTruth(
            f"The photo of query {query}, {name}, is {'not' if self._root is None else 'neither'} "
            f"in {where}. Give the folder of the queries as --root."
        )


def _listed(root: Path) -> dict[str, str]:
    try:
        return list_images(root).paths
    except BadSurvey as error:
        raise BadTruth(f"The folder of the queries cannot be used: {error}.") from error
