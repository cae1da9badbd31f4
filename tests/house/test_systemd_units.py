"""The systemd units: they hold, they start what exists, and they stop workers gently."""

import re
import shutil
import subprocess
import sys
from configparser import ConfigParser
from pathlib import Path

import pytest

from workers.app import QUEUES

UNITS = Path(__file__).parents[2] / "deploy" / "systemd"
NAMES = ("flaneur-worker@.service", "flaneur-query-worker@.service")
PROGRAM = "/usr/local/lib/flaneur/bin/flaneur"


def service(name: str) -> dict[str, str]:
    """The `[Service]` of a unit; of a key that is there several times, the last."""
    parser = ConfigParser(strict=False, interpolation=None, delimiters=("=",))
    parser.optionxform = str  # type: ignore[assignment, method-assign]
    parser.read(UNITS / name)
    return dict(parser["Service"])


def verified(unit: Path) -> str:
    """What systemd finds wrong with a unit; it warns without a failing exit code."""
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed")
    checked = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(unit)],
        capture_output=True,
        text=True,
        check=False,
    )
    about = [line for line in checked.stderr.splitlines() if unit.stem.rstrip("@") in line]
    return "\n".join(about) or ("" if checked.returncode == 0 else checked.stderr)


@pytest.fixture
def installed(tmp_path: Path) -> dict[str, Path]:
    """The units beside a program that is there."""
    copies = {}
    for name in NAMES:
        text = (UNITS / name).read_text()
        assert PROGRAM in text
        copies[name] = tmp_path / name
        copies[name].write_text(text.replace(PROGRAM, sys.executable))
    return copies


@pytest.mark.parametrize("name", NAMES)
def test_systemd_finds_nothing_wrong(name: str, installed: dict[str, Path]) -> None:
    assert verified(installed[name]) == ""


def test_systemd_would_tell_of_a_wrong_line(installed: dict[str, Path]) -> None:
    unit = installed[NAMES[0]]
    unit.write_text(unit.read_text().replace("MemoryMax=", "MemoryMaximum="))
    assert "MemoryMaximum" in verified(unit)


def test_the_units_share_all_queues_between_them() -> None:
    found: list[str] = []
    for name in NAMES:
        queues = re.search(r"--queues (\S+)", service(name)["ExecStart"])
        assert queues is not None
        found += queues[1].split(",")
    assert sorted(found) == sorted(QUEUES)


@pytest.mark.parametrize("name", NAMES)
def test_a_stopped_worker_may_finish_and_a_dead_process_stops_no_other(name: str) -> None:
    said = service(name)
    assert said["KillMode"] == "mixed", "processes of the pool must not be told to stop"
    assert said["KillSignal"] == "SIGTERM"
    assert said["OOMPolicy"] == "continue"
    assert said["Restart"] == "always"


def test_no_password_stands_in_a_unit() -> None:
    for name in NAMES:
        assert "redis://" not in (UNITS / name).read_text()
        assert service(name)["EnvironmentFile"] == "/etc/flaneur/worker.env"


def test_redis_is_never_let_forget_messages() -> None:
    settings = dict(
        line.split(" ", 1)
        for line in (UNITS / "redis.conf").read_text().splitlines()
        if line and not line.startswith("#")
    )
    assert settings["maxmemory-policy"] == "noeviction"
    assert "requirepass" in settings
