"""Photos of some sources for one search without a name: what is elsewhere is fetched first."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from contracts.errors import WrongInput
from contracts.places import Place
from contracts.progress import Progress
from coordinator.batches.batch import BATCHES
from coordinator.batches.fetching import Fetcher
from coordinator.batches.photos import Photo
from coordinator.batches.preparing import Preparing
from coordinator.batches.sources import read_sources

STAGE = "fetch"


@contextmanager
def photos_at_hand(
    sources: Sequence[str], folder: Path | None, progress: Progress
) -> Iterator[list[Photo]]:
    """All photos of some sources (`read_sources`), each with a file or an error.

    folder : where photos from elsewhere are kept until the end; None: where the system keeps such.

    Raises
    ------
    WrongInput : as `read_sources`, or `folder` cannot be written.
    """
    with Fetcher() as fetcher:
        photos = read_sources(sources, fetcher)
        elsewhere = [each for each in enumerate(photos) if each[1].is_elsewhere]
        if not elsewhere:
            yield photos
            return
        with _scratch(folder) as scratch:
            progress.begin(STAGE, len(elsewhere), 0)
            with Preparing(elsewhere, fetcher, Path(scratch)) as preparing:
                for ready in preparing:
                    photos[ready.number] = replace(ready.photo, path=ready.path, error=ready.error)
                    progress.advance(STAGE)
            yield photos


def seen_by_workers(index: Place, broker: str | None) -> Path | None:
    """A folder that workers of a broker can read, which may be on other machines; None: all are
    here."""
    return index.absolute() / BATCHES if broker is not None and isinstance(index, Path) else None


def _scratch(folder: Path | None) -> TemporaryDirectory[str]:
    try:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
        return TemporaryDirectory(prefix=".locate-", dir=folder)
    except OSError as error:
        raise WrongInput(
            f"cannot write into {folder}: {error.strerror}. Photos from elsewhere are kept there, "
            "where the workers see them; use `flaneur batch submit` with --batches."
        ) from error
