"""Published indices: what is sent, what a reader sees whenever it looks, what it keeps."""

import shutil
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from made_index import made_index, named_anew
from object_store import Bucket, Server

from contracts.errors import BadIndex, TaskFailed
from contracts.places import place_of
from coordinator.cli.show import Bars
from index.fetched import Held, at_hand, cache_folder
from index.manifest import Generation, read_generation
from index.models import model_path
from index.opened import OpenedIndex
from index.store import CURRENT, Published, publish
from index.verifying import verify

BARS = Bars(None)


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("original")
    made_index(root, (5,))
    return root


@pytest.fixture
def root(original: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(original, tmp_path / "index"))


def sent(root: Path, url: str) -> Published:
    return publish(root, place_of(url), BARS)


def bytes_of(root: Path, generation: Generation) -> dict[str, bytes]:
    return {name: (root / name).read_bytes() for name in generation.files}


def later(root: Path) -> Generation:
    """A generation after the live one, with one file that is another."""
    live = read_generation(root)
    path = root / "catalogue" / "0001.parquet"
    path.write_bytes(path.read_bytes() + b" ")
    return named_anew(root, live)


def test_what_is_fetched_is_what_was_published(root: Path, bucket: Bucket) -> None:
    url = bucket.url("some/town")
    done = sent(root, url)
    there = OpenedIndex(place_of(url))
    assert there.generation == read_generation(root)
    assert there.place == url
    assert bytes_of(there.root, there.generation) == bytes_of(root, there.generation)
    assert not verify(there.root, every=False, progress=BARS).faults
    assert done.n_sent == done.n_files == len(bucket.sizes("some/town/files/"))


def test_only_what_is_missing_is_sent(root: Path, bucket: Bucket, store: Server) -> None:
    sent(root, bucket.url("town"))
    assert sent(root, bucket.url("town")).n_sent == 0
    later(root)
    assert sent(root, bucket.url("town")).n_sent == 1


def test_an_object_of_another_size_is_sent_again(root: Path, bucket: Bucket) -> None:
    sent(root, bucket.url("town"))
    key, size = max(bucket.sizes("town/files/").items())
    bucket.put(key, b"cut")
    assert sent(root, bucket.url("town")).n_sent == 1
    assert bucket.sizes()[key] == size


def test_current_is_written_last(root: Path, bucket: Bucket, store: Server) -> None:
    before = len(store.requests)
    sent(root, bucket.url("town"))
    put = [each for each in store.requests[before:] if each.startswith("PUT ")]
    assert [each.split("?")[0].rpartition("/")[2] for each in put[-2:]] == ["000001.json", CURRENT]


def test_a_server_that_dies_in_an_upload_leaves_the_former_generation(
    root: Path, bucket: Bucket, store: Server
) -> None:
    url = bucket.url("town")
    sent(root, url)
    former = bytes_of(root, read_generation(root))
    shutil.rmtree(root)
    made_index(root, (5,), seed=1)  # with other words: every file is another
    named_anew(root, read_generation(root))

    class Dying(Bars):
        def advance(self, stage: str) -> None:
            store.stop()

    with pytest.raises(TaskFailed, match="can still be read"):
        publish(root, place_of(url), Dying(None))
    store.start()
    there = OpenedIndex(place_of(url))
    assert bytes_of(there.root, there.generation) == former
    assert sent(root, url).generation == 2
    assert OpenedIndex(place_of(url)).generation.number == 2


def test_an_object_that_was_cut_or_changed_is_refused(root: Path, bucket: Bucket) -> None:
    url = bucket.url("town")
    sent(root, url)
    key = max(bucket.sizes("town/files/"), key=bucket.sizes("town/files/").__getitem__)
    whole = bucket.get(key)
    for damaged in (whole[:-1], whole + b" ", b"\xff" + whole[1:]):
        bucket.put(key, damaged)
        with pytest.raises(BadIndex, match="is damaged"):
            OpenedIndex(place_of(url))
    bucket.put(key, whole)
    assert OpenedIndex(place_of(url)).n_images == 5


def test_an_object_that_is_gone_is_named(root: Path, bucket: Bucket) -> None:
    sent(root, bucket.url("town"))
    key = min(bucket.sizes("town/files/"))
    bucket.remove(key)
    with pytest.raises(BadIndex, match=key):
        OpenedIndex(place_of(bucket.url("town")))


def test_a_damaged_file_is_not_published(root: Path, bucket: Bucket) -> None:
    path = root / "catalogue" / "0001.parquet"
    path.write_bytes(b"\xff" + path.read_bytes()[1:])
    with pytest.raises(BadIndex, match="flaneur verify"):
        sent(root, bucket.url("town"))
    assert CURRENT not in {key.rpartition("/")[2] for key in bucket.sizes()}


def test_another_index_is_not_published_over_one(
    root: Path, bucket: Bucket, tmp_path: Path
) -> None:
    sent(root, bucket.url("town"))
    made_index(tmp_path / "other", (5,), seed=1)
    with pytest.raises(BadIndex, match="holds another index"):
        sent(tmp_path / "other", bucket.url("town"))


