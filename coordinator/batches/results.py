"""What a batch has found so far, in the order of its photos."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

from contracts.errors import BadIndex
from contracts.places import Place
from coordinator.batches.batch import BatchFolder, BatchPlan
from coordinator.batches.journal import AnswerReader, Answers
from coordinator.batches.running import open_pinned
from coordinator.export.results import GEOJSON, SEQUENCE
from coordinator.querying import Located
from index.files import open_regular
from index.opened import OpenedIndex


def answered_photos(folder: BatchFolder, answers: Answers) -> Iterator[Located]:
    """The photos that have their answer, one at a time; the batch may go on meanwhile.

    answers : of `folder.answers`. Errors as `BatchFolder.photos`.
    """
    with ExitStack() as stack:
        reader: AnswerReader | None = None
        for number, photo in enumerate(folder.photos()):
            if not answers.is_done(number):
                continue
            if reader is None:
                reader = AnswerReader(answers, stack.enter_context(open_regular(folder.answers)))
            yield Located(photo.query, *reader.answer(number, photo.query))


def about_results(plan: BatchPlan, done: int) -> dict[str, object]:
    """What a collection of a batch's answers says of itself. done : photos with an answer."""
    about: dict[str, object] = {**plan.about, "batch": plan.name, "photos": plan.n_photos}
    return about if done == plan.n_photos else {**about, "partial": True, "answered": done}


def index_for(place: Place, plan: BatchPlan, outs: Sequence[Path]) -> OpenedIndex | None:
    """The generation that answered, where a file of `outs` tells more than the answers do.

    None : none does, or the generation was pruned since.
    """
    if all(out.suffix.lower() in (*GEOJSON, *SEQUENCE) for out in outs):
        return None
    try:
        return open_pinned(place, plan)
    except BadIndex:
        return None
