"""The station by TLS: a browser takes it for a secure context, and everything of the page goes on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.interfaces.live_rig import child
from tests.interfaces.station.opened import SERVE, paged, station


def test_the_page_works_by_https(browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with child(*SERVE, "--tls", "--port", "0") as server:
        assert server.url.startswith("https://127.0.0.1:")
        assert (tmp_path / "vrs-teleop" / "tls.pem").stat().st_mode & 0o777 == 0o600
        with paged(browser, station(server), ignore_https_errors=True) as page:
            page.open()
            assert page.get("window.isSecureContext")
            assert page.get("typeof navigator.mediaDevices.getUserMedia") == "function"
            page.take_control()
            assert page.get("document.cookie") == ""
