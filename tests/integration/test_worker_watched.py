"""A real worker is scraped over HTTP and tells structured lines; a coordinator too."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest
from flaneur_command import run
from prometheus_client.parser import text_string_to_metric_families

from contracts.config import FeatureConfig, IndexConfig
from contracts.errors import BadConfig
from coordinator.cli.announcing import announced
from coordinator.cli.show import Bars
from coordinator.engine.embedded import embedded_server
from coordinator.engine.running import JOB_QUEUES, running_engine
from coordinator.following.events import Event, Order
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from coordinator.watching.report import report_of
from index.jobs import JobFolder
from survey import ReadOptions
from workers.presence import listening
from workers.server import connect

REPOSITORY = Path(__file__).parents[2]
PATIENCE_S = 60.0
SECRET = "hush-hush"  # noqa: S105


@dataclass(frozen=True, slots=True)
class Watched:
    """A worker that one job was done by."""

    broker: str
    port: int
    process: "subprocess.Popen[bytes]"
    log: Path
    job: JobFolder


@pytest.fixture(scope="module")
def watched(small_survey: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Watched]:
    folder = tmp_path_factory.mktemp("watched")
    log, port = folder / "worker.log", free_port()
    with embedded_server(folder) as broker, a_worker(broker, log, port) as process:
        eventually(lambda: bool(listening(connect(broker))))
        job = index(small_survey, folder / "index", broker)
        yield Watched(broker, port, process, log, job)


@contextmanager
def a_worker(broker: str, log: Path, port: int) -> "Iterator[subprocess.Popen[bytes]]":
    command = [sys.executable, "-m", "coordinator.cli", "worker", "--broker", broker]
    command += ["--processes", "1", "--metrics-port", str(port)]
    with log.open("wb") as stream:
        process = subprocess.Popen(
            command,
            stdout=stream,
            stderr=stream,
            start_new_session=True,
            env={
                **os.environ,
                "PYTHONPATH": str(REPOSITORY),
                "FLANEUR_LOG": "json",
                "TMPDIR": str(log.parent),
            },
        )
    try:
        yield process
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def index(survey: Path, root: Path, broker: str) -> JobFolder:
    intake = read_surveys([("", survey)], ReadOptions(crs="EPSG:2154"))
    config = IndexConfig(features=FeatureConfig.of(detectors=("star",), descriptors=("sift",)))
    job, plan = make_plan(root, intake, config, 5)
    run_job(job, plan, intake, running_engine(broker, None, JOB_QUEUES), Bars(None))
    return job


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def scraped(port: int) -> dict[str, float]:
    """Every sample by its name and the values of its labels, in the order of the alphabet."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=10) as answer:
        text = answer.read().decode()
    return {
        " ".join([sample.name, *sorted(sample.labels.values())]): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def eventually(holds: Callable[[], bool]) -> None:
    gives_up_at = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < gives_up_at
        time.sleep(0.05)


def lines_of(log: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in log.read_text().splitlines()]


def test_a_scrape_tells_tasks_images_and_processes(watched: Watched) -> None:
    counts = scraped(watched.port)
    assert counts["flaneur_tasks_begun_total extract"] == 2
    assert counts["flaneur_tasks_total done extract"] == 2
    assert counts["flaneur_tasks_total done join"] == 1
    assert counts["flaneur_images_total extracted"] == 10
    assert counts["flaneur_images_total skipped"] == 0
    assert counts["flaneur_task_seconds_count extract"] == 2
    assert counts["flaneur_worker_processes"] == 1
    started = counts["flaneur_worker_start_timestamp_seconds"]
    assert started < counts["flaneur_last_lease_timestamp_seconds"] <= time.time()


def test_every_line_is_json_and_tells_the_job_and_the_shard(watched: Watched) -> None:
    lines = lines_of(watched.log)
    done = [each for each in lines if each["event"] == "task done"]
    (first,) = [each for each in done if each["stage"] == "extract" and each["shard"] == "000000"]
    assert first["job"] == watched.job.job
    assert first["level"] == "info"
    assert str(first["task_id"]).endswith(".extract.000000")
    assert str(first["worker"]).startswith(f"{socket.gethostname()}:")
    assert str(first["at"]).endswith("Z")
    assert isinstance(first["seconds"], float)
    (told,) = [each for each in lines if "FLANEUR_ROOT" in str(each["event"])] or [None]
    assert told is None or told["level"] == "warning"


def test_the_report_names_the_worker_that_did_it(watched: Watched) -> None:
    report = report_of(watched.job)
    (worker,) = {each.worker for each in report.workers if each.tasks > 1}
    (pool,) = psutil.Process(watched.process.pid).children()
    assert worker == f"{socket.gethostname()}:{pool.pid}"
    assert [each.stage for each in report.stages] == [
        *("extract", "train", "assign", "merge", "join", "commit")
    ]


def test_what_a_process_counted_stays_when_it_is_killed(
    watched: Watched, small_survey: Path, tmp_path: Path
) -> None:
    before = scraped(watched.port)
    (pool,) = psutil.Process(watched.process.pid).children()
    pool.kill()
    assert scraped(watched.port)["flaneur_images_total extracted"] == 10
    eventually(lambda: any(pool != each for each in others_of(watched)))
    index(small_survey, tmp_path / "index", watched.broker)
    after = scraped(watched.port)
    assert after["flaneur_images_total extracted"] == 20
    key = "flaneur_tasks_total done extract"
    assert after[key] == 2 * before[key]
    assert all(json.loads(line) for line in watched.log.read_text().splitlines())


def others_of(watched: Watched) -> list[psutil.Process]:
    return list(psutil.Process(watched.process.pid).children())


def test_a_coordinator_counts_its_orders_by_stage() -> None:
    port = free_port()
    orders = [Order("extract", f"{number:06d}", {}) for number in range(3)]
    with announced(port, "127.0.0.1") as told:
        told.progress.begin("extract", 5, 2)
        for order in orders:
            told.listen(Event("sent", order))
        told.listen(Event("done", orders[0], "north:1", 2.0))
        told.listen(Event("lost", orders[1]))
        told.listen(Event("sent", orders[1]))
        told.listen(Event("waiting", told="away"))
        counts = scraped(port)
        assert counts["flaneur_orders_total extract sent"] == 4
        assert counts["flaneur_orders_total extract lost"] == 1
        assert counts["flaneur_orders_in_flight extract"] == 2
        assert counts["flaneur_orders_planned extract"] == 5
        assert counts["flaneur_orders_done_before extract"] == 2
        assert counts["flaneur_broker_away"] == 1
        taken = pytest.raises(BadConfig, match=f"127.0.0.1:{port}.*--metrics-port")
        with taken, announced(port, "127.0.0.1"):
            pass
    with announced(port, "127.0.0.1"):  # and is free again
        pass


@pytest.mark.parametrize("style", ["json", "text"])
def test_no_line_tells_a_password(style: str) -> None:
    addresses = [
        f"redis://:{SECRET}@host:6379/0",
        f"rediss://user:{SECRET}@host/1?ssl_cert_reqs=required",
        f"redis://host:6379/0?password={SECRET}&db=1",
        f"redis://:{SECRET}@with@signs@host",
    ]
    said = f"""
import logging
from workers.logs import install, logger
install({style!r})
for address in {addresses!r}:
    logger().warning("cannot reach " + address, broker=address)
    logging.getLogger("celery.worker").error("consumer: cannot connect to %s: reset", address)
    try:
        raise OSError(address)
    except OSError:
        logger().exception("failed")
"""
    done = subprocess.run(
        [sys.executable, "-c", said],
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
    )
    assert SECRET not in done.stderr
    assert done.stderr.count("***") >= 4 * len(addresses)
    assert "OSError" in done.stderr
    assert done.stdout == ""


def test_errors_of_a_command_are_lines_of_json_too(tmp_path: Path) -> None:
    done = run("status", tmp_path / "nowhere", FLANEUR_LOG="json")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    told = json.loads(line)
    assert told["level"] == "warning"
    assert str(tmp_path / "nowhere") in told["event"]


def test_an_unknown_style_of_log_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLANEUR_LOG", "xml")
    refused = pytest.raises(BadConfig, match="FLANEUR_LOG takes json or text; got 'xml'")
    with refused, announced(None, "127.0.0.1"):
        pass
