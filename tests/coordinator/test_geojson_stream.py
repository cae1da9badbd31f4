"""Results are written as they come, in bounded memory, whole or not at all."""

import json
import math
import tracemalloc
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, cast

import pytest

from contracts.config import SearchConfig
from contracts.errors import BadConfig, TaskFailed, WrongInput
from coordinator.batches.photos import Photo, photo_file
from coordinator.export.geojson import write_geojson
from coordinator.export.results import refuse_unknown, refuse_unwritable, write_results
from coordinator.following.events import Order
from coordinator.following.flow import Outcome
from coordinator.following.follow import Follower
from coordinator.holding import HeldAnswers
from coordinator.querying import Located, locate_photos
from geo.geojson import Feature, PlacedMatch, error_feature, match_feature
from index.opened import OpenedIndex

ABOUT: dict[str, object] = {"generation": 3}
NO_INDEX = cast(OpenedIndex, None)
"""GeoJSON is written without looking into the index."""


def match(query: str, rank: int = 1, score: float = 0.5) -> Feature:
    return match_feature(
        PlacedMatch(
            query=query,
            rank=rank,
            score=score,
            image="run1/a.jpg",
            uri="file:///survey/run1/a.jpg",
            image_id=7,
            lon_deg=2.3 + rank / 1e6,
            lat_deg=48.85,
            heading_deg=12.0,
            pitch_deg=0.0,
            roll_deg=0.0,
            hfov_deg=60.0,
            captured_at=None,
            detectors=("hesaff", "star"),
            k=2,
            predicted_map=None,
            generation=3,
        )
    )


def answers(count: int) -> Iterator[Located]:
    for number in range(count):
        yield Located(f"{number}.jpg", (match(f"{number}.jpg"), match(f"{number}.jpg", 2)), 0.25)


def then_fails(count: int, error: BaseException) -> Iterator[Located]:
    yield from answers(count)
    raise error


def peak_bytes(out: Path, n_features: int) -> int:
    feature = match("a.jpg")
    tracemalloc.start()
    try:
        write_geojson(
            out, ({**feature, "id": f"{number:x}"} for number in range(n_features)), ABOUT
        )
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_memory_does_not_grow_with_the_features(tmp_path: Path) -> None:
    out = tmp_path / "results.geojson"
    few = peak_bytes(out, 1_000)
    many = peak_bytes(out, 10_000)
    assert out.stat().st_size > 4_000_000
    assert many < few + 20_000


def test_a_large_batch_is_whole(tmp_path: Path) -> None:
    out = tmp_path / "results.geojson"
    feature = match("a.jpg")
    write_geojson(out, ({**feature, "id": f"{number:x}"} for number in range(50_000)))
    with out.open(encoding="utf-8") as lines:
        assert sum('"type":"Feature",' in line for line in lines) == 50_000


def test_a_sequence_is_of_records_that_each_stand_for_themselves(tmp_path: Path) -> None:
    """RFC 8142: a record separator, a text, a line feed; cut anywhere, the rest is whole."""
    out = tmp_path / "results.geojsons"
    write_results([out], answers(2), NO_INDEX, ABOUT, lambda _: None)
    content = out.read_bytes()
    records = content.split(b"\x1e")
    assert records[0] == b""
    assert all(record.endswith(b"\n") for record in records[1:])
    features = [json.loads(record) for record in records[1:]]
    assert features == [match(f"{n}.jpg", rank) for n in range(2) for rank in (1, 2)]
    cut = content[: len(content) - 20].split(b"\x1e")[1:]
    assert [record.endswith(b"\n") for record in cut] == [True, True, True, False]


def test_a_dash_says_how_to_write_on_stdout(tmp_path: Path) -> None:
    with pytest.raises(WrongInput, match="without --out GeoJSON is written on stdout"):
        refuse_unknown([tmp_path / "-"])


