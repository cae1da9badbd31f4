"""The operator's page quotes messages, commands and variables that are really there."""

import ast
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.core import TyperGroup
from typer.main import get_command

from coordinator.cli import main

REPOSITORY = Path(__file__).parents[2]
PAGE = REPOSITORY / "docs" / "operating.md"
PACKAGES = ("contracts", "geo", "retrieval", "index", "survey", "workers", "coordinator")
GAP = "…"
"""Stands in the page for what differs from case to case."""


@pytest.fixture(scope="module")
def page() -> str:
    return PAGE.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def said() -> list[str]:
    """Every text in the code, with a gap where something is filled in."""
    texts = []
    for package in PACKAGES:
        for path in (REPOSITORY / package).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.JoinedStr):
                    parts = [n.value if isinstance(n, ast.Constant) else GAP for n in node.values]
                    texts.append("".join(map(str, parts)))
                elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                    texts.append(node.value)
    return texts


def quoted_messages(page: str) -> Iterator[str]:
    """The first column of the table of failures."""
    _, _, section = page.partition("\n## What failures look like")
    for row in re.findall(r"^\| (.+?) \| ", section.partition("\n## ")[0], flags=re.MULTILINE):
        yield from re.findall(r"`([^`]+)`", row)


def is_said(message: str, texts: list[str]) -> bool:
    """Whether one text has the fixed words of `message`, in their order."""
    fixed = [part.strip() for part in message.split(GAP) if part.strip()]
    pattern = re.compile(".*".join(map(re.escape, fixed)), flags=re.DOTALL)
    return any(pattern.search(text) for text in texts)


def test_every_quoted_message_is_in_the_code(page: str, said: list[str]) -> None:
    messages = list(quoted_messages(page))
    assert len(messages) > 15
    assert not [message for message in messages if not is_said(message, said)]


def test_a_message_of_nobody_would_be_noticed(said: list[str]) -> None:
    assert not is_said("No Redis server replies at …", said)


def commands(page: str) -> Iterator[list[str]]:
    """The flaneur commands in blocks of code, without comments."""
    for block in re.findall(r"^```\n(.+?)^```", page, flags=re.MULTILINE | re.DOTALL):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            for at, word in enumerate(words):
                if (at == 0 and word == "flaneur") or word.endswith("/bin/flaneur"):
                    yield words[at + 1 :]


def test_every_command_and_option_exists(page: str) -> None:
    found = list(commands(page))
    assert len(found) > 10
    for words in found:
        command = get_command(main)
        while isinstance(command, TyperGroup):
            name = words.pop(0)
            assert name in command.commands, f"flaneur … {name}"
            command = command.commands[name]
        known_options = {option for each in command.params for option in each.opts}
        used = {word.partition("=")[0] for word in words if word.startswith("--")}
        assert used <= known_options, (command.name, used - known_options)


def test_every_variable_is_read_somewhere(page: str, said: list[str]) -> None:
    named = set(re.findall(r"\bFLANEUR_[A-Z_]*[A-Z]", page))
    composed = re.findall(r"\bFLANEUR_[A-Z_]+", (REPOSITORY / "docker-compose.yml").read_text())
    roots = {name for name in named if name.startswith("FLANEUR_ROOT")}
    assert roots
    assert named - roots <= {*said, *composed}


def test_what_the_page_links_to_is_there(page: str) -> None:
    links = [link.partition("#")[0] for link in re.findall(r"\]\(([^)]+)\)", page)]
    relative = [link for link in links if link and "://" not in link]
    assert relative
    assert not [link for link in relative if not (PAGE.parent / link).exists()]
