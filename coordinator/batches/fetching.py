"""Fetching from the web: bounded, patient with servers, a few at a time, each thing once."""

import os
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from email.utils import parsedate_to_datetime
from importlib.metadata import version
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any, Self
from weakref import WeakSet

import httpx

from contracts.errors import UnusableImage

AT_ONCE = 2
TRIES = 5
_BUSY = frozenset({408, 425, 429, 500, 502, 503, 504})
_CONNECTED = frozenset({"connection.connect_tcp.complete", "connection.start_tls.complete"})
"""What httpcore tells when it has a socket."""
_NOT_IMAGES = ("text/", "application/json", "application/ld+json", "application/xml")


@dataclass(frozen=True, slots=True)
class Bounds:
    """What is waited for and taken. pause_s : before the second try; twice as long each time.

    wait_s : longest pause that a server may ask for. total_s : for one thing, all in all.
    """

    pause_s: float = 1.0
    wait_s: float = 120.0
    connect_s: float = 10.0
    silence_s: float = 60.0
    total_s: float = 600.0
    max_image_bytes: int = 1 << 28
    max_document_bytes: int = 1 << 26


class Unfetched(UnusableImage):
    """Something could not be fetched."""


def is_web_address(text: str) -> bool:
    """Whether a text is an address of the web, http or https."""
    return text.lower().startswith(("http://", "https://"))


@dataclass(slots=True)
class Fetcher:
    """Fetches, for several threads; `stop` ends all that goes on."""

    bounds: Bounds = field(default_factory=Bounds)
    _client: httpx.Client = field(init=False)
    _turns: threading.Semaphore = field(init=False)
    _stopped: threading.Event = field(init=False)
    _sockets: "WeakSet[socket.socket]" = field(init=False)

    def __post_init__(self) -> None:
        self._turns = threading.Semaphore(AT_ONCE)
        self._stopped = threading.Event()
        self._sockets = WeakSet()
        self._client = httpx.Client(
            follow_redirects=True,
            max_redirects=5,
            timeout=httpx.Timeout(self.bounds.silence_s, connect=self.bounds.connect_s),
            headers={"User-Agent": f"flaneur/{version('flaneur')}"},
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._client.close()

    def stop(self) -> None:
        """Begin nothing more, and end what is begun, even where a server is silent."""
        self._stopped.set()
        for each in list(self._sockets):
            with suppress(OSError):  # closed meanwhile
                each.shutdown(socket.SHUT_RDWR)

    def document(self, url: str) -> bytes:
        """What is at an address, such as a manifest.

        Raises
        ------
        Unfetched : it cannot be had; says why.
        """
        content = bytearray()
        accept = {"Accept": "application/ld+json, application/json;q=0.9, */*;q=0.5"}

        def keep(response: httpx.Response) -> None:
            content.clear()
            for piece in self._pieces(response, self.bounds.max_document_bytes):
                content.extend(piece)

        self._patiently(url, accept, keep)
        return bytes(content)

    def image(self, urls: Iterable[str], kept: Path) -> None:
        """Fetch an image, the first of `urls` that can be had, into the file `kept`.

        Raises
        ------
        Unfetched : none can be had; says why the first and the last could not.
        """
        errors = []
        for url in urls:
            try:
                self._image(url, kept)
            except Unfetched as error:
                errors.append(str(error))
            else:
                return
        raise Unfetched("; ".join(dict.fromkeys(errors[:1] + errors[-1:])) or "it has no address")

    def _image(self, url: str, kept: Path) -> None:
        def keep(response: httpx.Response) -> None:
            kind = response.headers.get("Content-Type", "").split(";")[0].strip().lower()
            if kind.startswith(_NOT_IMAGES):
                raise Unfetched(f"{url} is {kind}, expected an image")
            with NamedTemporaryFile(dir=kept.parent, prefix=".", delete=False) as file:
                try:
                    for piece in self._pieces(response, self.bounds.max_image_bytes):
                        file.write(piece)
                    file.flush()
                    os.fsync(file.fileno())
                    Path(file.name).chmod(0o644)
                    Path(file.name).replace(kept)
                except BaseException:
                    Path(file.name).unlink(missing_ok=True)
                    raise

        self._patiently(url, {"Accept": "image/*"}, keep)

    def _pieces(self, response: httpx.Response, max_bytes: int) -> Iterator[bytes]:
        gives_up_at, size = time.monotonic() + self.bounds.total_s, 0
        for piece in response.iter_bytes(1 << 16):
            size += len(piece)
            if size > max_bytes:
                raise Unfetched(f"{response.url} is larger than {max_bytes:,} bytes")
            if time.monotonic() > gives_up_at:
                raise Unfetched(f"{response.url} took longer than {self.bounds.total_s:.0f} s")
            if self._stopped.is_set():
                raise Unfetched(f"{response.url} was not fetched: the work was stopped")
            yield piece

    @contextmanager
    def _asked(self, url: str, headers: dict[str, str]) -> Iterator[httpx.Response]:
        if self._stopped.is_set():  # while it waited for its turn
            raise Unfetched(f"{url} was not fetched: the work was stopped")

        def trace(event: str, told: dict[str, Any]) -> None:
            if event in _CONNECTED:
                self._sockets.add(told["return_value"].get_extra_info("socket"))

        asking = self._client.stream("GET", url, headers=headers, extensions={"trace": trace})
        with asking as response:
            yield response

    def _patiently(
        self, url: str, headers: dict[str, str], keep: Callable[[httpx.Response], None]
    ) -> None:
        """Ask for `url`, again where the server is busy or the network failed."""
        pause_s, reason = self.bounds.pause_s, ""
        for attempt in range(TRIES):
            if attempt and self._stopped.wait(pause_s):
                break
            pause_s = self.bounds.pause_s * 2 ** (attempt + 1)
            try:
                with self._turns, self._asked(url, headers) as response:
                    if response.is_success:
                        keep(response)
                        return
                    reason = f"its server says {response.status_code} {response.reason_phrase}"
                    if response.status_code not in _BUSY:
                        break
                    pause_s = max(pause_s, _asked_pause_s(response, self.bounds.wait_s))
            except httpx.TooManyRedirects:
                reason = "it is redirected without end"
                break
            except httpx.UnsupportedProtocol:
                reason = "it is, or leads to, what is no http address"
                break
            except (httpx.InvalidURL, ValueError) as error:
                reason = f"it is no address ({error})"
                break
            except httpx.HTTPError as error:
                reason = str(error) or type(error).__name__
        raise Unfetched(f"{url} cannot be fetched: {reason}")


def _asked_pause_s(response: httpx.Response, most_s: float) -> float:
    """Seconds that a server asks to be left alone, in seconds or until a date of its clock."""
    asked = response.headers.get("Retry-After", "")
    if asked.isascii() and asked.isdigit():
        return min(float(asked[:9]), most_s)
    with suppress(ValueError, TypeError):  # TypeError: a date without a zone beside one with
        until = parsedate_to_datetime(asked)
        now = parsedate_to_datetime(response.headers.get("Date", ""))
        return min(max((until - now).total_seconds(), 0.0), most_s)
    return 0.0
