"""A page's terminal without its socket: what it takes, what it's sent, and how little waits for it."""

from __future__ import annotations

import json

import pytest

from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.monitor import TerminalMonitor
from interfaces.val2.pages import FRAME, UNREAD, WINDOW, PageTerminal
from tests.interfaces.val2.sitting import Sitting


class Seen:
    """A page's terminal, and what its page was sent."""

    def __init__(self, directory, *, read_only="", examples=None):
        self.sitting = Sitting(directory)
        self.sitting.monitor.leave(now=0.0)
        self.terminal = PageTerminal()
        self.text, self.prompt, self.size, self.others = "", None, 0, []
        self.tell(type="hello", token=None, session="page's")
        files = Files(directory, examples=examples)
        self.monitor = TerminalMonitor(
            self.sitting.shared, files, "a test", read_only=read_only, session=self.terminal.session
        )
        self.terminal.begin(self.monitor, now=0.0)
        self.look()

    def tell(self, **message):
        self.terminal.receive(json.dumps(message), now=self.sitting.now)

    def look(self, *, shows=True):
        """Read what is sent; a page that shows nothing says nothing."""
        self.terminal.advance(now=self.sitting.now)
        while (data := self.terminal.outgoing()) is not None:
            message = json.loads(data)
            if message["type"] != "said":
                self.others.append(message)
                continue
            self.text += "".join(part for part, _ in message["pieces"])
            self.prompt, self.size = message["prompt"], message["size"]
            if shows:
                self.tell(type="shown", size=self.size)

    def type(self, *lines, shows=True):
        self.text = ""
        self.tell(type="lines", lines=list(lines))
        self.look(shows=shows)
        return self.text


def test_lines_in_and_what_is_said_out(tmp_path):
    (tmp_path / "own.v2").write_text(".PROGRAM own()\n.END\n")
    examples = tmp_path / "examples"
    examples.mkdir()
    (examples / "circle.v2").write_text(".PROGRAM circle()\n.END\n")
    seen = Seen(tmp_path, examples=examples)
    assert seen.others == [{"type": "ready", "files": ["circle", "own"], "barred": False}]
    assert (seen.prompt, "HELP" in seen.text) == (".", True)
    assert "919.85" in seen.type("where")
    assert "circle.v2: 1 program" in seen.type("load circle")
    assert "*Invalid file name*" in seen.type("load ../own")
    seen.type("store circle")
    assert (tmp_path / "circle.v2").is_file()
    assert (examples / "circle.v2").read_text() == ".PROGRAM circle()\n.END\n"
    seen.tell(type="complete", text="stat")
    seen.look()
    assert seen.others[-1] == {"type": "completed", "text": "stat", "fragment": "stat", "words": ["status"]}
    seen.type("edit a", 'prompt "n? ", n', "e", "execute a")
    assert seen.prompt == "n? "
    seen.tell(type="interrupt")
    seen.look()
    assert seen.prompt == "."
    seen.type("quit")
    assert seen.terminal.closing is not None


def test_a_page_that_shows_nothing_is_sent_little_and_loses_what_finds_no_room(tmp_path):
    seen = Seen(tmp_path)
    seen.type("edit flood", "while true do", 'type "0123456789012345678901234567890123456789"', "end", "e")
    seen.type("execute flood", shows=False)
    for _ in range(300):
        seen.sitting.now += 0.05
        seen.look(shows=False)
        assert len(seen.text) <= WINDOW + 2 * FRAME
        assert seen.terminal.waiting <= UNREAD + 100
    assert seen.terminal.lost
    seen.type("abort", shows=False)
    for _ in range(20):
        seen.tell(type="shown", size=seen.size)
        seen.look()
    assert seen.terminal.waiting == 0
    assert "919.85" in seen.type("where")
    assert "*Output lost*" in seen.text


@pytest.mark.parametrize(
    "data",
    [
        "", "{", "[]", "null", '{"type":"who"}', '{"type":"hello","session":""}', '{"type":"lines","lines":[1]}',
        '{"type":"nothing"}', '{"type":"shown","size":-1}', '{"type":"shown","size":1e400}', b"\xff\xfe",
        "[" * 9000,
        '{"type":"lines","lines":["' + "x" * 20_000 + '"]}',
        '{"type":"who","session":"' + "x" * 300 + '"}',
    ],
    ids=range(14),
)  # fmt: skip
def test_what_is_no_message_ends_the_connection_and_does_nothing(tmp_path, data):
    seen = Seen(tmp_path)
    before = seen.terminal.session
    seen.terminal.receive(data, now=0.0)
    assert seen.terminal.closing is not None
    assert seen.terminal.session == before


def test_who_only_looks_is_told_so(tmp_path):
    seen = Seen(tmp_path, read_only="this token only looks")
    assert "looking only" in seen.text
    assert "*No control*" in seen.type("do ready")
    assert "919.85" in seen.type("where")


def test_what_is_said_fits_a_narrow_page(tmp_path):
    seen = Seen(tmp_path)
    wide = seen.type("WHERE")
    lines = ("POINT a", "1,2,3,4,5,6", "", "WHERE", "HELP", "HELP MOVE", "LISTL", "TOOL", "STATUS", "SPEDE 20")

    def longest():
        return max(map(len, "".join(seen.type(line) for line in lines).splitlines()))

    assert longest() > 60
    seen.tell(type="columns", columns=50)
    narrow = seen.type("WHERE")
    assert sorted(narrow.split()) == sorted(wide.split())
    assert longest() < 50
    seen.tell(type="columns", columns=200)
    assert seen.type("WHERE") == wide
