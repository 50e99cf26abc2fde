"""Saved poses through their door: who may, what is refused, and that a server that's started again has them."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import pytest

from interfaces.messages.control import Role
from interfaces.station.poses import MOST, Poses
from interfaces.stream.access import Access
from robots import puma560
from tests.interfaces.stream.serving import served
from vrs.clock import WallClock
from vrs.errors import FormatError

MODEL = puma560.model()
Q = [0.1, -0.2, 0.3, 0.0, 0.5, 1.0]
TOKENS = {role: role.value[0] * 43 for role in Role}


def poses(folder: Path) -> Poses:
    return Poses(MODEL, folder, Access(TOKENS, free=()), WallClock())


def ask(server: Any, change: object = None, role: Role | None = Role.OPERATOR) -> tuple[int, dict[str, Any]]:
    data = None if change is None else json.dumps(change).encode()
    request = urllib.request.Request(f"http://127.0.0.1:{server.port}/poses", data)
    if role is not None:
        request.add_header("Authorization", f"Bearer {TOKENS[role]}")
    try:
        with urllib.request.urlopen(request, timeout=20) as answer:
            return answer.status, json.loads(answer.read())
    except urllib.error.HTTPError as refused:
        with refused:
            return refused.code, json.loads(refused.read())


def test_operators_keep_viewers_look_and_a_server_that_starts_again_has_them(tmp_path: Path) -> None:
    folder = tmp_path / "made when it's needed"
    with served(poses(folder).routes) as server:
        assert ask(server, role=Role.VIEWER) == (200, {"poses": {}})
        assert not folder.exists()
        assert ask(server, {"name": "Übergabe", "q": Q}) == (200, {"poses": {"Übergabe": Q}})
        assert ask(server, {"name": "b", "q": Q[::-1]})[0] == 200
        for role, change in ((None, None), (None, {"name": "b"}), (Role.VIEWER, {"name": "b"})):
            assert ask(server, change, role)[0] == 403
    with served(poses(folder).routes) as server:
        assert ask(server, role=Role.VIEWER)[1]["poses"] == {"Übergabe": Q, "b": Q[::-1]}
        assert ask(server, {"name": "b"}) == (200, {"poses": {"Übergabe": Q}})
    assert [path.name for path in folder.iterdir()] == ["poses-puma560.json"]


def test_what_cant_be_kept_is_said_and_changes_nothing(tmp_path: Path) -> None:
    with served(poses(tmp_path).routes) as server:
        assert ask(server, {"name": "a", "q": Q})[0] == 200
        for change, why in (
            ({"name": "a", "q": Q}, "one that no pose has"),
            ({"name": "ready", "q": Q}, "one that no pose has"),
            ({"name": "", "q": Q}, "length >= 1"),
            ({"name": "x" * 25, "q": Q}, "length <= 24"),
            ({"name": "b", "q": Q[:5]}, "6 finite joint values"),
            ({"name": "b", "q": [1e999] * 6}, "malformed"),
            ({"name": "b", "q": Q, "more": 1}, "unknown field"),
            ({"name": "b" * 5000}, "up to 4096 bytes"),
            ([], "Expected `object`"),
        ):
            status, found = ask(server, change)
            assert (status, why in found["problem"]) == (400, True), found
        assert ask(server)[1]["poses"] == {"a": Q}
    (tmp_path / "poses-puma560.json").write_text(json.dumps({str(k): Q for k in range(MOST)}))
    with served(poses(tmp_path).routes) as server:
        assert f"up to {MOST}" in ask(server, {"name": "one more", "q": Q})[1]["problem"]


@pytest.mark.parametrize("text", ["", "[]", '{"a": [1]}', '{"a": [1, 2, 3, 4, 5, "6"]}'])
def test_a_file_of_something_else_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "poses-puma560.json").write_text(text)
    with pytest.raises(FormatError, match=r"poses-puma560\.json: holds no poses"):
        poses(tmp_path)
