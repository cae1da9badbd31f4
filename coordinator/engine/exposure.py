"""Whether strangers can give work to our workers: a server that asks nobody for a password."""

import socket
from contextlib import suppress
from ipaddress import IPv4Address, IPv6Address, ip_address
from typing import Any
from urllib.parse import parse_qs, urlsplit, urlunsplit

from redis import Redis, RedisError

from workers.server import connect, without_password

Address = IPv4Address | IPv6Address


def exposure(url: str, server: Redis) -> str | None:
    """Say so if anyone on the Internet, or on all networks of its machine, can use the server.

    A server on a socket, on this machine alone or in a private network is not told of: there it is
    for the operator to say who may reach it (docs/operating.md).
    """
    parts = urlsplit(url)
    if "socket" in parts.scheme or "ssl_certfile" in parse_qs(parts.query):
        return None
    addresses = _addresses(parts.hostname or "localhost")
    public = [str(each) for each in addresses if each.is_global]
    if addresses and all(each.is_loopback for each in addresses) and _listens_everywhere(server):
        public = ["all addresses of this machine"]
    if not public or not _asks_nobody(url):
        return None
    return (
        f"The Redis server {without_password(url)} listens on {', '.join(public)} without a "
        "password: whoever reaches it can give work to the workers and read the results. Set "
        "requirepass there, or bind it to a private address."
    )


def _addresses(host: str) -> list[Address]:
    with suppress(OSError):
        found = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
        return [ip_address(str(entry[4][0]).split("%")[0]) for entry in found]
    return []


def _listens_everywhere(server: Redis) -> bool:
    """Our way to it is this machine's own; others may have another one."""
    with suppress(RedisError):  # it does not tell everyone
        settings: dict[Any, Any] = server.config_get("bind", "protected-mode")
        bound = str(settings.get("bind", "")).replace("-", "").split()
        everywhere = not bound or not {"*", "0.0.0.0", "::"}.isdisjoint(bound)  # noqa: S104
        return everywhere and settings.get("protected-mode") == "no"
    return False


def _asks_nobody(url: str) -> bool:
    """A stranger, who knows no password, is let in."""
    parts = urlsplit(url)
    stranger = urlunsplit(parts._replace(netloc=parts.netloc.rpartition("@")[2]))
    with suppress(RedisError, OSError):
        connect(stranger).ping()
        return True
    return False
