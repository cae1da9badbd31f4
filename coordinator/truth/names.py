"""Which image of a list a ground truth means by a name."""

import unicodedata
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import PurePosixPath

from contracts.errors import BadTruth


class Names:
    """Finds uris by their end; candidates are looked up by their last part.

    suffixes : False: names leave out what follows the last dot of a uri, such as `.jpg`.
    """

    def __init__(self, uris: Sequence[str], *, suffixes: bool = True) -> None:
        self.suffixes = suffixes
        self._uris = uris
        self._names = uris if suffixes else [_without_suffix(uri) for uri in uris]
        self._by_last_part: dict[str, list[int]] = defaultdict(list)
        for image_id, name in enumerate(self._names):
            self._by_last_part[name.rsplit("/", 1)[-1]].append(image_id)

    def find(self, name: str) -> list[int]:
        """Ids of the images that are meant: those of this very name, or where either ends so."""
        name = unicodedata.normalize("NFC", name)  # as the uris are
        candidates = self._by_last_part.get(name.rsplit("/", 1)[-1], [])
        exact = [each for each in candidates if self._names[each] == name]
        return exact or [each for each in candidates if _ends(self._names[each], name)]

    def own(self, name: str) -> list[int]:
        """The image of this name, if there is exactly one."""
        found = self.find(name)
        return found if len(found) == 1 else []

    def image_ids(self, query: str, names: Iterable[str]) -> tuple[int, ...]:
        """Ascending ids of the images named in the truth of a query.

        Raises
        ------
        BadTruth : a name is no image, or several.
        """
        return tuple(sorted({self._image_id(query, name) for name in names}))

    def uris_of(self, image_ids: Sequence[int]) -> str:
        """The first few, to be shown."""
        return ", ".join(self._uris[each] for each in image_ids[:3])

    def _image_id(self, query: str, name: str) -> int:
        found = self.find(name)
        if len(found) == 1:
            return found[0]
        if not found:
            raise BadTruth(
                f"The truth of {query} names {name}, which is no image of the index. "
                "Was it skipped, or is the path relative to another folder?"
            )
        raise BadTruth(
            f"The truth of {query} names {name}, which is several images "
            f"({self.uris_of(found)}). Write more of its path."
        )


def _without_suffix(uri: str) -> str:
    return str(PurePosixPath(uri).with_suffix(""))


def _ends(uri: str, reference: str) -> bool:
    longer, shorter = (uri, reference) if len(uri) >= len(reference) else (reference, uri)
    return longer.endswith("/" + shorter)
