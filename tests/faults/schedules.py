"""Random schedules: which faults are thrown at a job, and when; the same again by their seed."""

import random
import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from proving_ground import Command, clock_library
from throwing import FAULTS, Scene
from undisturbed import N_IMAGES, SHARD_SIZE, name_of

DEADLY = "deadly image"
NO_ROOM = "No space left on device"
MOST = 4
"""Faults at one job."""
N_TASKS = {"extract": N_IMAGES // SHARD_SIZE, "train": 2, "assign": N_IMAGES // SHARD_SIZE}
N_TASKS |= {"merge": 2, "join": 2}


@dataclass(frozen=True, slots=True, order=True)
class Throw:
    """One fault. n_done : once so many tasks of the job are done, and `wait_s` have passed."""

    n_done: int
    wait_s: float
    fault: str


@dataclass(frozen=True, slots=True)
class Schedule:
    """What is done to one job. deadly : numbers of images that kill whoever opens them."""

    seed: int
    throws: tuple[Throw, ...]
    deadly: tuple[int, ...]


@dataclass(slots=True)
class Story:
    """What was done to a job, and what came of it. n_runs : of the command, until it was done."""

    seed: int
    thrown: list[str] = field(default_factory=list)
    too_late: list[str] = field(default_factory=list)
    n_runs: int = 0
    seconds: float = 0.0
    outcome: str = "FAILED"


def draw(seed: int, faults: Sequence[str]) -> Schedule:
    """The schedule of a seed, of these faults and deadly images."""
    rng = random.Random(seed)  # noqa: S311 - no secret
    drawn = rng.choices([*faults, DEADLY], k=rng.randint(1, MOST))
    throws = sorted(_throw(rng, fault) for fault in drawn if fault != DEADLY)
    deadly = rng.sample(range(N_IMAGES), drawn.count(DEADLY))
    return Schedule(seed, tuple(throws), tuple(sorted(deadly)))


def _throw(rng: random.Random, fault: str) -> Throw:
    """At a moment in any of the stages, short ones as likely as long ones."""
    stages = list(N_TASKS)
    stage = rng.choice(stages)
    before = sum(N_TASKS[each] for each in stages[: stages.index(stage)])
    return Throw(before + rng.randrange(N_TASKS[stage]), rng.uniform(0, 0.2), fault)


def play(schedule: Schedule, command: Command, story: Story) -> None:
    """Run the command, throw the faults, and run it again wherever a person would.

    Raises
    ------
    AssertionError : it ended in a way that none of the faults explains.
    """
    scene = Scene(command, random.Random(schedule.seed))  # noqa: S311 - no secret
    for number in schedule.deadly:
        command.ground.switches.make_deadly(name_of(number))
        story.thrown.append(f"{DEADLY} {name_of(number)}")
    _begin(scene, story)
    for throw in schedule.throws:
        told = f"{throw.fault} @{throw.n_done}"
        if _comes(throw, command):
            story.thrown.append(told)
            FAULTS[throw.fault](scene)
            _again_if_stopped(scene, story)
        else:
            story.too_late.append(told)
    command.ended()
    while _again_if_stopped(scene, story):
        command.ended()


def _begin(scene: Scene, story: Story) -> None:
    story.n_runs += 1
    scene.command.begin(scene.skew_s())


def _comes(throw: Throw, command: Command) -> bool:
    """Wait for the moment of a fault; whether the job is still at work then."""
    while command.n_done() < throw.n_done and not command.is_over:
        time.sleep(0.01)
    time.sleep(throw.wait_s)
    return not command.is_over


def _again_if_stopped(scene: Scene, story: Story) -> bool:
    """Run the command again if it was killed, or found the disk full."""
    command = scene.command
    if not command.is_over or command.ended() in (0, 3):
        return False
    was_killed = command.ended() < 0
    assert was_killed or (command.ended() == 1 and NO_ROOM in command.told()), command.told()
    _begin(scene, story)
    return True


def known_faults(*, can_fill: bool) -> list[str]:
    """What can be thrown here."""
    return [name for name in FAULTS if can_fill or name != "fill disk"]


def table(stories: Sequence[Story]) -> list[str]:
    """What was thrown and what came of it, a line a schedule, and a count of each fault."""
    clocks = "some clocks an hour off" if clock_library() else "all clocks right (no libfaketime)"
    lines = [f"{'seed':>10}  {'runs':>4}  {'s':>5}  {'came of it':<10}  thrown @tasks done"]
    for each in stories:
        thrown = ", ".join([*each.thrown, *(f"({late}: too late)" for late in each.too_late)])
        lines.append(
            f"{each.seed:>10}  {each.n_runs:>4}  {each.seconds:5.1f}  {each.outcome:<10}  {thrown}"
        )
    thrown = [told for each in stories for told in each.thrown]
    counts = {name: sum(told.startswith(name) for told in thrown) for name in (*FAULTS, DEADLY)}
    lines.append(", ".join(f"{name}: {count}" for name, count in counts.items()) + f"; {clocks}")
    whole = sum(each.outcome != "FAILED" for each in stories)
    seconds = sum(each.seconds for each in stories)
    lines.append(f"{whole} of {len(stories)} jobs ended as undisturbed, in {seconds:.0f} s")
    return lines
