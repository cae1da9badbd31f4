"""docker-compose.yml, checked by its schema and its promises; no Docker engine runs it here."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

REPOSITORY = Path(__file__).parents[2]
COMPOSE = REPOSITORY / "docker-compose.yml"


@pytest.fixture(scope="module")
def services() -> dict[str, Any]:
    content = yaml.safe_load(COMPOSE.read_text())
    return dict(content["services"])


def test_compose_file_fits_the_compose_specification() -> None:
    checked = subprocess.run(
        [
            *(sys.executable, "-m", "check_jsonschema"),
            *("--builtin-schema", "vendor.compose-spec", str(COMPOSE)),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_no_service_opens_a_port(services: dict[str, Any]) -> None:
    assert not [name for name, service in services.items() if "ports" in service]


def test_every_service_is_healthchecked_and_not_root(services: dict[str, Any]) -> None:
    for name, service in services.items():
        assert "healthcheck" in service, name
        assert str(service["user"]).split(":")[0] not in ("0", "root"), name


def test_the_survey_is_mounted_read_only(services: dict[str, Any]) -> None:
    for name in ("worker", "query-worker", "coordinator"):
        mounts = [each for each in services[name]["volumes"] if ":/survey" in each]
        assert mounts, name
        assert all(each.endswith(":ro") for each in mounts), name


def test_workers_can_be_scaled(services: dict[str, Any]) -> None:
    assert "container_name" not in services["worker"]
