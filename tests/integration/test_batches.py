"""Named batches of photos: each photo answered once, whatever happens meanwhile."""

import json
import os
import shutil
import signal
import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import Result
from flaneur_command import run
from index_shop import CONFIG
from machines import wait_until
from photo_server import Answer, serving_photos
from PIL import Image
from typer.testing import CliRunner

from contracts.config import IndexConfig, SearchConfig, Where
from contracts.errors import BadConfig, BadIndex, Cancelled
from coordinator.batches.batch import BATCHES, BatchFolder
from coordinator.batches.fetching import Fetcher
from coordinator.batches.journal import Answers
from coordinator.batches.results import answered_photos
from coordinator.batches.running import forget_failed, open_pinned, run_batch
from coordinator.batches.sources import read_sources
from coordinator.batches.states import state_of_batch
from coordinator.batches.submitting import refuse_another, submit
from coordinator.cli import main
from coordinator.cli.show import Bars
from coordinator.engine.running import Engine
from coordinator.pruning import prune
from coordinator.querying import Located, locate_message, locate_photos
from coordinator.removing import remove_images
from index.control import read_wish, write_wish
from index.opened import OpenedIndex

SEARCH = SearchConfig(pair=("hesaff",), k=1, vote="intersection")
OPTIONS = ("--pair", "hesaff", "--k", "1")


@pytest.fixture
def root(indexed: Callable[[IndexConfig], OpenedIndex], tmp_path: Path) -> Path:
    return Path(shutil.copytree(indexed(CONFIG).root, tmp_path / "index"))


@pytest.fixture
def photos(small_survey: Path, tmp_path: Path) -> Path:
    """Six photos, one of them twice, one damaged, and one only listed."""
    folder = tmp_path / "photos"
    folder.mkdir()
    for number in range(6):
        picture = Image.open(small_survey / f"{number:02d}.jpg")
        picture.crop((10, 10, 300, 230)).save(folder / f"{number}.jpg")
    shutil.copy(folder / "1.jpg", folder / "4-again.jpg")
    (folder / "2.jpg").write_bytes((folder / "2.jpg").read_bytes()[:900])
    (folder / "list.csv").write_text("photo\n0.jpg\ngone.jpg\n1.jpg\n")
    return folder


def submitted(
    root: Path, *sources: Path | str, search: SearchConfig = SEARCH, name: str = "b"
) -> BatchFolder:
    folder, given = BatchFolder(root / BATCHES, name), [str(each) for each in sources]
    with Fetcher() as fetcher:
        photos = read_sources(given, fetcher)
    submit(folder, OpenedIndex(root), search, 5, given, photos)
    return folder


def work(folder: BatchFolder, root: Path, engine: Engine, most: int = 1000) -> int:
    """Work on a batch until `most` more photos are done; returns how many are."""
    plan, counts = folder.read(), [0]

    class Enough(Exception):
        pass

    def told(done: int, _: int) -> None:
        counts.append(done)
        if done >= counts[1] + most:
            raise Enough

    own = replace(engine, follower=engine.follower.heeding(lambda: read_wish(folder.path)))
    with folder.worked_on(), Fetcher() as fetcher:
        try:
            index = open_pinned(root, plan)
            run_batch(folder, plan, index, nullcontext(own), fetcher, Bars(None), told)
        except Enough:
            pass
    return counts[-1]


def found(folder: BatchFolder) -> list[Located]:
    return list(answered_photos(folder, Answers.read(folder.answers)))


def answered(folder: BatchFolder) -> list[str]:
    """The digest of every answer that workers gave, as often as they did."""
    lines = folder.answers.read_bytes().splitlines()
    return [json.loads(line)["sha256"] for line in lines if b'"features"' in line]


def test_answers_are_those_of_locate_in_the_order_submitted(
    root: Path, photos: Path, engine: Engine
) -> None:
    folder = submitted(root, photos, photos / "list.csv")
    work(folder, root, engine)
    names = [str(photos / f"{name}.jpg") for name in (0, 1, 2, 3, "4-again", 4, 5, "gone")]
    answers = found(folder)
    assert [each.query for each in answers] == names
    alone = locate_photos(OpenedIndex(root), names, SEARCH, engine.follower, lambda: None)
    assert [each.features for each in answers] == [each.features for each in alone]
    assert [each.error for each in answers if each.error] == [
        answers[2].error,
        "cannot be opened: No such file or directory",
    ]
    assert "truncated" in str(answers[2].error)


def test_the_same_photo_twice_is_located_once(root: Path, photos: Path, engine: Engine) -> None:
    folder = submitted(root, photos)
    work(folder, root, engine)
    assert len(answered(folder)) == len(set(answered(folder))) == 6
    queries = {each.query for each in found(folder)}
    assert {str(photos / "1.jpg"), str(photos / "4-again.jpg")} <= queries


