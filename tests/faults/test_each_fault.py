"""One fault at a time, in each stage of a job of real processes: the index is as if none had been.

A worker is held where it is about to write, so that the fault meets it in the middle.
"""

import os
import signal
import subprocess
import time

import psutil
import pytest
from aftermath import assert_well
from proving_ground import SKEW_S, Command, Ground, clock_library, kill_group
from switches import STAGES
from throwing import filled
from undisturbed import Undisturbed, name_of
from waiting import wait_until


def stages(quick: str = "") -> pytest.MarkDecorator:
    """In each stage, of which one is soon tried."""
    marks = [() if stage == quick else pytest.mark.faults for stage in STAGES]
    cases = [pytest.param(stage, marks=mark) for stage, mark in zip(STAGES, marks, strict=True)]
    return pytest.mark.parametrize("stage", cases)


@stages()
def test_a_worker_process_that_is_killed_costs_nothing(
    command: Command, undisturbed: Undisturbed, stage: str
) -> None:
    with command.ground.switches.holding(stage) as first_held:
        command.begin()
        os.kill(first_held(), signal.SIGKILL)
    assert_well(command, undisturbed.contents())


@stages()
def test_a_machine_that_loses_power_costs_nothing(
    command: Command, undisturbed: Undisturbed, stage: str
) -> None:
    with command.ground.switches.holding(stage) as first_held:
        command.begin()
        kill_group(worker_of(command.ground, first_held()))
    assert_well(command, undisturbed.contents())


@stages()
def test_a_worker_whose_main_process_is_killed_leaves_no_process(
    command: Command, undisturbed: Undisturbed, stage: str
) -> None:
    with command.ground.switches.holding(stage) as first_held:
        command.begin()
        child = first_held()
        worker = worker_of(command.ground, child)
        worker.kill()
        worker.wait()
    assert_well(command, undisturbed.contents())
    wait_until(lambda: not psutil.pid_exists(child), "the end of what it had started")


@stages("merge")
def test_a_coordinator_that_is_killed_goes_on_when_run_again(
    command: Command, undisturbed: Undisturbed, stage: str
) -> None:
    with command.ground.switches.holding(stage) as first_held:
        command.begin()
        first_held()
        command.kill()
        command.begin()
    assert_well(command, undisturbed.contents())


@stages()
def test_what_a_coordinator_and_a_worker_took_to_their_graves_is_not_done_hours_later(
    command: Command, undisturbed: Undisturbed, stage: str
) -> None:
    with command.ground.switches.holding(stage) as first_held:
        command.begin()
        kill_group(worker_of(command.ground, first_held()))
        command.kill()
        command.begin()
    assert command.ended() == 0
    assert command.ground.server.untold()
    assert_well(command, undisturbed.contents())


@stages()
def test_a_server_that_comes_back_with_its_data_costs_nothing(
    command: Command, undisturbed: Undisturbed, stage: str
) -> None:
    with command.ground.switches.holding(stage) as first_held:
        command.begin()
        first_held()
        command.ground.server.stop()
        command.ground.server.start(with_data=True)
    assert_well(command, undisturbed.contents())


@stages()
def test_a_server_that_comes_back_with_nothing_costs_nothing(
    command: Command, undisturbed: Undisturbed, stage: str
) -> None:
    with command.ground.switches.holding(stage) as first_held:
        command.begin()
        first_held()
        command.ground.server.stop()
        command.ground.server.start(with_data=False)
    assert_well(command, undisturbed.contents())


@stages()
def test_a_task_that_ends_while_the_server_is_away_has_not_failed(
    command: Command, undisturbed: Undisturbed, stage: str
) -> None:
    with command.ground.switches.holding(stage) as first_held:
        command.begin()
        child = first_held()
        name, key = command.ground.server.at_work()[child].split(" ", 1)
        command.ground.server.stop()
    wait_until(lambda: key in command.receipts(name), "the task to end")
    time.sleep(1)  # until it has tried to tell so
    command.ground.server.start(with_data=True)
    assert_well(command, undisturbed.contents())


