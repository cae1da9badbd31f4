"""Workers as on other machines: of other versions, with other roots."""

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import pytest
from flaneur_command import run
from machines import (
    DEBIANS_REDIS,
    VALKEY,
    Machine,
    free_port,
    make_certificate,
    redis_server,
    wait_until,
    worker,
)

from contracts.config import CodebookConfig, FeatureConfig, IndexConfig
from contracts.errors import BrokerUnreachable, TaskFailed
from coordinator.cli.show import Bars
from coordinator.engine.broker import check_workers
from coordinator.engine.running import JOB_QUEUES, Engine, running_engine
from coordinator.following.events import Event, Listener, unheard
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from index.opened import OpenedIndex
from survey import ReadOptions
from workers.messages import our_version
from workers.presence import listening
from workers.server import connect

CONFIG = IndexConfig(
    features=FeatureConfig(detectors=("mser",), descriptors=("sift",), max_frames=60),
    codebooks=CodebookConfig(max_words=60),
)
ALL = 10
"""Images in one shard: an order is refused ten times, each after a sixth of a lease."""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a server that asks for a password, and speaks TLS where one that can is."""
    port, folder = free_port(), tmp_path_factory.mktemp("server")
    options: tuple[str, ...] = ("--requirepass", "a-secret")
    url, program = f"redis://:a-secret@localhost:{port}/0", VALKEY
    if DEBIANS_REDIS is None:
        options += ("--port", str(port))
    else:
        url, program = (
            f"{url.replace('redis', 'rediss')}?ssl_ca_certs={folder}/cert.pem",
            DEBIANS_REDIS,
        )
        options += ("--port", "0", "--tls-port", str(port), *make_certificate(folder))
    with redis_server(folder, url, *options, program=program):
        yield url


@pytest.fixture
def of_another_version(tmp_path: Path) -> str:
    """What PYTHONPATH has to begin with for a process to be of Flaneur 9.9.9."""
    about = tmp_path / "other" / "flaneur-9.9.9.dist-info" / "METADATA"
    about.parent.mkdir(parents=True)
    about.write_text("Metadata-Version: 2.1\nName: flaneur\nVersion: 9.9.9\n")
    return f"{about.parents[1]}{os.pathsep}{Path(__file__).parents[2]}"


def index(
    engine: AbstractContextManager[Engine], survey: Path, root: Path, shard_size: int = 5
) -> dict[str, str]:
    """Index the survey; what its words and postings are, by file."""
    intake = read_surveys([("", survey)], ReadOptions(crs="EPSG:2154"))
    job, plan = make_plan(root, intake, CONFIG, shard_size)
    run_job(job, plan, intake, engine, Bars(None))
    files = OpenedIndex(root).generation.files
    return {name: file.sha256 for name, file in files.items() if not name.startswith("catalogue")}


def workers_at(server: str, listen: Listener = unheard) -> AbstractContextManager[Engine]:
    return running_engine(server, None, JOB_QUEUES, listen=listen)


@pytest.fixture(scope="module")
def here(
    small_survey: Path, engine: Engine, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, dict[str, str]]:
    """A folder with a survey, as the coordinator sees it, and what an index of it holds."""
    folder = tmp_path_factory.mktemp("here")
    shutil.copytree(small_survey, folder / "surveys" / "street")
    alone = index(nullcontext(engine), small_survey, folder / "indices" / "alone")
    return folder, alone


@pytest.fixture(scope="module")
def there(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as a worker sees it."""
    return tmp_path_factory.mktemp("there")


@pytest.fixture(scope="module")
def elsewhere(server: str, here: tuple[Path, dict[str, str]], there: Path) -> Iterator[Machine]:
    """A worker that has surveys and indices elsewhere, and a folder of its own besides."""
    for name in ("surveys", "indices"):
        (there / name).symlink_to(here[0] / name)
    roots = {
        "FLANEUR_ROOT_S": str(there / "surveys"),
        "FLANEUR_ROOT_I": str(there / "indices"),
        "FLANEUR_ROOT_OWN": str(there / "own"),
    }
    options = ("--queues", ",".join(JOB_QUEUES), "--broker", server)
    with worker(server, there / "log", *options, FLANEUR_BROKER_URL="", **roots) as machine:
        yield machine


