"""The main job through a real server and real worker processes."""

import hashlib
import json
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import psutil
import pyogrio
import pytest
from flaneur_command import FLANEUR, run

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig, SearchConfig
from coordinator.cli.show import Bars
from coordinator.engine.running import Engine, running_engine
from coordinator.indexing import IndexReport, run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from coordinator.querying import locate_photos
from index.opened import OpenedIndex
from survey import ReadOptions

CONFIG = IndexConfig(
    features=FeatureConfig(max_frames=120), codebooks=CodebookConfig(max_words=200)
)
LAMBERT_93 = ReadOptions(crs="EPSG:2154")


def index(survey: Path, root: Path, engine: Engine, shard_size: int = 4) -> IndexReport:
    intake = read_surveys([("", survey)], LAMBERT_93)
    job, plan = make_plan(root, intake, CONFIG, shard_size)
    return run_job(job, plan, intake, nullcontext(engine), Bars(None))


def segment_digests(root: Path) -> dict[str, str]:
    folder = root / "segments"
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*.npy"))
    }


@pytest.fixture(scope="module")
def indexed(
    small_survey: Path, tmp_path_factory: pytest.TempPathFactory, engine: Engine
) -> tuple[Path, IndexReport]:
    root = tmp_path_factory.mktemp("index")
    return root, index(small_survey, root, engine)


@dataclass(frozen=True)
class Lonely:
    """An engine of one worker process, and what was there before it."""

    engine: Engine
    others: frozenset[psutil.Process]

    def pool(self) -> list[psutil.Process]:
        """The processes that work, not those that keep them."""
        ours = [each for each in children() if each not in self.others]
        return [each for each in ours if "worker" in each.cmdline() and not each.children()]


def children() -> list[psutil.Process]:
    return psutil.Process().children(recursive=True)


@pytest.fixture(scope="module")
def lonely(engine: Engine) -> Iterator[Lonely]:
    before = frozenset(children())
    with running_engine(None, 1) as alone:
        yield Lonely(alone, before)


def test_every_image_is_indexed_with_postings(indexed: tuple[Path, IndexReport]) -> None:
    root, report = indexed
    assert report.generation.n_images == report.images_extracted == 10
    assert not report.skipped
    assert report.generation.crs == "EPSG:2154"
    opened = OpenedIndex(root)
    assert len(opened.catalogue) == 10
    assert (opened.distinct_words(["hesaff-sift", "mser-surf"]) > 0).all()


def test_segments_are_the_same_bytes_for_other_shards_and_one_worker(
    indexed: tuple[Path, IndexReport], small_survey: Path, tmp_path: Path, lonely: Lonely
) -> None:
    index(small_survey, tmp_path, lonely.engine, shard_size=3)
    assert segment_digests(tmp_path) == segment_digests(indexed[0])


def test_a_second_run_has_nothing_to_do(
    indexed: tuple[Path, IndexReport], small_survey: Path, engine: Engine
) -> None:
    again = index(small_survey, indexed[0], engine)
    assert again.images_extracted == 0
    assert again.generation == indexed[1].generation


def test_scratch_is_gone_after_the_commit(indexed: tuple[Path, IndexReport]) -> None:
    left = {path.name for path in (indexed[0] / "jobs").glob("*/*")}
    needed = {"plan.json", "shards", "indexed", "receipts", "skipped.json"}
    told = {"closed", "events.jsonl", "progress.json", "report.json", "report.txt"}
    assert left == needed | told


def test_each_image_finds_itself_at_its_place(
    indexed: tuple[Path, IndexReport], small_survey: Path, engine: Engine
) -> None:
    photos = [str(small_survey / f"{number:02d}.jpg") for number in range(10)]
    opened = OpenedIndex(indexed[0])
    located = list(locate_photos(opened, photos, SearchConfig(), engine.follower, lambda: None))
    assert [answer.query for answer in located] == photos
    for number, answer in enumerate(located):
        first = answer.of_kind("match")[0]
        assert first["properties"]["image"] == f"{number:02d}.jpg"
        assert first["properties"]["rank"] == 1
        geometry = first["geometry"]
        assert geometry is not None
        assert geometry["coordinates"][0] == pytest.approx(2.345, abs=0.01)
        assert geometry["coordinates"][1] == pytest.approx(48.857, abs=0.01)


