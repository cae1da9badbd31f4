"""docker-compose.yml, checked by its schema and its promises; no Docker engine runs it here."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from machines import DEBIANS_REDIS, VALKEY, free_port, redis_server

from contracts.errors import BrokerUnreachable
from coordinator.engine.broker import check_broker
from workers.app import QUEUES
from workers.roots import PREFIX

REPOSITORY = Path(__file__).parents[2]
COMPOSE = REPOSITORY / "docker-compose.yml"
WORKERS = ("worker", "query-worker")
OURS = (*WORKERS, "coordinator")


@pytest.fixture(scope="module")
def compose() -> dict[str, Any]:
    return dict(yaml.safe_load(COMPOSE.read_text()))


@pytest.fixture(scope="module")
def services(compose: dict[str, Any]) -> dict[str, Any]:
    return dict(compose["services"])


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


def test_docker_compose_reads_it() -> None:
    compose = ("docker", "compose")
    if (
        shutil.which("docker") is None
        or subprocess.run((*compose, "version"), check=False).returncode
    ):
        pytest.skip("no docker compose here")
    read = subprocess.run(
        (*compose, "--file", str(COMPOSE), "--profile", "*", "config", "--quiet"),
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "FLANEUR_REDIS_PASSWORD": "a-secret"},
    )
    assert read.returncode == 0, read.stderr


def test_only_what_watches_opens_a_port_and_only_on_this_machine(services: dict[str, Any]) -> None:
    opened = {name: service["ports"] for name, service in services.items() if "ports" in service}
    for name, ports in opened.items():
        assert services[name]["profiles"] == ["watch"], name
        assert all(port.startswith("127.0.0.1:") for port in ports), name


def test_redis_is_reached_by_the_services_alone_and_asks_them_for_a_password(
    compose: dict[str, Any], services: dict[str, Any]
) -> None:
    assert services["redis"]["networks"] == ["inside"]
    assert compose["networks"]["inside"] == {"internal": True}
    for name in OURS:
        url = services[name]["environment"]["FLANEUR_BROKER_URL"]
        assert re.fullmatch(r"redis://:\$\{FLANEUR_REDIS_PASSWORD:\?.+\}@redis:6379/0", url), name
    assert "REDISCLI_AUTH" in services["redis"]["environment"]


def test_redis_starts_by_its_configuration_and_wants_the_password(
    compose: dict[str, Any], tmp_path: Path
) -> None:
    content = re.sub(r"\$\{\w+:\?[^}]*\}", "a-secret", compose["configs"]["redis"]["content"])
    configuration = tmp_path / "redis.conf"
    configuration.write_text(content.replace("dir /data", f"dir {tmp_path}"))
    port = free_port()
    address = f"redis://:a-secret@127.0.0.1:{port}"
    options = (str(configuration), "--port", str(port))
    with redis_server(tmp_path, address, *options, program=DEBIANS_REDIS or VALKEY) as url:
        assert "asks for a password" in str(refused(f"redis://127.0.0.1:{port}"))
        told = check_broker(url).config_get("maxmemory-policy")
    assert told == {"maxmemory-policy": "noeviction"}


def refused(url: str) -> BrokerUnreachable:
    with pytest.raises(BrokerUnreachable) as told:
        check_broker(url)
    return told.value


def test_every_service_is_healthchecked_and_not_root(services: dict[str, Any]) -> None:
    for name, service in services.items():
        assert "healthcheck" in service, name
        assert str(service["user"]).split(":")[0] not in ("0", "root"), name


def test_every_service_is_confined(services: dict[str, Any]) -> None:
    for name, service in services.items():
        assert service["read_only"], name
        assert service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name


def test_surveys_and_photos_are_mounted_read_only(services: dict[str, Any]) -> None:
    for name in OURS:
        mounts = [
            each for each in services[name]["volumes"] if re.search(":/(survey|photos)", each)
        ]
        assert len(mounts) == 2, name
        assert all(each.endswith(":ro") for each in mounts), name


def test_workers_open_what_is_mounted_and_nothing_else(services: dict[str, Any]) -> None:
    for name in WORKERS:
        volumes = services[name]["volumes"]
        mounted = {volume.removesuffix(":ro").rpartition(":")[2] for volume in volumes}
        environment = services[name]["environment"].items()
        assert {place for variable, place in environment if variable.startswith(PREFIX)} == mounted


def test_every_queue_is_taken_by_a_worker(services: dict[str, Any]) -> None:
    taken = [services[name]["command"][2] for name in WORKERS]
    assert set(",".join(taken).split(",")) == set(QUEUES)


def test_workers_can_be_scaled_and_are_left_the_time_to_finish(services: dict[str, Any]) -> None:
    for name in WORKERS:
        assert "container_name" not in services[name]
        assert services[name]["stop_signal"] == "SIGTERM"
        assert services[name]["stop_grace_period"].endswith("m")


def test_prometheus_asks_the_workers_where_they_answer(
    compose: dict[str, Any], services: dict[str, Any]
) -> None:
    configuration = yaml.safe_load(compose["configs"]["prometheus"]["content"])
    (asked,) = configuration["scrape_configs"][0]["dns_sd_configs"]
    assert asked["names"] == list(WORKERS)
    for name in WORKERS:
        command = services[name]["command"]
        assert command[command.index("--metrics-port") + 1] == str(asked["port"])


def test_the_image_has_every_room_of_the_program() -> None:
    dockerfile = (REPOSITORY / "Dockerfile").read_text()
    copied = set(re.findall(r"^COPY (\w+) \1$", dockerfile, re.MULTILINE))
    pyproject = (REPOSITORY / "pyproject.toml").read_text()
    packages = re.search(r"^packages = \[(.*)\]$", pyproject, re.MULTILINE)
    assert packages is not None
    assert copied == set(re.findall(r'"(\w+)"', packages[1]))
