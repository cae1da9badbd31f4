"""`flaneur job`, as a person uses it on jobs that are at work, stopped or finished."""

import json
import os
from pathlib import Path

import pytest
from index_shop import CONFIG, Shop
from typer.testing import CliRunner

from coordinator.cli import main
from coordinator.intake import read_surveys
from coordinator.plan import make_plan
from index.commits import working
from index.control import read_wish
from index.jobs import JobFolder, jobs_of
from survey import ReadOptions


def begin(survey: Path, root: Path, *include: str) -> JobFolder:
    """A job that has its plan, and nothing more."""
    options = ReadOptions(crs="EPSG:2154", include=include)
    job, _ = make_plan(root, read_surveys([("", survey)], options), CONFIG, 4)
    return job


@pytest.fixture
def begun(small_survey: Path, tmp_path: Path) -> tuple[Shop, JobFolder]:
    root = tmp_path / "begun"
    job = begin(small_survey, root)
    return Shop(root), job


def states(root: Path) -> dict[str, str]:
    """What `job list` says of each job, in its order."""
    answer = CliRunner().invoke(main, ["job", "list", str(root), "--json"])
    assert answer.exit_code == 0, answer.stderr
    return {each["job"]: each["state"] for each in json.loads(answer.stdout)}


def state(root: Path) -> str:
    (only,) = states(root).values()
    return only


def test_a_job_at_work_is_paused_resumed_and_cancelled(begun: tuple[Shop, JobFolder]) -> None:
    shop, job = begun
    with working(job):
        assert state(shop.root) == "at work"
        code, said = shop.say("job", "pause", shop.root)
        assert (code, read_wish(job.path), state(shop.root)) == (0, "pause", "pausing")
        assert "what is begun is finished" in said
        assert f"flaneur job resume {shop.root} {job.job}" in said
        shop.say("job", "resume", shop.root, job.job)
        assert (read_wish(job.path), state(shop.root)) == ("run", "at work")
        _, said = shop.say("job", "cancel", shop.root, job.job[:3])
        assert (read_wish(job.path), state(shop.root)) == ("cancel", "ending")
        assert "What is done stays" in said
    assert state(shop.root) == "cancelled"


@pytest.mark.parametrize("verb", ["pause", "resume", "cancel"])
def test_it_is_said_when_nobody_works_on_a_job(begun: tuple[Shop, JobFolder], verb: str) -> None:
    shop, job = begun
    assert state(shop.root) == "stopped"
    code, said = shop.say("job", verb, shop.root)
    assert code == 0
    assert f"Job {job.job}: nobody works on it" in said
    assert "To go on, run the same command again: flaneur index" in said
    told = shop.ask("job", verb, shop.root)
    assert told == {"job": job.job, "wish": read_wish(job.path), "at_work": False}


def test_of_several_unfinished_jobs_one_is_to_be_named_unless_one_is_at_work(
    begun: tuple[Shop, JobFolder], small_survey: Path
) -> None:
    shop, first = begun
    second = begin(small_survey, shop.root, "0[0-5].jpg")
    code, said = shop.say("job", "pause", shop.root)
    assert code == 2
    assert f"{first.job} (stopped)" in said
    assert f"{second.job} (stopped)" in said
    assert (read_wish(first.path), read_wish(second.path)) == ("run", "run")
    with working(second):
        assert shop.ask("job", "pause", shop.root)["job"] == second.job
    assert (read_wish(first.path), read_wish(second.path)) == ("run", "pause")


@pytest.mark.parametrize("name", ["", "zzzz", "../..", "0" * 17])
def test_an_unknown_id_names_the_jobs_there_are(begun: tuple[Shop, JobFolder], name: str) -> None:
    shop, job = begun
    code, said = shop.say("job", "cancel", shop.root, name)
    assert code == 2
    assert job.job in said
    assert read_wish(job.path) == "run"


def test_a_finished_job_has_nothing_to_pause(shop: Shop) -> None:
    (job,) = jobs_of(shop.root)
    assert state(shop.root) == "finished"
    code, said = shop.say("job", "pause", shop.root)
    assert code == 2
    assert "no unfinished job" in said
    code, said = shop.say("job", "pause", shop.root, job.job)
    assert code == 2
    assert f"flaneur job report {shop.root} {job.job}" in said


def test_what_is_no_index_is_named(tmp_path: Path) -> None:
    for verb in ("list", "pause", "report"):
        code, said = Shop(tmp_path).say("job", verb, tmp_path)
        assert code == 2
        assert str(tmp_path) in said


def test_the_report_of_a_finished_job_tells_its_stages(shop: Shop) -> None:
    told = shop.ask("job", "report", shop.root)
    assert told["stages"][0]["stage"] == "extract"
    assert told["images_extracted"] == 10


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_may_not_be_written_is_named(begun: tuple[Shop, JobFolder]) -> None:
    shop, job = begun
    job.path.chmod(0o555)
    code, said = shop.say("job", "pause", shop.root)
    job.path.chmod(0o755)
    assert code == 1
    assert str(job.path) in said
