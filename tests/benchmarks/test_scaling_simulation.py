"""The simulation of an index job agrees with what can be worked out by hand."""

import pytest

from benchmarks.scaling.simulation import Site, simulate
from benchmarks.scaling.tasks import Layout, Task, Work


def work(*tasks: Task) -> Work:
    return Work({"extract": list(tasks)}, plan_s=3.0, commit_s=4.0)


def wall_s(work: Work, site: Site) -> float:
    return simulate(work, site).stages["extract"].wall_s


def site(
    n_workers: int, message_s: float = 0.0, folder_bytes_s: float = 1.0, open_s: float = 0.0
) -> Site:
    return Site(n_workers, message_s, 0.0, folder_bytes_s, open_s)


COMPUTE = Task(seconds=10.0, read=0.0, written=0.0, opened=0)
TRANSFER = Task(seconds=0.0, read=6.0, written=4.0, opened=0)


def test_work_without_messages_is_shared_evenly() -> None:
    took = simulate(work(*[COMPUTE] * 6), site(3))
    assert took.stages["extract"].wall_s == pytest.approx(20.0)
    assert took.wall_s == pytest.approx(3.0 + 20.0 + 4.0)


def test_a_stage_takes_no_less_than_its_longest_task_however_many_work() -> None:
    assert wall_s(work(*[COMPUTE] * 6), site(200)) == pytest.approx(10.0)


def test_a_slow_coordinator_limits_any_number_of_workers() -> None:
    many = work(*[Task(0.1, 0.0, 0.0, 0)] * 1000)
    assert wall_s(many, site(200, message_s=0.5)) == pytest.approx(500.0, rel=0.01)
    assert wall_s(many, site(1, message_s=0.001)) == pytest.approx(100.0, rel=0.02)


def test_the_shared_folder_moves_so_many_bytes_and_no_more() -> None:
    for n_workers in (1, 50):
        moved = wall_s(work(*[TRANSFER] * 20), site(n_workers, folder_bytes_s=2.0))
        assert moved == pytest.approx(100.0)


def test_files_are_opened_at_once_by_all_workers() -> None:
    opening = work(*[Task(0.0, 0.0, 0.0, opened=5)] * 8)
    assert wall_s(opening, site(4, open_s=1.0)) == pytest.approx(10.0)


def test_a_survey_has_no_fewer_shards_than_images_need() -> None:
    assert Layout(1_000_001, 128).n_shards == 7813