@pytest.fixture(autouse=True)
def coordinators_roots(here: tuple[Path, dict[str, str]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FLANEUR_LEASE_S", "2")
    monkeypatch.setenv("FLANEUR_ROOT_S", str(here[0] / "surveys"))
    monkeypatch.setenv("FLANEUR_ROOT_I", str(here[0] / "indices"))


def lack(server: str, *queues: str) -> str:
    """Why work on these queues is not even begun."""
    with connect(server) as client, pytest.raises(BrokerUnreachable) as told:
        check_workers(client, server, queues, patience_s=0)
    assert "a-secret" not in str(told.value)
    assert "flaneur worker --broker redis" in str(told.value)
    return str(told.value)


def test_a_worker_is_heard_of_and_its_password_is_not(server: str, elsewhere: Machine) -> None:
    with connect(server) as client:
        (told,) = listening(client)
        assert (told.pid, told.processes) == (elsewhere.process.pid, 1)
        assert told.queues == JOB_QUEUES
        assert check_workers(client, server, ("train",)) == 1
    assert "takes locate" in lack(server, "train", "locate")
    checked = run("worker", "--check", FLANEUR_BROKER_URL=server)
    assert checked.returncode == 0, checked.stderr
    command = Path(f"/proc/{elsewhere.process.pid}/cmdline").read_text()
    assert "a-secret" not in command + elsewhere.told() + checked.stderr


def test_survey_and_index_may_be_mounted_elsewhere_and_nothing_else_is_opened(
    server: str, elsewhere: Machine, here: tuple[Path, dict[str, str]], small_survey: Path
) -> None:
    folder, alone = here
    indices = folder / "indices"
    assert index(workers_at(server), folder / "surveys" / "street", indices / "town") == alone
    with pytest.raises(TaskFailed, match="outside of this worker's roots"):
        index(workers_at(server), small_survey, indices / "of a survey it has not", ALL)


def test_a_worker_of_another_version_refuses_and_one_of_ours_does_the_work(
    server: str,
    elsewhere: Machine,
    here: tuple[Path, dict[str, str]],
    of_another_version: str,
    tmp_path: Path,
) -> None:
    folder, alone = here
    heard: list[Event] = []
    options = ("--queues", "extract,locate")
    with worker(server, tmp_path / "log", *options, PYTHONPATH=of_another_version) as other:
        assert f"No worker of Flaneur {our_version()} at redis" in lack(server, "locate")
        engine = workers_at(server, heard.append)
        assert index(engine, folder / "surveys" / "street", folder / "indices" / "mixed") == alone
        with connect(server) as client:
            assert {told.version for told in listening(client)} == {our_version(), "9.9.9"}
            other.process.terminate()
            wait_until(lambda: len(listening(client)) == 1, "silence", patience_s=5)
        assert other.process.wait(20) == 0
    refusals = [event.told for event in heard if event.kind == "refused"]
    assert all("this worker runs Flaneur 9.9.9" in told for told in refusals)


def test_a_worker_that_reads_another_configuration_refuses_and_the_user_is_told(
    server: str,
    elsewhere: Machine,
    here: tuple[Path, dict[str, str]],
    there: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    survey = here[0] / "surveys" / "street"
    intake = read_surveys([("", survey)], ReadOptions(crs="EPSG:2154"))
    job, _ = make_plan(tmp_path / "index", intake, CONFIG, ALL)
    shutil.copytree(tmp_path / "index", there / "own" / "index")
    plan = there / "own" / job.path.relative_to(tmp_path) / "plan.json"
    content = json.loads(plan.read_text())
    content["config"]["codebooks"]["max_words"] = 61
    plan.write_text(json.dumps(content))
    monkeypatch.setenv("FLANEUR_ROOT_OWN", str(tmp_path))

    told = f"in the plan of job {job.job}.*Install the same version on both"
    with pytest.raises(TaskFailed, match=told):
        index(workers_at(server), survey, tmp_path / "index", ALL)