def test_every_output_holds_every_answer(tmp_path: Path) -> None:
    outs = [tmp_path / "a.geojson", tmp_path / "b.json"]
    said: list[str] = []
    write_results(outs, answers(3), NO_INDEX, ABOUT, said.append)
    first, second = (json.loads(out.read_bytes()) for out in outs)
    assert first == second
    assert first["flaneur"] == ABOUT
    assert [each["properties"]["query"] for each in first["features"][::2]] == [
        "0.jpg",
        "1.jpg",
        "2.jpg",
    ]
    assert first["features"][0] == match("0.jpg")
    assert said == []
    assert sorted(tmp_path.iterdir()) == outs


@pytest.mark.parametrize("error", [KeyboardInterrupt(), TaskFailed("the workers died")])
def test_an_early_end_changes_no_result_and_keeps_the_answers(
    tmp_path: Path, error: BaseException
) -> None:
    out, new = tmp_path / "results.geojson", tmp_path / "also.json"
    out.write_text("old", "utf-8")
    said: list[str] = []
    with pytest.raises(type(error)):
        write_results([out, new], then_fails(2, error), NO_INDEX, ABOUT, said.append)
    partial = tmp_path / "results.partial.geojson"
    assert out.read_text("utf-8") == "old"
    assert set(tmp_path.iterdir()) == {out, partial}
    kept = json.loads(partial.read_bytes())
    assert kept["flaneur"] == {"generation": 3, "partial": True}
    assert [each["properties"]["query"] for each in kept["features"]] == ["0.jpg"] * 2 + [
        "1.jpg"
    ] * 2
    assert said == [f"The answers to 2 photos until then are kept: {partial}"]


def test_an_output_that_fails_after_another_is_whole_costs_nothing(tmp_path: Path) -> None:
    good, folder = tmp_path / "a.geojson", tmp_path / "b.json"
    folder.mkdir()
    said: list[str] = []
    with pytest.raises(WrongInput, match=r"cannot write .*b\.json"):
        write_results([good, folder], answers(2), NO_INDEX, ABOUT, said.append)
    assert len(json.loads(good.read_bytes())["features"]) == 4
    assert set(tmp_path.iterdir()) == {good, folder}
    assert said == [f"Written whole before it ended: {good}"]


def test_where_the_answers_cannot_be_kept_that_is_said(tmp_path: Path) -> None:
    (tmp_path / "r.partial.geojson").mkdir()
    said: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        write_results(
            [tmp_path / "r.geojson"],
            then_fails(1, KeyboardInterrupt()),
            NO_INDEX,
            ABOUT,
            said.append,
        )
    assert "1 photos until then are lost: cannot write" in said[0]


def test_an_end_before_the_first_answer_leaves_nothing(tmp_path: Path) -> None:
    said: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        write_results(
            [tmp_path / "r.geojson"],
            then_fails(0, KeyboardInterrupt()),
            NO_INDEX,
            ABOUT,
            said.append,
        )
    assert list(tmp_path.iterdir()) == []
    assert said == []


def test_an_answer_that_cannot_be_written_spoils_no_file(tmp_path: Path) -> None:
    """NaN has no JSON: the error is told, and that nothing could be kept."""
    broken = Located("a.jpg", (match("a.jpg", score=math.nan),), 0.1)
    with pytest.raises(ValueError, match="JSON"):
        write_results([tmp_path / "r.geojson"], [broken], NO_INDEX, ABOUT, lambda _: None)
    assert list(tmp_path.iterdir()) == []


def test_a_place_where_nothing_can_be_written_is_told_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    asked: list[int] = []

    def coming() -> Iterator[Located]:
        asked.append(1)
        yield from answers(1)

    out = tmp_path / "file" / "r.geojson"
    with pytest.raises(WrongInput, match="cannot write into"):
        write_results([out], coming(), NO_INDEX, ABOUT, lambda _: None)
    assert asked == []
    with pytest.raises(WrongInput, match="cannot write into"):
        refuse_unwritable([tmp_path / "a.geojson", out])


