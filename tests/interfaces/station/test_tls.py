"""The station by TLS: a browser takes it for a secure context, and everything of the page goes on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.interfaces.live_rig import child
from tests.interfaces.station.opened import SERVE, paged, station

LIVE = Path(__file__).parents[2] / "contract/data/recordings/live.mcap"


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


def test_a_recording_is_played_back_by_https(browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    with child("replay", str(LIVE), "--tls", "--port", "0") as server:
        assert server.url.startswith("https://127.0.0.1:")
        assert "tls.pem" in server.process.stdout.readline()  # type: ignore[union-attr]
        with paged(browser, server.url.removesuffix("replay"), ignore_https_errors=True) as page:
            page.page.goto(server.url)
            page.wait("window.replay?.state?.mode === 'playing'")
            begun = page.get("replay.state.t")
            page.wait(f"replay.state.t > {begun}")
            assert page.get("window.isSecureContext")
            assert page.get("replay.state.panes.length") == 1
