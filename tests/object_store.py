"""An object store that speaks S3, for as long as a test runs: moto's server on a real port.

What it holds is kept in this process, so that a server that was stopped can come back.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.parse import urlsplit

import boto3
from moto.moto_server.threaded_moto_server import MotoRequestHandler
from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import make_server


@dataclass(frozen=True)
class Bucket:
    """A bucket of the store, seen through another library than the one under test."""

    name: str
    client: Any

    def url(self, key: str) -> str:
        return f"s3://{self.name}/{key}"

    def upload(self, folder: Path, prefix: str) -> str:
        """Every file below a folder; returns the URL."""
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                self.put(f"{prefix}/{file.relative_to(folder).as_posix()}", file.read_bytes())
        return self.url(prefix)

    def put(self, key: str, content: bytes) -> None:
        self.client.put_object(Bucket=self.name, Key=key, Body=content)

    def get(self, key: str) -> bytes:
        return bytes(self.client.get_object(Bucket=self.name, Key=key)["Body"].read())

    def remove(self, key: str) -> None:
        self.client.delete_object(Bucket=self.name, Key=key)

    def sizes(self, prefix: str = "") -> dict[str, int]:
        """Sizes by key."""
        pages = self.client.get_paginator("list_objects_v2").paginate(
            Bucket=self.name, Prefix=prefix
        )
        return {each["Key"]: each["Size"] for page in pages for each in page.get("Contents", ())}


class Server:
    """The store's server. requests : what it was asked so far, as `METHOD path?query`."""

    def __init__(self, url: str) -> None:
        self.requests: list[str] = []
        self._port = int(urlsplit(url).port or 0)
        self._running: Any = None

    def start(self) -> None:
        application = DomainDispatcherApplication(create_backend_app)

        def counted(environ: Any, respond: Any) -> Any:
            where = f"{environ['PATH_INFO']}?{environ.get('QUERY_STRING', '')}"
            self.requests.append(f"{environ['REQUEST_METHOD']} {where}")
            return application(environ, respond)

        self._running = make_server(
            "127.0.0.1", self._port, counted, threaded=True, request_handler=MotoRequestHandler
        )
        Thread(target=self._running.serve_forever, daemon=True).start()

    def stop(self) -> None:
        self._running.shutdown()
        self._running.server_close()

    def asked(self, verb: str) -> list[str]:
        """What it was asked by one verb of HTTP."""
        return [each for each in self.requests if each.startswith(f"{verb} ")]


@contextmanager
def serving(url: str) -> Iterator[Server]:
    """The store at a URL."""
    server = Server(url)
    server.start()
    try:
        yield server
    finally:
        server.stop()


def new_bucket(name: str) -> Bucket:
    """An empty bucket; variables say where."""
    client = boto3.client("s3")
    client.create_bucket(Bucket=name)
    return Bucket(name, client)
