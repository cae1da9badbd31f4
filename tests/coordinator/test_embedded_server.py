"""The server that Flaneur starts by itself, and what is told once it is gone."""

from pathlib import Path

import pytest

from contracts.errors import BrokerUnreachable
from coordinator.engine.embedded import embedded_server, watch_embedded
from workers.server import connect


def test_an_embedded_server_that_is_gone_is_told_at_once(tmp_path: Path) -> None:
    with embedded_server(tmp_path) as url:
        watch_embedded(url)
        server = connect(url)
        server.shutdown(nosave=True)
        with pytest.raises(BrokerUnreachable, match="Run the same command again"):
            watch_embedded(url)
        server.close()
