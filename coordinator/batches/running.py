"""Working on a batch: what has no answer yet is made ready, sent, and its answer kept."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace

from contracts.errors import BadIndex
from contracts.places import Place
from contracts.progress import Progress
from coordinator.batches.batch import BatchFolder, BatchPlan
from coordinator.batches.fetching import Fetcher
from coordinator.batches.journal import Answers, Journal, is_error
from coordinator.batches.manifests import kept_file
from coordinator.batches.preparing import Preparing, Ready
from coordinator.engine.running import Engine
from coordinator.following.events import Order
from coordinator.following.flow import Outcome
from coordinator.querying import answer_of, locate_message
from index.opened import OpenedIndex

STAGE = "locate"


def open_pinned(place: Place, plan: BatchPlan) -> OpenedIndex:
    """The generation of the index that a batch is located against.

    Raises
    ------
    BadIndex : it is gone, damaged, or another one has its number by now.
    """
    try:
        index = OpenedIndex(place, plan.generation)
    except BadIndex as error:
        raise BadIndex(
            f"The batch {plan.name} is located against generation {plan.generation} of {place}, "
            f"which cannot be opened: {error} Answers that are there stay; submit the other "
            "photos under another name."
        ) from error
    if index.generation.digest() != plan.generation_digest:
        raise BadIndex(
            f"Generation {plan.generation} of {place} is not the one that the batch {plan.name} "
            "was submitted for: the index was made anew. Submit the batch under another name."
        )
    return index


def run_batch(
    folder: BatchFolder,
    plan: BatchPlan,
    index: OpenedIndex,
    engine: AbstractContextManager[Engine],
    fetcher: Fetcher,
    progress: Progress,
    told: Callable[[int, int], None],
) -> None:
    """Locate the photos of a batch that have no answer yet. `folder` is `worked_on`.

    index : the generation that it is pinned to. engine : started if anything is to do.
    fetcher : of photos from elsewhere.
    told : called with photos done and those of them that failed, as they are.

    Raises
    ------
    BadIndex, BadConfig : as the workers found. Cancelled : as its follower.
    """
    answers = Answers.read(folder.answers)
    todo = [each for each in enumerate(folder.photos()) if not answers.is_done(each[0])]
    progress.begin(STAGE, plan.n_photos, plan.n_photos - len(todo))
    told(*answers.count())
    if not todo:
        return
    with (
        engine as running,
        Journal(folder.answers) as journal,
        Preparing(todo, fetcher, folder.fetched) as preparing,
    ):
        run = _Run(folder, plan, index, answers, journal, progress, told)
        for outcome in running.follower.outcomes(run.orders(preparing.as_they_are())):
            run.take(outcome)


class _Run:
    """Keeps what comes, and counts it; photos of the same bytes are asked about once."""

    def __init__(
        self,
        folder: BatchFolder,
        plan: BatchPlan,
        index: OpenedIndex,
        answers: Answers,
        journal: Journal,
        progress: Progress,
        told: Callable[[int, int], None],
    ) -> None:
        self._index = index
        self._search = folder.search_file(plan.search)
        self._journal = journal
        self._progress = progress
        self._told = told
        self._done, self._failed = answers.count()
        self._known = {sha256: sha256 in answers.failed for sha256 in answers.offsets}
        """Digests that have their answer, and whether it is an error."""
        self._asked: dict[str, str] = {}
        """Digests that the workers have, by the order's key."""
        self._same: Counter[str] = Counter()
        """How many photos wait for the answer to a digest."""

    def orders(self, photos: Iterable[Ready | None]) -> Iterator[Order | None]:
        """What is to be asked about photos that are ready; None: nothing just now."""
        for photo in photos:
            if photo is None:
                yield None
                continue
            if photo.error:
                self._journal.failed(photo.number, photo.error)
                self._count(1, True)
                continue
            self._journal.digested(photo.number, photo.sha256)
            if photo.sha256 in self._known:
                self._count(1, self._known[photo.sha256])
                continue
            self._same[photo.sha256] += 1
            if self._same[photo.sha256] == 1:
                key = str(photo.number)
                self._asked[key] = photo.sha256
                readable = replace(photo.photo, path=photo.path)
                yield Order(STAGE, key, locate_message(self._index, readable, self._search))

    def take(self, outcome: Outcome) -> None:
        """Keep an answer. Errors as `answer_of`."""
        features, seconds = answer_of(outcome.order.message["query"], outcome)
        sha256 = self._asked.pop(outcome.order.key)
        self._journal.answered(sha256, features, seconds)
        self._known[sha256] = is_error(features)
        self._count(self._same.pop(sha256), self._known[sha256])

    def _count(self, number: int, failed: bool) -> None:
        self._done += number
        self._failed += number if failed else 0
        for _ in range(number):
            self._progress.advance(STAGE)
        self._told(self._done, self._failed)


def forget_failed(folder: BatchFolder) -> int:
    """Forget the answers that are errors, so that these photos are asked for again; how many.

    Raises
    ------
    BadConfig : a process works on the batch.
    """
    with folder.worked_on():
        answers = Answers.read(folder.answers)
        damaged = {number for number, each in answers.digests.items() if each in answers.failed}
        again = [*answers.errors, *damaged]
        for number, photo in enumerate(folder.photos()):
            if number in damaged and photo.is_elsewhere:  # its server may have a better one by now
                kept_file(photo, folder.fetched).unlink(missing_ok=True)
        with Journal(folder.answers) as journal:
            for sha256 in answers.failed:
                journal.forget(sha256)
            for number in again:
                journal.ask_again(number)
        return len(again)
