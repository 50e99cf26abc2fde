"""The HTTP doors of `vrs serve` and `vrs replay`: paths, statuses, kinds, headers that keep strangers out."""

from __future__ import annotations

import http.client
import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import pytest

from tests.contract.doors import directory, served

HTML, SCRIPT, STYLE, TEXT, JSON, JPEG = (
    "text/html", "text/javascript", "text/css", "text/plain", "application/json", "image/jpeg",
)  # fmt: skip
SERVERS: Final = {
    "arm": ("serve", "--port", "0", "--body", "exact", "--until-eof"),
    "base": ("serve", "--port", "0", "--robot", "ipr", "--room", "home", "--camera", "2", "--until-eof"),
    "replay": ("replay", "data/recordings/demo.mcap", "data/recordings/val2.mcap", "--port", "0"),
}
VIEW: Final = {"/view": HTML, "/view/view.js": SCRIPT, "/view/view.css": STYLE, "/view/licences.txt": TEXT}
PLAY: Final = {
    "/replay": HTML, "/replay/replay.js": SCRIPT, "/replay/replay.css": STYLE, "/replay/licences.txt": TEXT,
}  # fmt: skip
DOORS: Final = {
    "arm": {"/": HTML, "/health": JSON, "/station/vrs.js": SCRIPT, **VIEW, **PLAY},
    "base": {"/": HTML, "/health": JSON, "/station/vrs.js": SCRIPT, "/media/still": JPEG, **VIEW, **PLAY},
    "replay": PLAY,
}
"""What is served, and of which kind; scripts and styles besides are what the pages name."""
NOT_HERE: Final = {
    "arm": (
        "/nothing",
        "/station/nothing.js",
        "/view/../../etc/passwd",
        "/media/still",
        "/recordings/copy/x",
        "/docs",
    ),
    "base": ("/nothing", "/station/station.py", "/view/%2e%2e/secret", "/recordings/copy/x", "/docs"),
    "replay": ("/nothing", "/replay/replay.py", "/station/station.py", "/docs"),
}
FRAMES: Final = re.compile("/(view|replay)(/|$)")
"""Pages that the station shows in frames of its own."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What an HTTP server said."""

    status: int
    headers: dict[str, str]
    body: bytes

    @property
    def kind(self) -> str:
        return self.headers.get("content-type", "").split(";")[0]


def ask(address: str, path: str, method: str = "GET", **headers: str) -> Answer:
    connection = http.client.HTTPConnection(address, timeout=30.0)
    try:
        connection.request(method, path, headers={name.replace("_", "-"): value for name, value in headers.items()})
        answer = connection.getresponse()
        given = {name.lower(): value for name, value in answer.getheaders()}
        return Answer(answer.status, given, answer.read())
    finally:
        connection.close()


@pytest.fixture(scope="module", params=SERVERS)
def server(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, str]]:
    """A server's name and its address."""
    with served(*SERVERS[request.param], cwd=directory(tmp_path_factory.mktemp("pages"))) as serving:
        yield request.param, serving.address


def test_every_door_opens_and_is_of_its_kind(server: tuple[str, str]) -> None:
    name, address = server
    found = {path: (answer.status, answer.kind) for path in DOORS[name] for answer in [ask(address, path)]}
    assert found == {path: (200, kind) for path, kind in DOORS[name].items()}


def test_what_a_page_names_is_there_and_its_own(server: tuple[str, str]) -> None:
    name, address = server
    for path, kind in DOORS[name].items():
        if kind != HTML:
            continue
        html = ask(address, path).body.decode()
        named = re.findall(r'<(?:script|link|img)[^>]*?(?:src|href)="([^"]+)"', html)
        assert named
        for one in named:
            assert re.match(r"/[^/]|data:", one), one
            if one.startswith("/"):
                assert ask(address, one).status == 200, one


def test_every_answer_of_a_page_keeps_strangers_out(server: tuple[str, str]) -> None:
    name, address = server
    for path in DOORS[name]:
        if path == "/health":
            continue
        headers = ask(address, path).headers
        assert headers["x-content-type-options"] == "nosniff", path
        assert headers["referrer-policy"] == "no-referrer", path
        assert headers["cache-control"] in ("no-cache", "no-store"), path
        rules = headers["content-security-policy"].split("; ")
        policy = {rule.split()[0]: set(rule.split()[1:]) for rule in rules}
        shown_in = {"'self'"} if FRAMES.match(path) else {"'none'"}
        expected = {
            "default-src": {"'none'"},
            "base-uri": {"'none'"},
            "form-action": {"'none'"},
            "connect-src": {"'self'"},
        }
        assert {key: policy[key] for key in expected} == expected, path
        assert policy["frame-ancestors"] == shown_in, path
        scripts = {source for source in policy["script-src"] if not source.startswith("'nonce-")}
        assert scripts <= {"'self'"}, path


def test_what_isnt_there_is_not_found(server: tuple[str, str]) -> None:
    name, address = server
    assert {path: ask(address, path).status for path in NOT_HERE[name]} == dict.fromkeys(NOT_HERE[name], 404)


def test_a_file_that_is_kept_is_not_sent_again(server: tuple[str, str]) -> None:
    name, address = server
    path = "/replay/replay.js" if name == "replay" else "/view/view.js"
    first = ask(address, path)
    again = ask(address, path, If_None_Match=first.headers["etag"])
    assert (again.status, again.body) == (304, b"")


def test_other_hosts_and_methods_are_refused(server: tuple[str, str]) -> None:
    name, address = server
    page = "/replay" if name == "replay" else "/"
    assert ask(address, page, Host="evil.example").status in (400, 403, 421)
    assert ask(address, page, "POST").status in (404, 405)
    assert ask(address, page, "DELETE").status in (404, 405)


def test_replay_begins_at_its_page(server: tuple[str, str]) -> None:
    name, address = server
    if name == "replay":
        answer = ask(address, "/")
        assert (answer.status, answer.headers["location"]) == (307, "/replay")


def test_health_says_that_all_is_well(server: tuple[str, str]) -> None:
    name, address = server
    if name != "replay":
        said = json.loads(ask(address, "/health").body)
        assert said["ok"] is True
        assert said["robot"] == {"arm": "puma560", "base": "ipr"}[name]
        assert said["lease"] == "free"
        assert isinstance(said["now"], float)
