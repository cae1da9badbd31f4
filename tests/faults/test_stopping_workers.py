"""A worker that is told to stop finishes what it has begun, unless it is told twice."""

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from machines import free_port, redis_server, wait_until, worker

from contracts.config import CodebookConfig, IndexConfig
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from index.jobs import JobFolder, JobPlan
from survey import ReadOptions
from workers.app import make_app
from workers.messages import Envelope, job_message, our_version
from workers.server import connect

pytestmark = pytest.mark.faults

CONFIG = IndexConfig(codebooks=CodebookConfig(max_words=60))
"""By all detectors: a shard of five images takes a while."""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[str]:
    port = free_port()
    with redis_server(
        tmp_path / "server", f"redis://127.0.0.1:{port}/0", "--port", str(port)
    ) as url:
        yield url


def begun(server: str, job: JobFolder, plan: JobPlan, shard: int) -> int:
    """Send a shard; the process that works on it, as soon as it does."""
    message = job_message(job, plan, shard=shard)
    envelope = Envelope(version=our_version(), lease_s=60.0, roots={}, message=message)
    make_app(server).send_task(
        "flaneur.extract", [envelope.sealed()], task_id=f"stops.{shard}", ignore_result=True
    )
    with connect(server) as client:
        wait_until(lambda: client.exists(f"flaneur:lease:stops.{shard}"), "the lease")
        lease = json.loads(client.get(f"flaneur:lease:stops.{shard}"))
    return int(lease["worker"].rpartition(":")[2])


def test_the_first_sigterm_lets_a_shard_be_finished_and_the_second_does_not(
    server: str, small_survey: Path, tmp_path: Path
) -> None:
    intake = read_surveys([("", small_survey)], ReadOptions(crs="EPSG:2154"))
    job, plan = make_plan(tmp_path / "index", intake, CONFIG, 5)
    with worker(server, tmp_path / "0.log") as machine:
        process = begun(server, job, plan, 0)
        os.kill(process, signal.SIGSTOP)
        assert not job.receipt_path("extract", "000000").exists()
        machine.process.terminate()
        wait_until(lambda: "Warm shutdown" in machine.told(), "the worker to have heard")
        os.kill(process, signal.SIGCONT)
        assert machine.process.wait(60) == 0
        assert job.valid_receipt("extract", "000000")
    with worker(server, tmp_path / "1.log") as machine:
        process = begun(server, job, plan, 1)
        for heard in ("Warm shutdown", "Cold shutdown"):
            machine.process.terminate()
            wait_until(lambda heard=heard: heard in machine.told(), heard)
        machine.process.wait(20)
        with pytest.raises(ProcessLookupError):
            os.kill(process, 0)
        assert not job.receipt_path("extract", "000001").exists()
    with connect(server) as client:  # another worker may have it
        assert (client.llen("extract"), client.hlen("unacked")) == (1, 0)
