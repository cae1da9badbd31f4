"""What a message may hold: whatever else is in it, no worker acts on it."""

from pathlib import Path

import pytest

from contracts.config import SearchConfig
from contracts.errors import BadConfig, Refused, TaskFailed
from workers.messages import (
    MAX_MESSAGE_BYTES,
    Envelope,
    ExtractMessage,
    LocateMessage,
    TrainMessage,
    our_version,
)
from workers.roots import Roots

JOB = {"index": "/index", "job": "0123456789abcdef", "config_digest": "d"}


def envelope(**changes: object) -> dict[str, object]:
    sent = {"version": our_version(), "lease_s": 60.0, "roots": {"A": "/a"}, "message": {}}
    return {**sent, **changes}


def test_what_is_sealed_is_what_is_opened() -> None:
    sent = Envelope(version=our_version(), lease_s=2.5, roots={"A": "/a"}, message={"shard": 3})
    assert Envelope.opened(sent.sealed()) == sent


def test_another_version_is_refused_whatever_else_it_says() -> None:
    with pytest.raises(Refused, match=r"the coordinator 9\.9\.9\. Install the same version"):
        Envelope.opened({"version": "9.9.9", "of a": "later format"})


@pytest.mark.parametrize(
    "content",
    [
        None,
        "",
        7,
        [],
        envelope(more=1),
        envelope(lease_s=0),
        envelope(lease_s=1e9),
        envelope(lease_s="nan"),
        envelope(roots={"A": 1}),
        envelope(message=[]),
        envelope(message="__import__('os')"),
    ],
)
def test_a_damaged_envelope_is_not_opened(content: object) -> None:
    with pytest.raises(TaskFailed, match="does not hold"):
        Envelope.opened(content)


def test_a_message_that_is_too_large_is_neither_sent_nor_read() -> None:
    large = {"index": "x" * MAX_MESSAGE_BYTES}
    with pytest.raises(BadConfig, match="at most"):
        Envelope(version=our_version(), lease_s=60, roots={}, message=large).sealed()
    with pytest.raises(TaskFailed, match="larger than"):
        Envelope.opened(envelope(message=large))


@pytest.mark.parametrize("shard", [-1, "../1", 1.5, None, [1]])
def test_a_shard_is_a_number(shard: object) -> None:
    with pytest.raises(TaskFailed, match="shard"):
        ExtractMessage.parse({**JOB, "shard": shard})


@pytest.mark.parametrize("job", ["../../../../etc", "0123456789abcde/", "", "0123456789ABCDEF"])
def test_a_job_is_an_id_and_no_path(job: str) -> None:
    with pytest.raises(TaskFailed, match="job"):
        ExtractMessage.parse({**JOB, "shard": 1, "job": job})


@pytest.mark.parametrize("channel", ["../../etc/passwd", "mser", "mser-sift/..", "mser-sift\n", ""])
def test_a_channel_is_a_name_and_no_path(channel: str) -> None:
    with pytest.raises(TaskFailed, match="channel"):
        TrainMessage.parse({**JOB, "channel": channel})


def test_unknown_fields_are_refused() -> None:
    with pytest.raises(TaskFailed, match="run"):
        ExtractMessage.parse({**JOB, "shard": 1, "run": "rm -rf /"})


def test_every_path_of_a_message_is_where_this_machine_has_it(tmp_path: Path) -> None:
    roots = Roots({"A": "/data"}, {"A": str(tmp_path)})
    search = SearchConfig().model_dump(mode="json")
    sent = {"index": "/data/index", "generation": 1, "query": "q", "path": "/data/q.jpg"}
    message = LocateMessage.parse({**sent, "search": search}, roots)
    assert (message.index, message.path) == (f"{tmp_path}/index", f"{tmp_path}/q.jpg")
    for outside in ({"path": "/etc/passwd"}, {"index": "/data/../etc"}, {"search": "/etc/passwd"}):
        with pytest.raises(Refused, match="roots"):
            LocateMessage.parse({**sent, "search": search, **outside}, roots)
