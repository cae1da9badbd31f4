"""Machines of a network of their own, simulated by network namespaces of this one."""

import os
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import pytest

HUB = "10.99.77.1"
"""Where the machine in the middle is; nothing outside of the namespaces sees the address."""


def _ip(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(("ip", *arguments), capture_output=True, text=True, check=True)


@dataclass(frozen=True, slots=True)
class Network:
    """A machine in the middle, and others whose cables end in its switch."""

    prefix: str

    def on(self, machine: str) -> tuple[str, ...]:
        """What brings a command to a machine; 'hub' is the one in the middle."""
        return ("ip", "netns", "exec", self.prefix + machine)

    def own_address(self, address: str) -> None:
        """Give the machine in the middle one more address, whosever it is outside."""
        _ip("-n", self.prefix + "hub", "address", "add", f"{address}/32", "dev", "lo")

    def cut_off(self, machine: str) -> None:
        """Take its cable out of the switch: neither side is told, nothing arrives."""
        _ip("-n", self.prefix + "hub", "link", "set", machine, "nomaster")

    def join(self, machine: str) -> None:
        """Put its cable back."""
        _ip("-n", self.prefix + "hub", "link", "set", machine, "master", "switch")


@contextmanager
def network(machines: Sequence[str]) -> Iterator[Network]:
    """Machines, by name, that see each other; skips where nobody may make them."""
    made = Network(f"flaneur-{os.getpid()}-")
    everyone = ("hub", *machines)
    try:
        for machine in everyone:
            _ip("netns", "add", made.prefix + machine)
    except (FileNotFoundError, subprocess.CalledProcessError) as error:
        _remove(made, everyone)
        pytest.skip(f"no network namespaces here ({error})")
    try:
        hub = ("-n", made.prefix + "hub")
        _ip(*hub, "link", "set", "lo", "up")
        _ip(*hub, "link", "add", "switch", "type", "bridge")
        _ip(*hub, "address", "add", f"{HUB}/24", "dev", "switch")
        _ip(*hub, "link", "set", "switch", "up")
        for number, machine in enumerate(machines, 2):
            there = ("-n", made.prefix + machine)
            cable = ("link", "add", machine, "type", "veth", "peer", "name", "cable")
            _ip(*hub, *cable, "netns", made.prefix + machine)
            _ip(*hub, "link", "set", machine, "master", "switch", "up")
            _ip(*there, "address", "add", f"10.99.77.{number}/24", "dev", "cable")
            _ip(*there, "link", "set", "cable", "up")
            _ip(*there, "link", "set", "lo", "up")
        yield made
    finally:
        _remove(made, everyone)


def _remove(made: Network, machines: Sequence[str]) -> None:
    """Cables and switch go with the namespaces."""
    for machine in machines:
        command = ("ip", "netns", "delete", made.prefix + machine)
        subprocess.run(command, capture_output=True, check=False)
