"""What a coordinator notes of its job: journal, progress and report."""

import errno
import json
import logging
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import get_args

import pytest
from made_follower import N_IMAGES, N_SHARDS, SHARD_SIZE, WORKERS, extract, made_job, order

from contracts.errors import Cancelled, TaskFailed
from contracts.records import Skipped
from coordinator.cli.show import Bars
from coordinator.following.events import Event, Kind
from coordinator.watching.journal import Journal, Record, path_of, read_journal
from coordinator.watching.logged import log_event
from coordinator.watching.pace import AT_LEAST, WINDOW_S, Pace
from coordinator.watching.progress import read_progress
from coordinator.watching.reasons import grouped
from coordinator.watching.report import report_of
from coordinator.watching.tally import Tally
from coordinator.watching.watch import Watch, watching


def test_a_finished_job_has_a_report_of_stages_shards_workers_and_reasons(tmp_path: Path) -> None:
    job, plan = made_job(tmp_path)
    with watching(job, plan, Bars(None)) as watch:
        watch.begin("extract", N_SHARDS, 0)
        extract(job, watch, 0)
        extract(job, watch, 1, Skipped("4.jpg", "is empty (0 bytes)"))
        extract(job, watch, 2, Skipped("7.jpg", "is empty (31 bytes)"))
        watch.hear(Event("lost", order("extract", 3), "north:11"))
        extract(job, watch, 3)
        with watch.at("commit"):
            pass
    report = report_of(job)
    assert json.loads((job.path / "report.json").read_text())["job"] == job.job
    assert [(each.stage, each.tasks) for each in report.stages] == [("extract", 4), ("commit", 1)]
    assert report.stages[0].task_s == pytest.approx(1.5 + 2.5 + 3.5 + 4.5)
    assert report.images_extracted == N_IMAGES - 2
    assert [(each.key, each.worker) for each in report.slowest[:2]] == [
        ("000003", WORKERS[1]),
        ("000002", WORKERS[0]),
    ]
    assert [(each.reason, each.images) for each in report.skipped] == [("is empty (… bytes)", 2)]
    assert report.counts == {"lost": 1}
    assert {each.worker: each.tasks for each in report.workers if each.worker in WORKERS} == {
        "north:11": 2,
        "south:22": 2,
    }
    text = (job.path / "report.txt").read_text()
    assert "is empty (… bytes)" in text
    assert "extract 000003  south:22" in text


def test_a_report_tells_of_all_runs_and_how_each_ended(tmp_path: Path) -> None:
    job, plan = made_job(tmp_path)
    killed = Watch(job, plan, Bars(None))
    killed.start()
    killed.begin("extract", N_SHARDS, 0)
    extract(job, killed, 0)
    with suppress(Cancelled), watching(job, plan, Bars(None)) as watch:
        watch.begin("extract", N_SHARDS, 1)
        extract(job, watch, 1)
        raise Cancelled("Cancelled.")
    with pytest.raises(TaskFailed), watching(job, plan, Bars(None)):
        raise TaskFailed("extract 000002 failed: no such file")
    report = report_of(job)
    assert [run.how for run in report.runs] == ["", "cancelled", "failed"]
    assert report.runs[2].told == "extract 000002 failed: no such file"
    assert report.stages[0].tasks == 2
    progress = read_progress(job.path)
    assert progress is not None
    assert progress.state == "failed"
    killed.end("stopped")


def test_progress_counts_what_earlier_runs_did_and_skipped(tmp_path: Path) -> None:
    job, plan = made_job(tmp_path)
    with watching(job, plan, Bars(None)) as watch:
        watch.begin("extract", N_SHARDS, 0)
        extract(job, watch, 0, Skipped("1.jpg", "is empty"))
    with watching(job, plan, Bars(None)) as watch:
        watch.begin("extract", N_SHARDS, 1)
        extract(job, watch, 3)
    progress = read_progress(job.path)
    assert progress is not None
    assert [(each.name, each.total, each.done) for each in progress.stages] == [
        ("extract", N_SHARDS, 2)
    ]
    assert progress.images_done == 2 * SHARD_SIZE
    assert progress.skipped == 1
    assert progress.state == "finished"


def test_shards_that_were_there_already_are_not_counted_as_extracted_again(tmp_path: Path) -> None:
    job, plan = made_job(tmp_path)
    for anew in (True, False):
        with watching(job, plan, Bars(None)) as watch:
            watch.begin("extract", N_SHARDS, 0)
            for shard in range(N_SHARDS):
                extract(job, watch, shard, anew=anew)
    assert report_of(job).images_extracted == N_IMAGES


def test_nothing_is_promised_before_anything_is_known(tmp_path: Path) -> None:
    _, plan = made_job(tmp_path)
    tally = Tally(plan, (), "")
    tally.begin("extract", N_SHARDS, 0)
    assert tally.progress(()).stage_left_s is None
    tally.advance("extract")
    at = tally.progress(())
    assert at.stage_left_s is not None
    assert at.left_s is None, "nobody knows of the stages to come"
    tally.hear(Event("paused"))
    assert tally.progress(()).state == "paused"
    assert tally.progress(()).stage_left_s is None
    tally.hear(Event("resumed"))
    assert tally.progress(()).state == "at work"