@pytest.mark.parametrize(
    ("names", "says"),
    [
        (["r.shp"], r"'\.shp' is no format"),
        (["results"], "without an ending"),
        (["r.geojson", "r.gpkg", "r.geojson"], "twice"),
    ],
)
def test_an_unknown_ending_or_a_name_given_twice_is_refused(names: list[str], says: str) -> None:
    with pytest.raises(WrongInput, match=says):
        refuse_unknown([Path(name) for name in names])


def test_endings_are_known_in_any_case() -> None:
    refuse_unknown([Path("a.GeoJSON"), Path("b.gpkg"), Path("c.FGB"), Path("d.parquet")])


class LastFirst:
    """A follower whose tasks end in the reverse of the order they were sent in."""

    def __init__(self) -> None:
        self.sent: list[int] = []

    def outcomes(self, orders: Iterator[Order]) -> Iterator[Outcome]:
        batch = list(orders)
        self.sent.append(len(batch))
        for order in reversed(batch):
            query = order.message["query"]
            yield self.outcome(order, {"features": [error_feature(query, "why")], "seconds": 0.5})

    def outcome(self, order: Order, value: dict[str, Any]) -> Outcome:
        return Outcome(order, value, None)


class Refuses(LastFirst):
    def outcome(self, order: Order, value: dict[str, Any]) -> Outcome:
        return Outcome(order, None, "BadConfig: no such channel", BadConfig("no such channel"))


class Fails(LastFirst):
    def outcome(self, order: Order, value: dict[str, Any]) -> Outcome:
        return Outcome(order, None, "TaskFailed: lost")


class Opened:
    """What a message takes of an index."""

    place = "/index"

    class generation:  # noqa: N801 - an attribute of the index
        number = 3


def located(follower: LastFirst, photos: Sequence[str | Photo]) -> Iterator[Located]:
    return locate_photos(
        cast(OpenedIndex, Opened()),
        photos,
        SearchConfig(),
        cast(Follower, follower),
        lambda: None,
    )


def test_answers_come_in_the_order_asked() -> None:
    photos = [f"{number}.jpg" for number in range(11)]
    assert [answer.query for answer in located(LastFirst(), photos)] == photos


def test_nothing_is_sent_before_it_is_asked_for() -> None:
    follower = LastFirst()
    coming = located(follower, ["a.jpg", "b.jpg"])
    assert follower.sent == []
    assert next(coming).query == "a.jpg"
    assert follower.sent == [2]


def test_answers_that_wait_for_their_turn_are_not_in_memory(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """While the first photo keeps a worker busy, many others are answered."""
    in_memory = 1 << 22
    monkeypatch.setattr("coordinator.holding.IN_MEMORY_BYTES", in_memory)
    features = tuple(match("a.jpg", rank) for rank in range(200))
    with HeldAnswers() as held:
        tracemalloc.start()
        try:
            for number in range(1, 160):
                held.put(number, features, 0.25)
            peak = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        assert peak < 1.5 * in_memory
        assert held.take(159) == (features, 0.25)
        assert 159 not in held
        assert 1 in held


def test_a_photo_that_cannot_be_had_is_an_error_in_its_place() -> None:
    photos = [photo_file("a.jpg"), Photo("b", error="no such address"), photo_file("c.jpg")]
    answers_given = list(located(LastFirst(), photos))
    assert [each.query for each in answers_given] == ["a.jpg", "b", "c.jpg"]
    assert answers_given[1].error == "no such address"


def test_nothing_is_asked_of_no_photo() -> None:
    assert list(located(LastFirst(), [])) == []


def test_a_failed_task_is_its_photo_s_error_and_a_wrong_index_everybody_s() -> None:
    (answer,) = located(Fails(), ["a.jpg"])
    assert answer.error == "TaskFailed: lost"
    with pytest.raises(BadConfig, match="no such channel"):
        list(located(Refuses(), ["a.jpg"]))
