"""Making photos ready for the workers some way ahead of their turn: fetched, and digested."""

from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Self

from coordinator.batches.fetching import Fetcher, Unfetched
from coordinator.batches.manifests import fetched_photo
from coordinator.batches.photos import Photo
from index.files import sha256_of

THREADS = 4
PATIENCE_S = 0.05
"""How long workers' answers wait for the next photo to be ready."""
AHEAD = 32
"""Photos that are ready or being made so: a batch that is paused soon fetches no more."""


@dataclass(frozen=True, slots=True)
class Ready:
    """A photo of the batch, by its number: a file and the sha256 of its bytes, or an error."""

    number: int
    photo: Photo
    path: str = ""
    sha256: str = ""
    error: str = ""


class Preparing:
    """Makes photos ready in threads, as many ahead as `AHEAD`, whichever is ready first.

    Photos from elsewhere are put into `folder` by `fetcher`, which is stopped at the end.
    """

    def __init__(self, photos: Iterable[tuple[int, Photo]], fetcher: Fetcher, folder: Path) -> None:
        self._waiting = iter(photos)
        self._fetcher = fetcher
        self._folder = folder
        self._n_begun = 0
        self._done: SimpleQueue[Future[Ready]] = SimpleQueue()
        self._pool = ThreadPoolExecutor(THREADS, "preparing")

    def __enter__(self) -> Self:
        self._begin()
        return self

    def __exit__(self, *_: object) -> None:
        self._fetcher.stop()
        self._pool.shutdown(cancel_futures=True)

    def __iter__(self) -> Iterator[Ready]:
        """All photos, each as soon as it is ready."""
        while self._n_begun:
            yield self._taken(self._done.get())

    def as_they_are(self) -> Iterator[Ready | None]:
        """All photos, as `__iter__`; None where the next is not ready yet."""
        while self._n_begun:
            try:
                future = self._done.get(timeout=PATIENCE_S)
            except Empty:
                yield None
            else:
                yield self._taken(future)

    def _taken(self, future: Future[Ready]) -> Ready:
        self._n_begun -= 1
        self._begin()
        return future.result()

    def _begin(self) -> None:
        while self._n_begun < AHEAD and (numbered := next(self._waiting, None)) is not None:
            self._n_begun += 1
            self._pool.submit(self._prepare, *numbered).add_done_callback(self._done.put)

    def _prepare(self, number: int, photo: Photo) -> Ready:
        if photo.error:
            return Ready(number, photo, error=photo.error)
        try:
            path = photo.path or str(fetched_photo(photo, self._fetcher, self._folder))
        except Unfetched as error:
            return Ready(number, photo, error=str(error))
        try:
            return Ready(number, photo, path, sha256_of(Path(path)))
        except (OSError, ValueError) as error:  # the latter of a NUL in a name
            reason = error.strerror if isinstance(error, OSError) else str(error)
            return Ready(number, photo, error=f"cannot be opened: {reason}")