def test_a_pace_is_that_of_the_last_minutes() -> None:
    now = 0.0
    pace = Pace(lambda: now)
    assert pace.per_s() is None
    for _ in range(200):
        now += 100.0
        pace.add(5)
    for _ in range(700):
        now += 1.0
        pace.add(2)
    assert pace.per_s() == pytest.approx(2.0, rel=0.01)
    assert pace.left_s(20) == pytest.approx(10.0, rel=0.01)
    now += WINDOW_S
    assert pace.per_s() < 1.01, "standing still counts"  # type: ignore[operator]
    assert AT_LEAST < 700


def test_slow_work_has_a_pace_over_its_last_pieces() -> None:
    now = 0.0
    pace = Pace(lambda: now)
    for _ in range(AT_LEAST * 2):
        now += WINDOW_S
        pace.add()
    assert pace.per_s() == pytest.approx(1 / WINDOW_S)


def test_a_line_that_was_cut_off_costs_nothing_but_itself(tmp_path: Path) -> None:
    first = Journal(tmp_path)
    first.write(Record("2026-01-01T00:00:00+00:00", "run"))
    with path_of(tmp_path).open("ab") as stream:
        stream.write(b'{"at": "2026-01-01T00:00:01+00:00", "ki')
    second = Journal(tmp_path)
    second.write(Record("2026-01-01T00:00:02+00:00", "done", "extract", "000001"))
    first.close()
    second.close()
    assert [record.kind for record in read_journal(tmp_path)] == ["run", "done"]


def test_a_journal_grows_by_what_is_done_and_not_by_what_is_sent(tmp_path: Path) -> None:
    job, plan = made_job(tmp_path)
    with watching(job, plan, Bars(None)) as watch:
        watch.begin("extract", 1000, 0)
        before = path_of(job.path).stat().st_size
        for number in range(1000):
            watch.hear(Event("sent", order("assign", number)))
        assert path_of(job.path).stat().st_size == before
        for number in range(1000):
            watch.hear(Event("done", order("assign", number), "north:11", 1.0))
        assert path_of(job.path).stat().st_size - before < 150 * 1000


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
@pytest.mark.parametrize("kind", get_args(Kind))
def test_whatever_happens_is_logged_in_words(kind: Kind, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG, logger="flaneur"):
        log_event(Event(kind, order("extract", 3)))
    assert len(caplog.records) == 1


def test_a_job_without_workers_says_so_until_one_joins(tmp_path: Path) -> None:
    job, plan = made_job(tmp_path)
    with watching(job, plan, Bars(None)) as watch:
        watch.hear(Event("alone"))
    tally = Tally(plan, (), "")
    tally.hear(Event("alone"))
    assert tally.progress(()).state == "alone"
    tally.hear(Event("joined"))
    assert tally.progress(()).state == "at work"
    assert "1 times no worker listened" in (job.path / "report.txt").read_text()


def test_a_full_disk_does_not_end_the_job(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    job, plan = made_job(tmp_path)
    path_of(job.path).symlink_to("/dev/full")
    with pytest.raises(OSError, match=os.strerror(errno.ENOSPC)):
        Journal(job.path).write(Record("", "run"))
    with watching(job, plan, Bars(None)) as watch:
        watch.begin("extract", N_SHARDS, 0)
        for shard in range(N_SHARDS):
            extract(job, watch, shard)
    told = [each for each in caplog.messages if "No space left" in each]
    assert len(told) == 1
    progress = read_progress(job.path)
    assert progress is not None
    assert progress.images_done == N_IMAGES


@pytest.mark.parametrize(
    ("survey", "told"),
    [
        ("a town", "cd {here} && flaneur index 'a town' {here}/index"),
        ("{here}/a town", "flaneur index '{here}/a town' {here}/index"),
        ("s3://a/town", "flaneur index s3://a/town {here}/index"),
    ],
)
def test_the_command_to_go_on_holds_in_any_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, survey: str, told: str
) -> None:
    (tmp_path / "a town").mkdir()
    monkeypatch.chdir(tmp_path)
    here = str(tmp_path)
    given = ["flaneur", "index", survey.format(here=here), f"{here}/index"]
    monkeypatch.setattr(sys, "argv", given)
    job, plan = made_job(tmp_path / "index")
    with watching(job, plan, Bars(None)):
        pass
    progress = read_progress(job.path)
    assert progress is not None
    assert progress.command == told.format(here=here)


def test_reasons_that_differ_by_names_and_numbers_are_one() -> None:
    skipped = [
        Skipped("a.jpg", "cannot be opened: /archive/2019/a.jpg is missing"),
        Skipped("b.jpg", "cannot be opened: /archive/2020/b c.jpg is missing"),
        Skipped("c.jpg", "is 12 x 34 pixels, expected at least 64"),
        Skipped("d.jpg", "is 9 x 1 pixels, expected at least 64"),
        Skipped("e.jpg", "is 7 x 3 pixels, expected at least 64"),
        Skipped("f.jpg", "has a broken header"),
    ]
    found = grouped(skipped)
    assert (found[0].reason, found[0].images) == ("is … x … pixels, expected at least …", 3)
    assert found[0].example == "c.jpg: is 12 x 34 pixels, expected at least 64"
    assert {each.reason for each in found} >= {"has a broken header"}
    assert sum(each.images for each in found) == len(skipped)
