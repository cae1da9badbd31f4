"""Photos from elsewhere, from a real web server that is busy, broken or hostile."""

import socket
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from photo_server import Answer, PhotoServer, serving_photos

from coordinator.batches.fetching import AT_ONCE, TRIES, Bounds, Fetcher, Unfetched

QUICK = Bounds(pause_s=0.01, wait_s=0.05, connect_s=2.0, silence_s=2.0)


@pytest.fixture
def server() -> Iterator[PhotoServer]:
    with serving_photos() as serving:
        yield serving


@pytest.fixture
def fetcher() -> Iterator[Fetcher]:
    with Fetcher(QUICK) as each:
        yield each


def test_a_busy_server_is_asked_again_until_it_answers(
    server: PhotoServer, fetcher: Fetcher, tmp_path: Path
) -> None:
    busy = Answer(status=503, headers={"Retry-After": "3600"})
    url = server.put("/a.jpg", busy, Answer(status=429), Answer(b"photo"))
    fetcher.image([url], tmp_path / "kept")
    assert (tmp_path / "kept").read_bytes() == b"photo"
    assert server.asked["/a.jpg"] == 3


def test_a_connection_that_breaks_leaves_no_part_and_is_tried_again(
    server: PhotoServer, fetcher: Fetcher, tmp_path: Path
) -> None:
    url = server.put("/a.jpg", Answer(b"photo" * 1000, short=True), Answer(b"photo" * 1000))
    fetcher.image([url], tmp_path / "kept")
    assert (tmp_path / "kept").read_bytes() == b"photo" * 1000
    assert list(tmp_path.iterdir()) == [tmp_path / "kept"]


def test_a_server_that_stays_busy_is_given_up(
    server: PhotoServer, fetcher: Fetcher, tmp_path: Path
) -> None:
    url = server.put("/a.jpg", Answer(status=500))
    with pytest.raises(Unfetched, match=r"/a\.jpg cannot be fetched: its server says 500"):
        fetcher.image([url], tmp_path / "kept")
    assert server.asked["/a.jpg"] == TRIES


def test_what_is_not_there_is_asked_for_once_and_the_next_address_is_taken(
    server: PhotoServer, fetcher: Fetcher, tmp_path: Path
) -> None:
    gone, there = f"{server.url}/gone.jpg", server.put("/there.jpg", Answer(b"photo"))
    fetcher.image([gone, there], tmp_path / "kept")
    assert (tmp_path / "kept").read_bytes() == b"photo"
    assert server.asked["/gone.jpg"] == 1


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (Answer(b"<p>Please log in", kind="text/html"), "is text/html, expected an image"),
        (Answer(status=302, headers={"Location": "file:///etc/passwd"}), "no http address"),
        (Answer(status=302, headers={"Location": "/a.jpg"}), "redirected without end"),
        (Answer(status=403), "its server says 403"),
        (Answer(b"x" * 3000), "larger than 2,000 bytes"),
    ],
)
def test_what_cannot_be_a_photo_is_named_with_its_reason(
    server: PhotoServer, tmp_path: Path, answer: Answer, says: str
) -> None:
    url = server.put("/a.jpg", answer)
    with (
        Fetcher(Bounds(pause_s=0.01, max_image_bytes=2000)) as fetcher,
        pytest.raises(Unfetched, match=says),
    ):
        fetcher.image([url], tmp_path / "kept")
    assert list(tmp_path.iterdir()) == []


def test_a_redirect_within_the_web_is_followed(
    server: PhotoServer, fetcher: Fetcher, tmp_path: Path
) -> None:
    url = server.put("/old.jpg", Answer(status=301, headers={"Location": "/new.jpg"}))
    server.put("/new.jpg", Answer(b"photo"))
    fetcher.image([url], tmp_path / "kept")
    assert (tmp_path / "kept").read_bytes() == b"photo"


def test_a_server_that_is_not_there_is_named(fetcher: Fetcher, tmp_path: Path) -> None:
    with pytest.raises(Unfetched, match=r"http://127\.0\.0\.1:9/a\.jpg cannot be fetched"):
        fetcher.image(["http://127.0.0.1:9/a.jpg"], tmp_path / "kept")


def test_a_stop_ends_the_wait_for_a_busy_server(server: PhotoServer, tmp_path: Path) -> None:
    url = server.put("/a.jpg", Answer(status=503))
    with Fetcher(Bounds(pause_s=600.0, wait_s=600.0)) as fetcher:
        threading.Timer(0.3, fetcher.stop).start()
        with pytest.raises(Unfetched, match="its server says 503"):
            fetcher.image([url], tmp_path / "kept")
    assert server.asked["/a.jpg"] == 1


def test_a_stop_ends_what_a_silent_server_keeps_waiting(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"http://127.0.0.1:{silent.getsockname()[1]}/a.jpg"
        with Fetcher(Bounds(silence_s=600.0)) as fetcher, ThreadPoolExecutor() as pool:
            asked = [pool.submit(fetcher.image, [url], tmp_path / str(at)) for at in range(4)]
            taken = [silent.accept()[0] for _ in range(AT_ONCE)]
            for each in taken:
                each.recv(1)
            fetcher.stop()
            for future in asked:
                with pytest.raises(Unfetched):
                    future.result(timeout=60.0)
        for each in taken:
            each.close()