def test_one_unreadable_photo_stops_no_other(
    indexed: tuple[Path, IndexReport], small_survey: Path, engine: Engine, tmp_path: Path
) -> None:
    broken = tmp_path / "broken.jpg"
    broken.write_bytes((small_survey / "00.jpg").read_bytes()[:2000])
    photos = [str(broken), str(tmp_path / "missing.jpg"), str(small_survey / "03.jpg")]
    opened = OpenedIndex(indexed[0])
    located = list(locate_photos(opened, photos, SearchConfig(), engine.follower, lambda: None))
    assert [answer.error is not None for answer in located] == [True, True, False]
    assert located[2].of_kind("match")[0]["properties"]["image"] == "03.jpg"


def test_answers_come_in_the_order_asked(
    indexed: tuple[Path, IndexReport], small_survey: Path, engine: Engine
) -> None:
    photos = [str(small_survey / f"{number:02d}.jpg") for number in (5, 0, 9, 3, 1, 7, 2)]
    advanced: list[None] = []
    located = locate_photos(
        OpenedIndex(indexed[0]),
        photos,
        SearchConfig(),
        engine.follower,
        lambda: advanced.append(None),
    )
    assert [answer.query for answer in located] == photos
    assert len(advanced) == len(photos)


INDEX_OPTIONS = ("--crs", "EPSG:2154", "--max-frames", "120", "--max-words", "200")