@stages()
def test_a_worker_that_froze_finishes_what_another_has_done_meanwhile(
    command: Command, undisturbed: Undisturbed, stage: str
) -> None:
    with command.ground.switches.holding(stage) as first_held:
        command.begin()
        child = first_held()
        name, key = command.ground.server.at_work()[child].split(" ", 1)
        worker = worker_of(command.ground, child)
        os.killpg(worker.pid, signal.SIGSTOP)
    try:
        wait_until(lambda: key in command.receipts(name), "another worker to do the same")
    finally:
        os.killpg(worker.pid, signal.SIGCONT)
    assert_well(command, undisturbed.contents())


@stages()
def test_a_worker_that_froze_wakes_when_all_is_done(
    command: Command, undisturbed: Undisturbed, stage: str
) -> None:
    with command.ground.switches.holding(stage) as first_held:
        command.begin()
        worker = worker_of(command.ground, first_held())
        os.killpg(worker.pid, signal.SIGSTOP)
    try:
        assert command.ended() == 0
    finally:
        os.killpg(worker.pid, signal.SIGCONT)
    assert_well(command, undisturbed.contents())


@stages()
def test_a_full_disk_is_told_by_the_path_and_forgotten_once_there_is_room(
    command: Command, undisturbed: Undisturbed, stage: str
) -> None:
    if not command.ground.can_fill:
        pytest.skip("a small disk of our own cannot be mounted here")
    with command.ground.switches.holding(stage) as first_held:
        command.begin()
        first_held()
        with filled(command.ground.disk):
            command.ground.switches.all_off()
            assert command.ended() == 1
    assert "No space left on device" in command.told()
    assert f"{command.root}/" in command.told()
    command.begin()
    assert_well(command, undisturbed.contents())


@pytest.mark.faults
@pytest.mark.skipif(clock_library() is None, reason="libfaketime is not installed")
@pytest.mark.parametrize(("of_worker_s", "of_coordinator_s"), [(SKEW_S, -SKEW_S), (-SKEW_S, 0)])
def test_clocks_that_are_an_hour_off_are_not_noticed(
    command: Command, undisturbed: Undisturbed, of_worker_s: int, of_coordinator_s: int
) -> None:
    kill_group(command.ground.workers[0])
    command.ground.replenish(of_worker_s)
    command.ground.wait_for_workers()
    with command.ground.switches.holding("assign") as first_held:
        command.begin(of_coordinator_s)
        os.kill(first_held(), signal.SIGKILL)
    assert_well(command, undisturbed.contents())


@pytest.mark.faults
def test_workers_whose_clocks_are_all_an_hour_ahead_are_found(
    command: Command, undisturbed: Undisturbed
) -> None:
    if clock_library() is None:
        pytest.skip("libfaketime is not installed")
    command.ground.stop_workers()
    command.ground.replenish(SKEW_S)
    command.ground.wait_for_workers()
    command.begin()
    assert_well(command, undisturbed.contents())


@pytest.mark.faults
def test_a_slow_shared_folder_is_waited_for(command: Command, undisturbed: Undisturbed) -> None:
    command.ground.switches.make_slow()
    command.begin()
    assert_well(command, undisturbed.contents())


@pytest.mark.faults
def test_images_that_kill_whoever_opens_them_are_left_out_and_named(
    command: Command, undisturbed: Undisturbed
) -> None:
    without = (4, 5, 13)  # 4 and 5 are one shard
    for number in without:
        command.ground.switches.make_deadly(name_of(number))
    command.begin()
    assert_well(command, undisturbed.contents(without), without)


def worker_of(ground: Ground, child: int) -> "subprocess.Popen[bytes]":
    """The worker whose pool a process is in."""
    main = psutil.Process(child).ppid()
    return next(worker for worker in ground.workers if worker.pid == main)
