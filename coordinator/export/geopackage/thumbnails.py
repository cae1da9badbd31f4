"""Small pictures of photos and matched images; one that cannot be read has none."""

from functools import lru_cache
from pathlib import Path

from contracts.errors import UnusableImage
from coordinator.export.sheets import thumbnail_jpeg

SIDE_PX = 200
MAX_BYTES = 8_000
_KEPT = 4096


class Thumbnails:
    """Thumbnails, those of matched images remembered: photos of one place share their matches."""

    def __init__(self) -> None:
        self.of_image = lru_cache(maxsize=_KEPT)(_thumbnail)

    def of_photo(self, query: str) -> bytes | None:
        """The thumbnail of a photo that was asked for."""
        return _thumbnail(query)


def _thumbnail(path: str, fragment: str = "", quarter_turns: int = 0) -> bytes | None:
    try:
        return thumbnail_jpeg(
            Path(path),
            SIDE_PX,
            fragment=fragment,
            quarter_turns=quarter_turns,
            max_bytes=MAX_BYTES,
        )
    except UnusableImage:
        return None