def test_cut_short_a_batch_goes_on_with_what_is_missing(
    root: Path, photos: Path, engine: Engine
) -> None:
    folder = submitted(root, photos)
    work(folder, root, engine, most=3)
    before = len(found(folder))
    assert 3 <= before < 7
    with folder.answers.open("ab") as journal:  # the process was killed in the middle of a line
        journal.write(b'{"photo": 6, "sha256": "12')
    work(folder, root, engine)
    assert [Path(each.query).name for each in found(folder)] == sorted(
        path.name for path in photos.glob("*.jpg")
    )
    assert len(answered(folder)) == len(set(answered(folder))) == 6
    assert state_of_batch(folder).state == "finished"


def test_a_cancelled_batch_asks_nothing_more_and_goes_on_when_it_is_resumed(
    root: Path, photos: Path, engine: Engine
) -> None:
    folder = submitted(root, photos)
    write_wish(folder.path, "cancel")
    with pytest.raises(Cancelled):
        work(folder, root, engine)
    assert answered(folder) == []
    assert state_of_batch(folder).state == "cancelled"
    write_wish(folder.path, "run")
    assert state_of_batch(folder).state == "stopped"
    assert work(folder, root, engine) == 7


def test_two_processes_do_not_work_on_one_batch(root: Path, photos: Path, engine: Engine) -> None:
    folder = submitted(root, photos)
    with folder.worked_on():
        assert state_of_batch(folder).state == "at work"
        with pytest.raises(BadConfig, match="Another process works on the batch b"):
            work(folder, root, engine)


def test_of_two_that_submit_one_name_at_once_the_second_is_refused(
    root: Path, photos: Path
) -> None:
    folder = submitted(root, photos)
    with pytest.raises(BadConfig, match="Another process submitted a batch b meanwhile"):
        submitted(root, photos / "0.jpg")
    assert sum(1 for _ in folder.photos()) == folder.read().n_photos


def test_a_batch_does_not_change_its_priority_without_a_word(root: Path, photos: Path) -> None:
    folder = submitted(root, photos)
    plan = folder.read()
    refuse_another(folder, plan, SEARCH, plan.priority, plan.sources)
    with pytest.raises(BadConfig, match="with other priority"):
        refuse_another(folder, plan, SEARCH, 1, plan.sources)


def test_pruning_keeps_the_generation_that_an_unfinished_batch_is_located_against(
    root: Path, photos: Path, engine: Engine
) -> None:
    folder = submitted(root, photos)
    assert work(folder, root, engine, most=2) < 7
    remove_images(root, Where(), ("00.jpg",), (), Bars(None))
    assert prune(root).generations == ()
    assert work(folder, root, engine) == 7
    first = found(folder)[0].of_kind("match")[0]["properties"]
    assert (first["image"], first["generation"]) == ("00.jpg", 1)
    assert prune(root).generations == (1,)
    assert len(found(folder)) == 7, "answers outlive the generation"
    other = submitted(root, photos, name="other")
    shutil.rmtree(root / "generations")
    with pytest.raises(BadIndex, match="batch other is located against generation 2"):
        work(other, root, engine)


def test_a_polygon_of_any_size_leaves_messages_small(
    root: Path, photos: Path, engine: Engine
) -> None:
    corners = [(2.0 + at * 1e-4, 48.0) for at in range(4000)] + [(2.4, 49.0), (2.0, 49.0)]
    ring = ", ".join(f"{lon:.7f} {lat:.7f}" for lon, lat in [*corners, corners[0]])
    where = Where(polygon=f"POLYGON (({ring}))")
    folder = submitted(root, photos, search=SEARCH.model_copy(update={"where": where}))
    work(folder, root, engine)
    photo = next(folder.photos())
    search = folder.search_file(folder.read().search)
    assert search.stat().st_size > 80_000
    assert len(json.dumps(locate_message(OpenedIndex(root), photo, search))) < 1000
    assert [each.error is None for each in found(folder)] == [True, True, False, *[True] * 4]


def test_a_batch_of_another_index_under_the_same_number_is_refused(
    root: Path, photos: Path, engine: Engine, indexed: Callable[[IndexConfig], OpenedIndex]
) -> None:
    folder = submitted(root, photos)
    more = CONFIG.features.model_copy(update={"max_frames": 50})
    other = indexed(CONFIG.model_copy(update={"features": more}))
    with pytest.raises(BadIndex, match="the index was made anew"):
        work(folder, other.root, engine)


def test_what_could_not_be_had_can_be_asked_for_again(
    root: Path, photos: Path, engine: Engine, small_survey: Path
) -> None:
    folder = submitted(root, photos / "list.csv", photos / "2.jpg")
    work(folder, root, engine)
    assert state_of_batch(folder).failed == 2
    shutil.copy(small_survey / "07.jpg", photos / "gone.jpg")
    shutil.copy(small_survey / "08.jpg", photos / "2.jpg")
    assert forget_failed(folder) == 2
    assert work(folder, root, engine) == 4
    assert [each.error for each in found(folder)] == [None] * 4


