"""Querying: photos become tasks on the locate queue, and results in the order asked."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from contracts.config import SearchConfig, Vote, Weight, Where
from contracts.errors import TaskFailed
from contracts.places import Place
from coordinator.batches.photos import Photo, photo_file
from coordinator.following.events import Order
from coordinator.following.flow import Outcome
from coordinator.following.follow import Follower
from coordinator.holding import HeldAnswers
from coordinator.truth import JudgedQuery
from geo.geojson import Feature, Kind, error_feature
from index.opened import OpenedIndex
from index.selecting import n_selected

Json = dict[str, Any]

WEIGHTINGS: tuple[tuple[Weight, ...], ...] = (
    (),
    ("idf",),
    ("norm",),
    ("idf", "norm"),
    ("burst", "idf", "norm"),
)
"""Sets of weights that an evaluation compares."""


@dataclass(frozen=True, slots=True)
class Rules:
    """Rules of fusion to rehearse: every vote with every weighting."""

    votes: tuple[Vote, ...]
    weightings: tuple[tuple[Weight, ...], ...]

    @classmethod
    def of(cls, search: SearchConfig) -> "Rules":
        """The rule of one search alone."""
        return cls((search.vote,), (search.weights,))

    @classmethod
    def all_for(cls, n_descriptors: int, search: SearchConfig) -> "Rules":
        """Every vote that so many descriptors can give, by the usual weightings and one's own."""
        votes = tuple(vote for vote in get_args(Vote) if vote != "pairwise" or n_descriptors > 1)
        own = tuple(sorted(search.weights))
        known = {tuple(sorted(each)) for each in WEIGHTINGS}
        return cls(votes, WEIGHTINGS if own in known else (*WEIGHTINGS, own))


@dataclass(frozen=True, slots=True)
class Located:
    """One photo's answer: its GeoJSON features, and the seconds a warm worker took."""

    query: str
    features: tuple[Feature, ...]
    seconds: float

    def of_kind(self, kind: Kind) -> list[Feature]:
        """The features of one kind, best first."""
        return [each for each in self.features if each["properties"]["kind"] == kind]

    @property
    def error(self) -> str | None:
        """What was wrong with the photo."""
        return next((str(each["properties"]["error"]) for each in self.of_kind("error")), None)

    @property
    def doubtful(self) -> bool:
        """Whether the photo may well be of another place."""
        return any(each["properties"]["in_survey"] is False for each in self.of_kind("estimate"))

    @property
    def not_chosen(self) -> set[str]:
        """How the search was settled where no model chose it: a person should know."""
        choices = {str(each["properties"]["choice"]) for each in self.of_kind("match")}
        return {choice for choice in choices if choice.startswith(("default", "fallback"))}


def searched(index: OpenedIndex, where: Where) -> Json:
    """Which images a search is about, for its results to tell; nothing is sent for none.

    Raises
    ------
    BadConfig : no image is meant.
    """
    conditions = where.model_dump(mode="json", exclude_defaults=True)
    return {"images": n_selected(index, where), **conditions}


def locate_photos(
    index: OpenedIndex,
    photos: Sequence[str | Photo],
    search: SearchConfig,
    follower: Follower,
    advance: Callable[[], None],
    *,
    plain: bool = False,
) -> Iterator[Located]:
    """Locate photos in the order given, each handed on as soon as it can be.

    One that fails becomes an error feature and stops no other. Nothing is sent before the first
    answer is asked for. Answers that come before their turn are held (`HeldAnswers`).

    photos : by the names of their files, or with another name. plain : by the baseline, a bag of
    words.

    Raises
    ------
    BadIndex, BadConfig : as a worker found, and so for every photo.
    """
    asked = [photo_file(each) if isinstance(each, str) else each for each in photos]
    orders = (
        Order("locate", str(number), locate_message(index, photo, search, plain=plain))
        for number, photo in enumerate(asked)
        if not photo.error
    )
    outcomes = follower.outcomes(orders)
    with HeldAnswers() as held:
        for turn, photo in enumerate(asked):
            if photo.error:
                advance()
                yield Located(photo.query, (error_feature(photo.query, photo.error),), 0.0)
                continue
            while turn not in held:
                outcome = next(outcomes)
                number = int(outcome.order.key)
                held.put(number, *answer_of(asked[number].query, outcome))
                advance()
            yield Located(photo.query, *held.take(turn))


def answer_of(query: str, outcome: Outcome) -> tuple[tuple[Feature, ...], float]:
    """The features that an outcome says of a photo, and the seconds a worker took.

    Raises
    ------
    BadIndex, BadConfig : as the worker found.
    """
    if outcome.wrong_index is not None:
        raise outcome.wrong_index
    if outcome.value is None:
        return (error_feature(query, str(outcome.error)),), 0.0
    return tuple(outcome.value["features"]), outcome.value["seconds"]


def locate_message(
    index: OpenedIndex, photo: Photo, search: SearchConfig | Path, *, plain: bool = False
) -> Json:
    """What a worker is told of a photo. search : or the file that holds it."""
    return {**_message(index, photo.query, Path(photo.path), search), "plain": plain}


def judge_queries(
    index: OpenedIndex,
    queries: Sequence[JudgedQuery],
    search: SearchConfig,
    follower: Follower,
    advance: Callable[[], None],
) -> list[Json]:
    """Have every query searched and its ranking judged; in the order given."""
    orders = (
        Order("judge", str(number), _judged_message(index, each, search))
        for number, each in enumerate(queries)
    )
    return _in_order(follower, orders, advance)


def rehearse_queries(
    index: OpenedIndex,
    queries: Sequence[JudgedQuery],
    search: SearchConfig,
    rules: Rules,
    ks: Sequence[int],
    follower: Follower,
    advance: Callable[[], None],
    keep: Path | None = None,
) -> list[Json]:
    """Have every query answered in every way, by each of `rules`; in the order given.

    keep : a folder for the votes of every query's single detectors, by its number.
    """
    orders = (
        Order(
            "rehearse",
            str(number),
            {
                **_judged_message(index, each, search),
                "votes": list(rules.votes),
                "weightings": [list(each) for each in rules.weightings],
                "ks": list(ks),
                "keep": None if keep is None else str(votes_file(keep, number)),
            },
        )
        for number, each in enumerate(queries)
    )
    return _in_order(follower, orders, advance)


def votes_file(folder: Path, number: int) -> Path:
    """Where the votes of a query are kept."""
    return folder.absolute() / f"{number:06d}.npz"


def _in_order(
    follower: Follower, orders: Iterator[Order], advance: Callable[[], None]
) -> list[Json]:
    answers: dict[int, Json] = {}
    for outcome in follower.outcomes(orders):
        if outcome.wrong_index is not None:
            raise outcome.wrong_index
        if outcome.value is None:
            query = outcome.order.message["query"]
            raise TaskFailed(f"{query} could not be searched for: {outcome.error}")
        answers[int(outcome.order.key)] = outcome.value
        advance()
    return [answers[number] for number in sorted(answers)]


def _judged_message(index: OpenedIndex, query: JudgedQuery, search: SearchConfig) -> Json:
    return {
        **_message(index, query.query, query.path, search),
        "relevant": query.relevant,
        "junk": query.junk,
        "box": query.box,
    }


def _message(index: OpenedIndex, query: str, path: Place, search: SearchConfig | Path) -> Json:
    return {
        "index": index.place,
        "generation": index.generation.number,
        "query": query,
        "path": str(path.absolute()),
        "search": str(search) if isinstance(search, Path) else search.model_dump(mode="json"),
    }
