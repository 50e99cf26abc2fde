"""The directory of recordings: names, what is listed, and how many are open at once."""

from __future__ import annotations

import asyncio
import json
import os

import pytest
from starlette.requests import HTTPConnection

from interfaces.recording.playback import Align
from interfaces.station import replays, shelf
from interfaces.station.replays import Replays
from interfaces.station.shelf import Shelf, checked_name
from interfaces.stream.access import Admission
from tests.interfaces.recording.made import make
from vrs.clock import WallClock
from vrs.errors import InvalidValueError


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("kept")
    make(folder / "whole.mcap", 4.0)
    return folder


def test_names_are_plain():
    for name in ("a.mcap", "Übung 3 (b).mcap", "2026-11-22_08.39.mcap", "x" * 95 + ".mcap"):
        assert checked_name(name) == name
    for name in (
        "",
        "a",
        ".mcap",
        "..mcap",
        "a/b.mcap",
        "a\\b.mcap",
        "../a.mcap",
        "a.mcap\n",
        "~a.mcap",
        "é" * 99,
        3,
    ):
        with pytest.raises(InvalidValueError, match="plain file name"):
            checked_name(name)


def test_a_place_is_new_and_its_directory_is_made(tmp_path):
    directory = Shelf(tmp_path / "a" / "b")
    assert directory.entries() == ([], 0)
    place = directory.place("x.mcap")
    assert place.parent.is_dir()
    place.write_text("")
    assert directory.path("x.mcap") == place
    os.symlink(place, place.parent / "link.mcap")
    with pytest.raises(InvalidValueError, match="listed"):
        directory.path("link.mcap")
    place.unlink()
    os.symlink("/nowhere", place)
    with pytest.raises(InvalidValueError, match="isn't taken"):
        directory.place("x.mcap")
    with pytest.raises(InvalidValueError, match="listed"):
        directory.path("x.mcap")
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidValueError, match="a directory"):
        Shelf(tmp_path / "file" / "c").place("x.mcap")


def test_the_list_says_what_is_wrong_and_is_bounded(kept, tmp_path, monkeypatch):
    data = (kept / "whole.mcap").read_bytes()
    (tmp_path / "whole.mcap").write_bytes(data)
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) // 2])
    (tmp_path / "none.mcap").write_bytes(b"hello")
    (tmp_path / "notes.txt").write_bytes(b"hello")
    (tmp_path / "a directory.mcap").mkdir()
    os.symlink(kept / "whole.mcap", tmp_path / "link.mcap")
    found = {entry.name: entry for entry in Shelf(tmp_path).entries()[0]}
    assert set(found) == {"whole.mcap", "cut.mcap", "none.mcap"}
    assert found["whole.mcap"].length == pytest.approx(4.0, abs=0.1)
    assert (found["whole.mcap"].problem, found["whole.mcap"].playable) == ("", True)
    assert found["cut.mcap"].problem.startswith("cut: nothing is known after")
    assert found["cut.mcap"].playable
    assert (found["none.mcap"].problem[:19], found["none.mcap"].playable) == ("isn't a recording: ", False)
    looked = []
    monkeypatch.setattr(shelf, "look_into", lambda path, entry: looked.append(path.name) or entry)
    monkeypatch.setattr(shelf, "AT_ONCE", 1)
    monkeypatch.setattr(shelf, "LISTED", 2)
    directory = Shelf(tmp_path)
    for count in (1, 2, 2):
        entries, more = directory.entries()
        assert (len(entries), more, len(looked)) == (2, 1, count)
    monkeypatch.setattr(shelf, "LISTED", 3)
    assert len(directory.entries(growing=({"whole.mcap", "cut.mcap", "none.mcap"} - set(looked)).pop())[0]) == 3
    assert len(looked) == 2
    monkeypatch.setattr(shelf, "LISTED", 1)
    for time in range(5):
        os.utime(tmp_path / "none.mcap", (2e9 + time, 2e9 + time))
        directory.entries()
        assert len(directory.known) <= 2


NOWHERE = HTTPConnection({"type": "websocket"})


def allowed(_connection, token):
    return Admission("" if token == "yes" else "another one")


def standing(replay):
    return json.loads(replay.board.values["standing"][1])


def test_few_are_open_and_those_nobody_looks_at_are_closed(kept, monkeypatch):
    monkeypatch.setattr(replays, "IDLE", 0.2)
    monkeypatch.setattr(replays, "LOOK", 0.02)
    monkeypatch.setattr(replays, "MOST", 2)
    closed = []
    close = replays.Recording.close
    monkeypatch.setattr(replays.Recording, "close", lambda self: (closed.append(self.path.name), close(self)))

    async def opened(served, **query):
        replay = served.replay_for({"a": "whole.mcap", **query})
        assert replay.let_in(NOWHERE, "no").refusal
        assert replay.task is None
        slot = replay.board.join()
        assert not replay.let_in(NOWHERE, "yes").refusal
        async with asyncio.timeout(30):
            while standing(replay)["kind"] == "opening":
                await asyncio.sleep(0.01)
        return replay, slot

    async def main():
        async with Replays(Shelf(kept), WallClock(), allowed).running() as served:
            first, slot = await opened(served)
            assert standing(first)["kind"] == "open"
            assert served.replay_for({"a": "whole.mcap", "align": "start"}) is first
            assert first.page.playback.tracks[0].recording.path == kept / "whole.mcap"
            other, _ = await opened(served, b="whole.mcap", align="timeline")
            assert other.key[1] is Align.TIMELINE
            full, _ = await opened(served, align="began")
            assert (full.task, standing(full)["kind"]) == (None, "failed")
            assert "open already" in standing(full)["text"]
            first.board.leave(slot)
            async with asyncio.timeout(30):
                while served.open == 2:
                    await asyncio.sleep(0.01)
            assert closed == ["whole.mcap"]
            assert first.page is None
            assert first not in served.replays.values()
            with pytest.raises(InvalidValueError):
                served.replay_for({"a": "../whole.mcap"})
            monkeypatch.setattr(replays, "WAITING", len(served.replays))
            with pytest.raises(InvalidValueError, match="at most"):
                served.replay_for({"a": "whole.mcap", "align": "began", "b": "whole.mcap"})
            monkeypatch.setattr(replays, "WAITING", 64)
            monkeypatch.setattr(replays, "LOOKED_INTO", 1000)
            large, _ = await opened(served)
            assert standing(large)["kind"] == "failed"
            assert "vrs replay opens larger ones" in standing(large)["text"]
        assert closed == ["whole.mcap"] * 3

    asyncio.run(main())
