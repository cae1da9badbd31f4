"""`pytest tests/faults --faults` runs the long tests as well: what `make faults` does."""

import itertools
from collections.abc import Iterator

import pytest
from proving_ground import Command, Ground, running_ground
from schedules import table
from telling import STORIES
from undisturbed import OPTIONS, Undisturbed

_numbers = itertools.count()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--faults", action="store_true", help="run the long tests of faults as well")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "faults: takes long; run by `make faults`")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--faults", default=False):
        return
    for item in items:
        if item.get_closest_marker("faults"):
            item.add_marker(pytest.mark.skip(reason="takes long: make faults"))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if STORIES:
        terminalreporter.section("faults that were thrown, and what came of them")
        for line in table(STORIES):
            terminalreporter.write_line(line)


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Undisturbed:
    return Undisturbed(tmp_path_factory.mktemp("undisturbed") / "town")


@pytest.fixture(scope="session")
def whole_ground(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ground]:
    with running_ground(tmp_path_factory.mktemp("ground")) as ground:
        yield ground


@pytest.fixture
def ground(whole_ground: Ground) -> Ground:
    """All workers are there, and nothing else: whatever was done is put right."""
    whole_ground.put_right()
    return whole_ground


@pytest.fixture
def command(ground: Ground, undisturbed: Undisturbed) -> Iterator[Command]:
    """`flaneur index` into a folder of its own, about to be begun."""
    root = ground.disk / f"index-{next(_numbers)}"
    command = Command(ground, ("index", str(undisturbed.survey), str(root), *OPTIONS), root)
    yield command
    command.kill()
