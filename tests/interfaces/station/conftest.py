"""A server for each file's tests, unless a file has another."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.interfaces.live_rig import Child, child
from tests.interfaces.station.opened import SERVE


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Child]:
    with child(*SERVE, "--port", "0", "--recordings", str(tmp_path_factory.mktemp("recordings"))) as running:
        yield running