def test_a_manifest_is_fetched_once_and_located_by_its_labels(
    root: Path, photos: Path, engine: Engine, same_engine: None
) -> None:
    with serving_photos() as server:
        server.put("/0.jpg", Answer((photos / "0.jpg").read_bytes()))
        canvases = [
            {
                "id": f"{server.url}/canvas/{name}",
                "type": "Canvas",
                "label": {"fr": [f"Rue {name}"]},
                "items": [
                    {"items": [{"body": {"id": f"{server.url}/{name}.jpg", "type": "Image"}}]}
                ],
            }
            for name in (0, 9)
        ]
        manifest = {"type": "Manifest", "id": f"{server.url}/m", "items": canvases}
        url = server.put("/m", Answer(json.dumps(manifest).encode(), "application/json"))
        folder = submitted(root, url)
        work(folder, root, engine)
        answers = found(folder)
        damaged = Answer((photos / "2.jpg").read_bytes())
        server.put("/9.jpg", damaged, Answer((photos / "3.jpg").read_bytes()))
        for _ in range(2):
            assert forget_failed(folder) == 1
            work(folder, root, engine)
        assert server.asked == {"/m": 1, "/0.jpg": 1, "/9.jpg": 3}
        out = photos.parent / "at-once.geojsons"
        once = CliRunner().invoke(
            main, ["locate", url, "--index", str(root), *OPTIONS, "--out", str(out)]
        )
    assert [each.query for each in answers] == ["Rue 0", "Rue 9"]
    assert "its server says 404" in str(answers[1].error)
    assert once.exit_code == 0, once.stderr
    features = [json.loads(record) for record in out.read_text("utf-8").split("\x1e")[1:]]
    assert features == [feature for each in found(folder) for feature in each.features]


def say(verb: str, *arguments: str | Path) -> Result:
    """`flaneur batch`, in this process."""
    return CliRunner().invoke(main, ["batch", verb, *map(str, arguments)])


@pytest.fixture
def many(photos: Path, small_survey: Path) -> Path:
    """As many photos as keep a worker busy for some seconds."""
    folder = photos.parent / "many"
    folder.mkdir()
    for number in range(40):
        picture = Image.open(small_survey / f"{number % 10:02d}.jpg")
        picture.crop((number, 0, 320, 240)).resize((960, 720)).save(folder / f"{number:02d}.jpg")
    return folder


def test_a_batch_goes_on_by_itself_through_a_pause_and_a_kill(
    root: Path, many: Path, engine: Engine
) -> None:
    broker = ("--broker", engine.app.conf.broker_url)
    submit_it = ("night", many, "--index", root, *OPTIONS, *broker)
    folder = BatchFolder(root / BATCHES, "night")
    begun = run("batch", "submit", *submit_it)
    assert begun.returncode == 0, begun.stderr
    assert "It goes on by itself" in begun.stderr
    pid = json.loads((folder.path / "progress.json").read_text())["pid"]
    try:
        wait_until(lambda: Answers.read(folder.answers).offsets, "the first answer")
        assert say("pause", "night", "--index", root).exit_code == 0
        wait_until(
            lambda: state_of_batch(folder).state == "paused" and not in_flight(folder), "the pause"
        )
        paused_at = Answers.read(folder.answers).count()
        collection = json.loads(say("results", "night", "--index", root).stdout)
        assert collection["flaneur"]["partial"] is True
        assert collection["flaneur"]["answered"] == paused_at[0] < 40
        assert say("submit", *submit_it).exit_code == 0, "the same command again goes on"
        wait_until(lambda: Answers.read(folder.answers).count() > paused_at, "more answers")
    finally:
        os.kill(pid, signal.SIGKILL)
    wait_until(lambda: not folder.is_worked_on(), "the end of the process")
    state = json.loads(say("status", "night", "--index", root, "--json").stdout)
    assert (state["state"], state["photos"]) == ("stopped", 40)
    assert state["done"] == Answers.read(folder.answers).count()[0] > paused_at[0]
    again = run("batch", "resume", "night", "--index", root, "--wait", *broker)
    assert again.returncode == 0, again.stderr
    assert len(answered(folder)) == len(set(answered(folder))) == 40
    sequence = say("results", "night", "--index", root, "--seq").stdout
    records = [json.loads(record) for record in sequence.split("\x1e")[1:]]
    queries = list(dict.fromkeys(record["properties"]["query"] for record in records))
    assert queries == [str(many / f"{number:02d}.jpg") for number in range(40)]


def in_flight(folder: BatchFolder) -> bool:
    """Whether answers still come."""
    size = folder.answers.stat().st_size
    time.sleep(0.5)
    return folder.answers.stat().st_size != size


def test_a_name_that_is_taken_is_refused_and_one_that_is_not_there_is_told(
    root: Path, photos: Path
) -> None:
    submitted(root, photos, name="night")
    other = say("submit", "night", photos / "0.jpg", "--index", root, *OPTIONS)
    assert other.exit_code == 2
    assert "There is a batch night" in other.stderr
    assert "with other sources" in other.stderr
    missing = say("resume", "nigth", "--index", root)
    assert missing.exit_code == 2
    assert "has no batch nigth; it has night" in missing.stderr
