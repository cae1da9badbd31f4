"""Whoever watches sees which jobs go on, which ended and which died, from files alone."""

import fcntl
import json
import os
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from made_follower import N_SHARDS, extract, made_job
from typer.testing import CliRunner

from coordinator.cli import main
from coordinator.cli.show import Bars
from coordinator.watching.lines import in_one_line, to_go_on
from coordinator.watching.progress import JobProgress, StageProgress, write_progress
from coordinator.watching.seeing import QUIET_S, Sight
from coordinator.watching.watch import watching
from index.commits import working
from index.jobs import JobFolder

REPOSITORY = Path(__file__).parents[2]


def at_work(host: str = "elsewhere", age_s: float = 0.0) -> JobProgress:
    now = datetime.now(UTC) - timedelta(seconds=age_s)
    return JobProgress(
        job="ab" * 8,
        verb="index",
        state="at work",
        stage="extract",
        stages=(StageProgress("extract", 4, 1),),
        images=11,
        images_done=3,
        images_per_s=0.5,
        stage_left_s=7500.0,
        left_s=None,
        skipped=2,
        lost=0,
        refused=0,
        failed=0,
        workers=(),
        told="",
        host=host,
        pid=1,
        begun_at=now.isoformat(),
        updated_at=now.isoformat(),
        beat=1,
        command="flaneur index survey town",
    )


@pytest.fixture
def job(tmp_path: Path) -> JobFolder:
    return made_job(tmp_path)[0]


def test_a_job_at_work_tells_its_pace_and_what_it_does_not_know(job: JobFolder) -> None:
    write_progress(job.path, at_work())
    with working(job):
        (seen,) = Sight(job.root).look()
    assert seen.is_at_work
    line = in_one_line(seen)
    assert "extract 1 of 4, 3 of 11 images, 0.50 images/s, 2 h 5 min left of extract" in line
    assert "of the job unknown" in line
    assert "2 images skipped" in line
    assert to_go_on(seen, job.root) is None


def test_a_coordinator_that_was_killed_here_is_seen_at_once(job: JobFolder) -> None:
    write_progress(job.path, at_work(socket.gethostname()))
    (seen,) = Sight(job.root).look()
    assert seen.died
    assert "stopped without a word" in in_one_line(seen)
    told = to_go_on(seen, job.root)
    assert told == "To go on, run the same command again: flaneur index survey town"


def test_where_locks_do_not_reach_a_coordinator_lives_while_it_writes(job: JobFolder) -> None:
    now = 0.0
    sight = Sight(job.root, lambda: now)
    an_hour_off = at_work(age_s=3600.0)
    for beat in range(5):
        write_progress(job.path, replace(an_hour_off, beat=beat))
        (seen,) = sight.look()
        assert seen.is_at_work or beat == 0, "its clock is an hour off, and it writes"
        now += QUIET_S - 1
    assert sight.look()[0].is_at_work
    now += 2
    assert sight.look()[0].died


def test_a_frozen_coordinator_is_told_to_be_silent(job: JobFolder) -> None:
    now = 0.0
    sight = Sight(job.root, lambda: now)
    write_progress(job.path, at_work())
    with working(job):
        sight.look()
        now += 50.0
        (seen,) = sight.look()
    assert "at work, silent for 50" in in_one_line(seen)


def test_what_ended_well_is_shown_only_if_it_was_watched(job: JobFolder) -> None:
    other = JobFolder(job.root, "cd" * 8)
    other.path.mkdir(parents=True)
    done = replace(at_work(), job=other.job, state="finished")
    write_progress(other.path, done)
    sight = Sight(job.root)
    assert [each.progress.job for each in sight.look()] == [other.job], "there is nothing else"
    write_progress(job.path, at_work())
    with working(job):
        assert [each.progress.job for each in sight.look()] == [job.job]
    write_progress(job.path, replace(at_work(), state="finished", beat=2))
    assert [each.progress.job for each in sight.look()] == [job.job]


@pytest.mark.parametrize("content", [b"", b"{}", b'{"job": 3}', b"\xff\xfe", b"[" * 100_000])
def test_damaged_progress_is_none(job: JobFolder, content: bytes) -> None:
    (job.path / "progress.json").write_bytes(content)
    assert Sight(job.root).look() == []


def test_a_folder_that_is_no_index_is_not_watched(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["status", str(tmp_path / "nothing"), "--watch"])
    assert result.exit_code == 2
    assert "is no index" in result.stderr


def test_names_cannot_command_the_terminal(job: JobFolder) -> None:
    write_progress(job.path, replace(at_work(), verb="\x1b[2Jindex", state="failed"))
    lines = watched_lines(job.root, 1)
    assert lines
    assert not any("\x1b" in line for line in lines)


def test_watch_follows_a_job_of_another_process_until_ctrl_c(job: JobFolder) -> None:
    plan = job.read_plan()
    with (
        (job.path / "plan.json").open("rb") as stream,
        watching(job, plan, Bars(None)) as watch,
    ):
        fcntl.flock(stream, fcntl.LOCK_SH)
        watch.begin("extract", N_SHARDS, 0)
        extract(job, watch, 0)
        done = [json.loads(line)["jobs"][0] for line in watched_lines(job.root, 2, "--json")]
    assert [each["state"] for each in done] == ["at work", "at work"]
    assert done[0]["beat"] < done[1]["beat"]
    assert done[1]["images_done"] == 3


def watched_lines(root: Path, number: int, *options: str) -> list[str]:
    """The first lines of `flaneur status --watch`, which is then ended by Ctrl-C."""
    with subprocess.Popen(
        [sys.executable, "-m", "coordinator.cli", "status", str(root), "--watch", *options],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "PYTHONUNBUFFERED": "1"},
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        lines = [process.stdout.readline() for _ in range(number)]
        time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=20) == 0, process.stderr.read()
        assert process.stderr.read() == ""
    return [line for line in lines if line]