def test_the_index_s_own_model_comes_along_and_goes(root: Path, bucket: Bucket) -> None:
    url = bucket.url("town")
    for model in (b"one", b"another", None):
        path = model_path(root)
        path.parent.mkdir(exist_ok=True)
        path.unlink() if model is None else path.write_bytes(model)
        sent(root, url)
        there = model_path(OpenedIndex(place_of(url)).root)
        assert (there.read_bytes() if there.exists() else None) == model


def test_what_was_fetched_once_is_not_fetched_again(
    root: Path, bucket: Bucket, store: Server
) -> None:
    def fetched() -> Iterator[str]:
        before = len(store.requests)
        OpenedIndex(place_of(bucket.url("town")))
        return (each for each in store.requests[before:] if "GET" in each and "/files/" in each)

    sent(root, bucket.url("town"))
    assert len(list(fetched())) == len(bucket.sizes("town/files/"))
    assert not list(fetched())
    later(root)
    sent(root, bucket.url("town"))
    assert len(list(fetched())) == 1


def test_a_fetch_that_was_broken_off_goes_on(root: Path, bucket: Bucket, store: Server) -> None:
    class Dying(Bars):
        def advance(self, stage: str) -> None:
            store.stop()

    url = bucket.url("town")
    sent(root, url)
    with pytest.raises(BadIndex, match="cannot be read"):
        at_hand(place_of(url), None, Dying(None))
    store.start()
    before = len(store.requests)
    there = OpenedIndex(place_of(url))
    again = [each for each in store.requests[before:] if "GET" in each and "/files/" in each]
    assert len(again) < len(there.generation.files)
    assert not verify(there.root, every=False, progress=BARS).faults


def test_a_copy_that_was_damaged_is_mended(root: Path, bucket: Bucket) -> None:
    sent(root, bucket.url("town"))
    there = OpenedIndex(place_of(bucket.url("town")))
    (there.root / "catalogue" / "0001.parquet").write_bytes(b"")
    OpenedIndex(place_of(bucket.url("town")))
    assert not verify(there.root, every=False, progress=BARS).faults


def test_an_earlier_generation_is_kept_for_as_long_as_it_is_open(
    root: Path, bucket: Bucket
) -> None:
    url = bucket.url("town")
    sent(root, url)
    first: OpenedIndex | None = OpenedIndex(place_of(url))
    folder = first.root if first is not None else root
    later(root)
    sent(root, url)
    OpenedIndex(place_of(url))
    assert first is not None
    assert len(first.catalogue.column("uri")) == 5  # read only now
    first = None
    OpenedIndex(place_of(url))
    assert not folder.exists()


def test_a_generation_that_is_live_no_more_can_still_be_asked_for(
    root: Path, bucket: Bucket
) -> None:
    url = bucket.url("town")
    sent(root, url)
    later(root)
    sent(root, url)
    assert OpenedIndex(place_of(url)).generation.number == 2
    assert OpenedIndex(place_of(url), 1).generation.number == 1
    with pytest.raises(BadIndex, match="no generation 3"):
        OpenedIndex(place_of(url), 3)


def test_readers_that_fetch_at_once_fetch_once(root: Path, bucket: Bucket, store: Server) -> None:
    url = bucket.url("town")
    sent(root, url)
    before = len(store.requests)
    # Threads stand for processes: each opens the locks for itself, and that is who holds them.
    with ThreadPoolExecutor(3) as pool:
        held = [pool.submit(at_hand, place_of(url)) for _ in range(3)]
        (folder,) = {each.result().root for each in held}
    assert not verify(folder, every=False, progress=BARS).faults
    got = [each for each in store.requests[before:] if "GET" in each and "/files/" in each]
    assert len(got) == len(set(got)) == len(bucket.sizes("town/files/"))


def test_a_folder_is_itself(root: Path) -> None:
    held = at_hand(root)
    assert isinstance(held, Held)
    assert held.root == root
    assert not cache_folder().exists()


@pytest.mark.parametrize("current", [b"", b"none", b"-1", b"9" * 200, None])
def test_what_is_no_published_index_is_refused(bucket: Bucket, current: bytes | None) -> None:
    if current is not None:
        bucket.put(f"town/{CURRENT}", current)
    with pytest.raises(BadIndex, match="ublish"):
        OpenedIndex(place_of(bucket.url("town")))


def test_a_hostile_generation_reaches_no_file_outside(
    root: Path, bucket: Bucket, tmp_path: Path
) -> None:
    sent(root, bucket.url("town"))
    told = bucket.get("town/generations/000001.json")
    bucket.put(
        "town/generations/000001.json",
        told.replace(b"catalogue/0001.parquet", b"../../../../../../outside"),
    )
    with pytest.raises(BadIndex, match="outside the index"):
        OpenedIndex(place_of(bucket.url("town")))
    assert not list(tmp_path.rglob("outside"))
