"""`flaneur publish`, as a person and as a program read it."""

from pathlib import Path

import pytest
from index_shop import Shop
from object_store import Bucket


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


def test_publish_tells_what_was_sent_and_that_nothing_is_missing(
    shop: Shop, bucket: Bucket
) -> None:
    url = bucket.url("town")
    first, again = (shop.ask("publish", shop.root, url, "--json") for _ in range(2))
    assert first["url"] == url
    assert first["files_sent"] == first["files"] == len(bucket.sizes("town/files/"))
    assert first["bytes_sent"] == first["bytes"] == sum(bucket.sizes("town/files/").values())
    assert (again["files_sent"], again["bytes_sent"]) == (0, 0)
    code, said = shop.say("publish", shop.root, url)
    assert (code, f"{url}: generation 1" in said) == (0, True)


@pytest.mark.parametrize(
    ("place", "code", "said"),
    [
        ("/srv/town", 2, "no URL"),
        ("foo://town", 2, "foo://"),
        ("s3://key:secret@town/x", 2, "AWS_ACCESS_KEY_ID"),
        ("s3://no-such-bucket/town", 1, "Check the bucket"),
    ],
)
def test_where_nothing_can_be_published_is_told(
    shop: Shop, bucket: Bucket, place: str, code: int, said: str
) -> None:
    ended, told = shop.say("publish", shop.root, place)
    assert ended == code
    assert said in told
    assert "secret" not in told
