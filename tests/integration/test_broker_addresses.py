"""What stands between a person and a broker: each obstacle is told by its name, no password is."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from machines import DEBIANS_REDIS, free_port, make_certificate, redis_server

from contracts.errors import BrokerUnreachable
from coordinator.engine.broker import check_broker, check_workers
from coordinator.engine.exposure import exposure
from workers.messages import our_version
from workers.presence import listening
from workers.server import connect, settled, without_password

PASSWORD = "Hx9%2Fq~secret"  # noqa: S105 - of a server that lives for seconds


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """The port of a server that asks for a password."""
    port = free_port()
    url = f"redis://:{PASSWORD}@127.0.0.1:{port}/0"
    options = ("--port", str(port), "--requirepass", "Hx9/q~secret")
    with redis_server(tmp_path_factory.mktemp("guarded"), url, *options):
        yield port


@pytest.fixture(scope="module")
def encrypted(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The address of a server that speaks TLS only, and asks for a password."""
    if DEBIANS_REDIS is None:
        pytest.skip("no redis-server with TLS here; Debian's package has it")
    port, folder = free_port(), tmp_path_factory.mktemp("encrypted")
    options = ("--port", "0", "--tls-port", str(port), "--requirepass", "Hx9/q~secret")
    certified = make_certificate(folder)
    url = f"rediss://:{PASSWORD}@localhost:{port}/0?ssl_ca_certs={folder}/cert.pem"
    with redis_server(folder, url, *options, *certified, program=DEBIANS_REDIS):
        yield url


def complaint(url: str) -> str:
    with pytest.raises(BrokerUnreachable) as told:
        check_broker(url)
    return str(told.value)


def test_a_password_is_asked_for_told_wrong_and_accepted(guarded: int) -> None:
    address = f"127.0.0.1:{guarded}/0"
    assert "asks for a password" in complaint(f"redis://{address}")
    assert "the password is wrong" in complaint(f"redis://:no@{address}")
    assert check_broker(f"redis://:{PASSWORD}@{address}").ping()


def test_a_server_without_tls_says_so_to_who_speaks_it(guarded: int) -> None:
    assert "does not speak TLS" in complaint(f"rediss://localhost:{guarded}/0")


def test_a_server_with_tls_says_so_to_who_does_not_speak_it(encrypted: str) -> None:
    plain = encrypted.replace("rediss", "redis").partition("?")[0]
    assert "it speaks TLS" in complaint(plain)


def test_certificates_are_checked_unless_the_address_says_otherwise(encrypted: str) -> None:
    assert check_broker(encrypted).ping()
    unchecked = encrypted.partition("?")[0]
    assert "certificate is not trusted" in complaint(unchecked)
    assert "certificate is not trusted" in complaint(encrypted.replace("localhost", "127.0.0.1"))
    assert connect(f"{unchecked}?ssl_cert_reqs=none&ssl_check_hostname=false").ping()
    assert "is not there" in complaint(f"{unchecked}?ssl_ca_certs=/no/such/file.pem")


@pytest.mark.parametrize(
    ("url", "reason"),
    [
        ("redis://no-such-host.invalid/0", "the name no-such-host.invalid is unknown"),
        ("localhost:6379", "this is no address"),
        ("http://localhost:6379", "this is no address"),
        ("redis://:my/secret@localhost:6379", "this is no address"),
        ("redis://:secret@localhost:port", "this is no address"),
        ("redis://:secret@localhost:6379/abc", "this is no address"),
        ("redis://127.0.0.1:1/0", "Connection refused"),
    ],
)
def test_an_address_that_leads_nowhere_says_why_and_shows_no_password(
    url: str, reason: str
) -> None:
    told = complaint(url)
    assert reason in told
    assert "secret" not in told


@pytest.mark.parametrize(
    "url",
    [
        "redis://:secret@host/0",
        "rediss://user:secret@host:6379/0?ssl_cert_reqs=none",
        "redis://:se/secret@x@host/0",
        "redis://host/0?password=secret",
        "redis+socket:///run/redis.sock?password=secret&virtual_host=1",
    ],
)
def test_no_password_is_shown_wherever_an_address_has_it(url: str) -> None:
    assert "secret" not in without_password(url)


def test_who_is_there_decides_whether_work_is_begun(tmp_path: Path) -> None:
    port = free_port()
    url = f"redis://127.0.0.1:{port}"
    with redis_server(tmp_path, url, "--port", str(port)), connect(url) as server:

        def tell(name: str, version: str, *queues: str) -> None:
            told = {"name": name, "host": "h", "pid": 1, "processes": 4, "version": version}
            server.set(f"flaneur:worker:{name}", json.dumps({**told, "queues": queues, "new": 1}))
            server.sadd("flaneur:workers", name)

        def lack() -> str:
            with pytest.raises(BrokerUnreachable) as told:
                check_workers(server, url, ("extract", "train"), patience_s=0)
            return str(told.value)

        assert "No worker listens" in lack()
        tell("old", "0.0.9", "extract", "train")
        tell("older", "0.0.8", "extract", "train")
        assert "run Flaneur 0.0.8, 0.0.9, this is" in lack()
        tell("one", our_version(), "extract")
        assert "takes train" in lack()
        tell("two", our_version(), "train", "merge")
        assert check_workers(server, url, ("extract", "train"), patience_s=0) == 8

        server.set("flaneur:worker:old", "unreadable")
        server.delete("flaneur:worker:two")
        assert [told.name for told in listening(server)] == ["older", "one"]
        assert server.scard("flaneur:workers") == 3


def test_tls_without_a_word_about_certificates_checks_them() -> None:
    assert settled("rediss://host/0") == "rediss://host/0?ssl_cert_reqs=required"
    assert settled("rediss://host/0?ssl_cert_reqs=none") == "rediss://host/0?ssl_cert_reqs=none"


def test_a_server_that_lets_all_networks_in_without_a_password_is_warned_of(
    tmp_path: Path, guarded: int
) -> None:
    port = free_port()
    url = f"redis://localhost:{port}"
    options = ("--port", str(port), "--bind", "0.0.0.0", "--protected-mode")  # noqa: S104
    with redis_server(tmp_path, url, *options, "no"):
        server = connect(url)
        assert "without a password" in str(exposure(url, server))
        server.config_set("protected-mode", "yes")
        assert exposure(url, server) is None
        server.config_set("protected-mode", "no")
        server.config_set("requirepass", "some")
        assert exposure(url, server) is None
    inside = f"redis://:{PASSWORD}@127.0.0.1:{guarded}/0"
    assert exposure(inside, connect(inside)) is None
