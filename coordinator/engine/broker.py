"""The broker a person named: whether it answers, if not why not, and who works there."""

import os
import re
import socket
import ssl
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from urllib.parse import urlsplit

from redis import AuthenticationError, Redis, RedisError, ResponseError

from contracts.errors import BrokerUnreachable
from workers.messages import our_version
from workers.presence import Presence, listening, processes_on
from workers.server import connect, without_password

BROKER_VARIABLE = "FLANEUR_BROKER_URL"
ANSWER_S = 3.0
PROBE_S = 1.0
PROBE_KEY = "flaneur:probe"
START_S = 6.0
"""How long a worker that was just started may need to be heard of."""


def broker_url(given: str | None) -> str | None:
    """The broker that is meant: given as an option, or by the environment."""
    return given or os.environ.get(BROKER_VARIABLE) or None


def check_broker(url: str) -> Redis:
    """Refuse a broker that cannot be used, in seconds and by name (without its password).

    Raises
    ------
    BrokerUnreachable : says what is wrong: the address, the password, the certificate, TLS or not,
        a replica, a full one.
    """
    try:
        _refuse_odd_database(url)
        server = connect(url, ANSWER_S)
        server.set(PROBE_KEY, "", px=1000)  # a replica and a full server answer, but take nothing
    except (RedisError, ValueError, TypeError, OSError) as error:
        raise BrokerUnreachable(
            f"No Redis server can be used at {without_password(url)}: {_reason(url, error)} "
            f"(--broker or {BROKER_VARIABLE}; without both, Flaneur starts a server of its own.)"
        ) from error
    return server


def _refuse_odd_database(url: str) -> None:
    """redis-py takes database 0 where an address ends in anything but a number."""
    address = urlsplit(url)
    if address.scheme in ("redis", "rediss") and not re.fullmatch(r"/?[0-9]*", address.path):
        raise ValueError


def _reason(url: str, error: Exception) -> str:
    """What is wrong and how to mend it. Errors of a bad address are not quoted: they quote it."""
    cause = _first_cause(error)
    if isinstance(error, ValueError | TypeError):
        return (
            "this is no address. Write redis://HOST:PORT/0, rediss:// for TLS or "
            "redis+socket:///PATH; of a password, all but letters and digits as %XX."
        )
    if isinstance(error, AuthenticationError):
        if without_password(url) == url:
            return "it asks for a password. Write redis://:PASSWORD@HOST:PORT/0."
        return "the password is wrong."
    if isinstance(error, ResponseError):
        told = str(error).rstrip(".")
        return f"it refuses ({told}). It has to be a primary with room, where we may write."
    if isinstance(cause, socket.gaierror):
        return f"the name {urlsplit(url).hostname} is unknown ({cause.strerror}). Correct it."
    if isinstance(cause, ssl.SSLCertVerificationError):
        return (
            f"its certificate is not trusted ({cause.verify_message}). Name the authority that "
            "signed it by ?ssl_ca_certs=FILE, and the server as the certificate does."
        )
    if isinstance(cause, FileNotFoundError):
        return "a file of certificates that the address names is not there. Correct ?ssl_...=FILE."
    if urlsplit(url).scheme == "rediss" and _answers(url, _plainly):
        return "it does not speak TLS. Write redis://, or let it speak TLS."
    if urlsplit(url).scheme == "redis" and _answers(url, _in_tls):
        return (
            "it speaks TLS. Write rediss://, and ?ssl_ca_certs=FILE if its authority is your own."
        )
    if isinstance(cause, ssl.SSLError):
        return f"no TLS can be agreed on ({cause.reason}). Look at its certificates and yours."
    return f"{str(error).rstrip('.')}. Start it, or correct its address."


def _first_cause(error: BaseException) -> BaseException:
    while (before := error.__cause__ or error.__context__) is not None:
        error = before
    return error


def _answers(url: str, asked: Callable[[socket.socket], bool]) -> bool:
    """Only for saying why a server cannot be used: nothing that is secret is sent."""
    address = urlsplit(url)
    with suppress(OSError):
        where = (address.hostname or "localhost", address.port or 6379)
        with socket.create_connection(where, PROBE_S) as connection:
            return asked(connection)
    return False


def _in_tls(connection: socket.socket) -> bool:
    context = ssl.create_default_context()
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    with context.wrap_socket(connection):
        return True


def _plainly(connection: socket.socket) -> bool:
    connection.sendall(b"PING\r\n")
    return connection.recv(1) in (b"+", b"-")


def check_workers(
    server: Redis, url: str, queues: Sequence[str], patience_s: float = START_S
) -> int:
    """How many tasks at a time are worked on, by workers of our version, on these queues.

    patience_s : how long they are waited for, if they are missing.

    Raises
    ------
    BrokerUnreachable : nobody listens there, or on one of the queues, or only other versions.
    """
    gives_up_at = time.monotonic() + patience_s
    shown = without_password(url)
    while lack := _lack(listening(server), queues, shown):
        if time.monotonic() > gives_up_at:
            raise BrokerUnreachable(
                f"{lack} Start one or more with: flaneur worker --broker {shown}"
            )
        time.sleep(0.2)
    return processes_on(listening(server), queues, our_version())


def _lack(present: Sequence[Presence], queues: Sequence[str], shown: str) -> str:
    """Why this work cannot be done; empty if it can."""
    ours = [each for each in present if each.version == our_version()]
    if not present:
        return f"No worker listens at {shown}."
    if not ours:
        theirs = ", ".join(sorted({each.version for each in present}))
        return (
            f"The workers at {shown} run Flaneur {theirs}, this is {our_version()}: install the "
            "same version on all machines."
        )
    heard = {queue for each in ours for queue in each.queues}
    if missing := [queue for queue in queues if queue not in heard]:
        return f"No worker of Flaneur {our_version()} at {shown} takes {', '.join(missing)}."
    return ""
