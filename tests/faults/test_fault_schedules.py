"""Jobs at which faults are thrown at random; `make faults` throws at a hundred, and tells of each.

FLANEUR_FAULTS_N : how many. FLANEUR_FAULTS_SEED : that of the first; one alone, unless N is given.
"""

import os
import random
import time

import pytest
from aftermath import assert_well
from proving_ground import Command
from schedules import Schedule, Story, Throw, draw, known_faults, play
from telling import STORIES
from undisturbed import Undisturbed


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "seed" in metafunc.fixturenames:
        metafunc.parametrize(
            "seed", seeds() if metafunc.config.getoption("--faults", default=False) else [0]
        )


def seeds() -> range:
    given = os.environ.get("FLANEUR_FAULTS_SEED")
    number = int(os.environ.get("FLANEUR_FAULTS_N") or (1 if given else 100))
    first = int(given) if given else random.SystemRandom().randrange(10**9)
    return range(first, first + number)


@pytest.mark.faults
def test_a_job_ends_as_undisturbed_whatever_is_thrown_at_it(
    command: Command, undisturbed: Undisturbed, seed: int
) -> None:
    schedule = draw(seed, known_faults(can_fill=command.ground.can_fill))
    end_as_undisturbed(schedule, command, undisturbed)


def test_a_job_ends_as_undisturbed_after_one_fault_upon_another(
    command: Command, undisturbed: Undisturbed
) -> None:
    throws = [(1, "kill worker"), (13, "lose server"), (20, "deliver twice"), (26, "kill child")]
    schedule = Schedule(0, tuple(Throw(at, 0.0, fault) for at, fault in throws), deadly=())
    end_as_undisturbed(schedule, command, undisturbed)


def end_as_undisturbed(schedule: Schedule, command: Command, undisturbed: Undisturbed) -> None:
    """Throw all that is planned, and see that nothing came of it."""
    expected = undisturbed.contents(schedule.deadly)
    story = Story(schedule.seed)
    STORIES.append(story)
    began = time.monotonic()
    play(schedule, command, story)
    assert_well(command, expected, schedule.deadly)
    story.outcome = f"exit {command.ended()}"
    story.seconds = time.monotonic() - began
