"""The Redis server: its address as it is used, as it may be shown, and a connection to it."""

import os
import re
from urllib.parse import parse_qs, urlsplit

from celery import Celery
from redis import Redis

PATIENCE_S = 10.0
"""How long a server may take to answer anything but a wait."""
SILENCE_S = 30.0
"""How long a connection may be silent before it is taken for cut: a wire that was pulled, or a
firewall that forgot it, says nothing."""

CELERY_VARIABLES = (
    "CELERY_BROKER_URL",
    "CELERY_BROKER_READ_URL",
    "CELERY_BROKER_WRITE_URL",
    "CELERY_RESULT_BACKEND",
)
"""Of another program: Celery would heed them above what it is told."""


def settled(url: str) -> str:
    """The address as Celery and redis-py take it.

    With TLS, certificates are checked unless the address says otherwise: Celery wants to be told.
    """
    parts = urlsplit(url)
    if parts.scheme != "rediss" or "ssl_cert_reqs" in parse_qs(parts.query):
        return url
    return f"{url}{'&' if parts.query else '?'}ssl_cert_reqs=required"


def connect(url: str, patience_s: float = PATIENCE_S) -> Redis:
    """A connection of its own, for what is not Celery's. patience_s : for each answer.

    Raises
    ------
    ValueError : it is no address of a server.
    """
    return Redis.from_url(
        settled(url).replace("redis+socket://", "unix://"),
        socket_connect_timeout=patience_s,
        socket_timeout=patience_s,
    )


def point_at(app: Celery, url: str) -> None:
    """Let an app work with a server, and come back to it however long it was away."""
    for variable in CELERY_VARIABLES:
        os.environ.pop(variable, None)
    keepalive = {} if "+socket:" in url else {"socket_keepalive": True}
    app.conf.update(
        broker_url=settled(url),
        result_backend=settled(url),
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,
        broker_transport_options={
            **app.conf.broker_transport_options,
            "socket_timeout": SILENCE_S,
            "socket_connect_timeout": PATIENCE_S,
            "health_check_interval": int(SILENCE_S),
            **keepalive,
        },
        redis_socket_timeout=SILENCE_S,
        redis_socket_connect_timeout=PATIENCE_S,
        redis_socket_keepalive=bool(keepalive),
        redis_backend_health_check_interval=int(SILENCE_S),
    )


def without_password(url: str) -> str:
    """An address that may be shown: everything before its @ is hidden, well written or not."""
    hidden = re.sub(r"(?<=://).*@", "***@", url)
    return re.sub(r"(password=)[^&]*", r"\1***", hidden)