def test_an_interrupted_index_goes_on_where_it_was(
    small_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    root = tmp_path / "index"
    command = [*FLANEUR, "index", str(small_survey), str(root), *INDEX_OPTIONS]
    command += ["--shard-size", "1", "--workers", "1", "--json"]
    first = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 90
    while time.monotonic() < deadline and len(list(root.glob("jobs/*/receipts/extract/*"))) < 3:
        time.sleep(0.02)
    first.send_signal(signal.SIGINT)
    _, said = first.communicate(timeout=60)
    assert first.returncode == 1
    assert "run the same command again" in said
    assert "Traceback" not in said
    assert not (root / "CURRENT").exists()
    again = (*INDEX_OPTIONS, "--shard-size", "1", "--json", "--broker", engine.app.conf.broker_url)
    second = run("index", small_survey, root, *again)
    assert second.returncode == 0, second.stderr
    assert 0 < json.loads(second.stdout)["extracted_now"] <= 7


def test_a_missing_broker_is_named_within_seconds(small_survey: Path, tmp_path: Path) -> None:
    answer = run(  # a hang fails: `run` gives up after two minutes
        "index", small_survey, tmp_path / "i", *INDEX_OPTIONS, "--broker", "redis://:pw@127.0.0.1:9"
    )
    assert answer.returncode == 1
    assert "No Redis server can be used at redis://***@127.0.0.1:9" in answer.stderr
    assert "Traceback" not in answer.stderr


def test_a_killed_worker_process_loses_nothing(
    indexed: tuple[Path, IndexReport], small_survey: Path, tmp_path: Path, lonely: Lonely
) -> None:
    intake = read_surveys([("", small_survey)], LAMBERT_93)
    job, plan = make_plan(tmp_path, intake, CONFIG, 1)
    killed: list[psutil.Process] = []

    class Killer(Bars):
        """Kills the process that works, once a shard is done."""

        def advance(self, stage: str) -> None:
            if not killed:
                killed.extend(lonely.pool())
                killed[0].kill()
            super().advance(stage)

    report = run_job(job, plan, intake, nullcontext(lonely.engine), Killer(None))
    assert len(killed) == 1
    assert report.generation.n_images == 10
    assert segment_digests(tmp_path) == segment_digests(indexed[0])


def test_one_engine_can_run_several_jobs(
    indexed: tuple[Path, IndexReport], small_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    """Their tasks have the same keys; results of one must not be taken for the other's."""
    report = index(small_survey, tmp_path, engine)
    assert report.images_extracted == 10
    assert segment_digests(tmp_path) == segment_digests(indexed[0])


def test_several_outputs_and_stdout_say_the_same(
    indexed: tuple[Path, IndexReport], small_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    broken = tmp_path / "broken.jpg"
    broken.write_bytes(b"no picture")
    asked = ("locate", small_survey / "04.jpg", broken, "--index", indexed[0])
    broker = ("--broker", engine.app.conf.broker_url)
    first, second, third = (tmp_path / name for name in ("a.geojson", "b.JSON", "c.gpkg"))
    told = run(*asked, *broker, "--out", first, "--out", second, "--out", third)
    assert told.returncode == 3, told.stderr
    assert f"1 of 2 photos located: {first}, {second}, {third}" in told.stderr
    assert first.read_bytes() == second.read_bytes()
    assert set(tmp_path.iterdir()) == {broken, first, second, third}
    printed = run(*asked, *broker)
    assert printed.returncode == 3
    assert printed.stdout == first.read_text("utf-8")
    results = json.loads(printed.stdout)
    assert results["flaneur"]["generation"] == 1
    assert results["flaneur"]["crs"] == "EPSG:2154"
    assert "RGF93" in results["flaneur"]["operation"]
    assert results["flaneur"]["accuracy_m"] == 1.0
    kinds = [each["properties"]["kind"] for each in results["features"]]
    assert kinds[0] == "match"
    assert len(pyogrio.read_dataframe(third, layer="matches")) == kinds.count("match")
    assert kinds[-1] == "error"


def test_only_images_that_are_meant_are_searched_and_results_say_which(
    indexed: tuple[Path, IndexReport], small_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    asked = ("locate", small_survey / "04.jpg", "--index", indexed[0])
    asked += ("--broker", engine.app.conf.broker_url)
    region = tmp_path / "region.geojson"
    ring = [[652002, 6861990], [652030, 6861990], [652030, 6862010], [652002, 6861990]]
    ring.insert(3, [652002, 6862010])
    crs = {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::2154"}}
    region.write_text(json.dumps({"type": "Polygon", "coordinates": [ring], "crs": crs}))
    conditions = ("--within", region, "--heading", "90±5", "--since", "2020-05", "--until", "2020")
    told = run(*asked, *conditions, "--uri", "0[5-9].jpg", "--survey", "main")
    assert told.returncode == 0, told.stderr
    results = json.loads(told.stdout)
    found = {each["properties"].get("image") for each in results["features"]}
    assert found - {None} == {"05.jpg", "06.jpg", "07.jpg"}
    about = results["flaneur"]["searched"]
    assert (about["images"], about["heading"], about["surveys"]) == (3, [90.0, 5.0], [""])
    none = run(*asked, *conditions, "--bbox", "10,50,11,51")
    assert none.returncode == 2
    assert "--bbox 10,50,11,51 leaves 0 of 10 images; --within leaves 7 of 10" in none.stderr


def test_ctrl_c_keeps_the_answers_so_far_beside_and_nothing_under_the_name(
    indexed: tuple[Path, IndexReport], small_survey: Path, tmp_path: Path, engine: Engine
) -> None:
    photos = [tmp_path / f"{number:03d}.jpg" for number in range(300)]
    for number, photo in enumerate(photos):
        photo.symlink_to(small_survey / f"{number % 10:02d}.jpg")
    out = tmp_path / "out" / "results.geojson"
    command = [*FLANEUR, "locate", *map(str, photos), "--index", str(indexed[0])]
    command += ["--out", str(out), "--broker", engine.app.conf.broker_url]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 90
    while time.monotonic() < deadline:
        if any(path.stat().st_size for path in out.parent.glob(".results.geojson.*")):
            break
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    _, said = running.communicate(timeout=60)
    assert running.returncode == 1
    assert [path.name for path in out.parent.iterdir()] == ["results.partial.geojson"]
    features = json.loads((out.parent / "results.partial.geojson").read_bytes())["features"]
    queries = list(dict.fromkeys(each["properties"]["query"] for each in features))
    assert queries == [str(photo) for photo in photos[: len(queries)]]
    assert 0 < len(queries) < 300
    assert f"The answers to {len(queries)} photos until then are kept" in said
    assert said.endswith("Stopped.\n")  # it does not go on from there
