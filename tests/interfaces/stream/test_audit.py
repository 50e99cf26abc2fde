"""The audit log: its chain, what breaks it, what goes on with it, and what a hub writes."""

from __future__ import annotations

import asyncio
import errno
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect as dial
from websockets.typing import Subprotocol

from interfaces import connect
from interfaces.cli.main import exit_status
from interfaces.messages.control import Role
from interfaces.stream.access import add_person, end_person
from interfaces.stream.audit import FIRST, LINES_BURST, AuditLog, check_audit, head_of
from interfaces.stream.client_socket import UnreachableError
from tests.interfaces import live_rig
from tests.interfaces.joined import to
from tests.interfaces.stream.served import ADMIN, served
from vrs.errors import FormatError


def facts(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Of a log of eight lines, in two lives."""
    path = tmp_path / "audit.jsonl"
    for life in ("first", "second"):
        log = AuditLog(path)
        for k in range(2):
            log.note("control", who=f"{life} {k}", epoch=str(k))
        log.close()
    return path


def test_a_log_goes_on_with_its_chain_and_is_its_owners(path: Path) -> None:
    found = check_audit(path)
    assert (found.lines, found.problem) == (8, "")
    assert [one["n"] for one in facts(path)] == list(range(1, 9))
    assert [one["event"] for one in facts(path)] == 2 * ["began", "control", "control", "ended"]
    assert facts(path)[-1]["hash"] == found.hash
    assert path.stat().st_mode & 0o777 == head_of(path).stat().st_mode & 0o777 == 0o600


def _changed(lines: list[bytes]) -> list[bytes]:
    return [*lines[:2], lines[2].replace(b"first 1", b"nobody!"), *lines[3:]]


def _whole_line_of_ones_own(lines: list[bytes]) -> list[bytes]:
    """Changed, and hashed as if it stood at the beginning."""
    import hashlib

    text = lines[2].partition(b',"hash"')[0].replace(b"first 1", b"nobody!") + b"}"
    found = hashlib.sha256(FIRST.encode() + text).hexdigest().encode()
    return [*lines[:2], text[:-1] + b',"hash":"' + found + b'"}\n', *lines[3:]]


@pytest.mark.parametrize(
    ("tamper", "says"),
    [
        (_changed, "line 3 is changed, or the one before it"),
        (_whole_line_of_ones_own, "line 3 is changed, or the one before it"),
        (lambda lines: lines[:2] + lines[3:], "line 3 is missing"),
        (lambda lines: lines[:2] + lines[5:], "lines 3 to 5 are missing"),
        (lambda lines: lines[1:], "line 1 is missing"),
        (lambda lines: lines[:-1], "line 8 is missing at the end"),
        (lambda lines: lines[:-3], "lines 6 to 8 are missing at the end"),
        (lambda lines: [], "lines 1 to 8 are missing at the end"),
        (lambda lines: [*lines[:2], lines[2][:20] + b"\n", *lines[3:]], "line 3 is changed or cut"),
        (lambda lines: [*lines[:7], lines[7][:30]], "line 8 is changed or cut"),
        (lambda lines: [*lines[:3], b"rubbish\n", *lines[3:]], "line 4 is changed or cut"),
        (lambda lines: [*lines[:3], lines[2], *lines[3:]], "line 4 is changed: it has the number 3"),
        (lambda lines: [*lines[:2], lines[3], lines[2], *lines[4:]], "line 3 is missing"),
        (lambda lines: [*lines[:4], lines[4].replace(b'"n":5', b'"n":6'), *lines[5:]], "line 5 is missing"),
    ],
)
def test_t14_each_kind_of_tampering_is_found_where_it_is(
    path: Path, tamper: Callable[[list[bytes]], list[bytes]], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path.write_bytes(b"".join(tamper(path.read_bytes().splitlines(keepends=True))))
    assert check_audit(path).problem.startswith(says)
    assert exit_status(["doctor", "--log", str(path)]) == 1
    assert says in capsys.readouterr().out


def test_lines_that_were_cut_off_before_a_start_are_missed_afterwards_too(path: Path) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-2]))
    AuditLog(path).close()
    assert check_audit(path).problem == "lines 7 to 8 are missing that was there before line 7 began"


def test_a_head_that_is_gone_or_another_is_told(path: Path) -> None:
    head_of(path).write_text(f"{3:016d} {FIRST}\n")
    assert "isn't the last one" in check_audit(path).problem
    head_of(path).unlink()
    assert "is missing" in check_audit(path).problem


def test_doctor_says_a_whole_log_and_its_last_hash(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert exit_status(["doctor", "--log", str(path)]) == 0
    assert facts(path)[-1]["hash"] in capsys.readouterr().out
    assert exit_status(["doctor", "--log", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["lines"] == 8
    assert exit_status(["doctor", "--log", str(path.parent / "none")]) == 2


def test_a_person_is_named_and_cut_off_when_the_token_ends(tmp_path: Path) -> None:
    path, tokens = tmp_path / "audit.jsonl", tmp_path / "tokens"
    token = add_person(tokens, "ada", Role.OPERATOR, "2090-01-31")
    log = AuditLog(path)
    with served(audit=log, people=tokens) as serving:
        url = f"ws://127.0.0.1:{serving.port}/ws"
        with connect(url, token=token, name="Ada's page") as robot:
            assert robot.acquire().yours
            end_person(tokens, "ada")
            assert robot.wait(lambda robot: not robot.is_connected, 10.0)
            with pytest.raises(UnreachableError, match="this token isn't one for the role operator"):
                connect(url, token=token)
            _until(lambda: serving.hub.robot.log[-1] == ("ended", 1, "expired"))
    log.close()
    told = [(one["event"], one.get("person"), one.get("why")) for one in facts(path)[1:-1]]
    assert told == [
        ("control", "ada", None),
        ("refused", "ada", "this token has ended: ask for another one"),
        ("refused", None, "this token isn't one for the role operator"),
        ("control ended", "ada", "expired"),
    ]


def test_a_file_that_is_no_log_isnt_written_to(tmp_path: Path) -> None:
    path = tmp_path / "notes"
    path.write_text("my notes\n")
    with pytest.raises(FormatError, match="isn't one of a log's"):
        AuditLog(path)
    assert path.read_text() == "my notes\n"


def test_a_robot_writes_whom_it_follows_and_whom_it_refuses(tmp_path: Path) -> None:
    log = AuditLog(tmp_path / "audit.jsonl")

    async def main() -> None:
        async with live_rig.robot_here(audit=log) as (_, url):
            async with live_rig.operator_here(url) as (operator, _):
                await live_rig.until(lambda: operator.robot.attached)
            async with dial(url, subprotocols=[Subprotocol("vrs.1.json")]) as line:
                await line.send(json.dumps({"type": "hello", "protocol": 1, "role": "viewer", "name": "Mallory"}))
                assert json.loads(await line.recv())["code"] == "refused"

    asyncio.run(main())
    log.close()
    told = [one["event"] for one in facts(log.path)]
    assert told == ["began", "followed", "left", "refused", "ended"]
    assert check_audit(log.path).problem == ""


def test_after_a_kill_the_log_is_whole_and_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    code = (
        "import sys\nfrom pathlib import Path\nfrom interfaces.stream.audit import AuditLog\n"
        "log = AuditLog(Path(sys.argv[1]))\nk = 0\n"
        "while True:\n    k += 1\n    log.note('control', who='x' * 500, k=k)\n"
    )
    for life in range(3):
        process = subprocess.Popen([sys.executable, "-c", code, str(path)])
        most = 50_000 + (path.stat().st_size if life else 0)
        _until(lambda most=most: path.exists() and path.stat().st_size > most)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        assert check_audit(path).problem == ""
    assert [one["event"] for one in facts(path)].count("began") == 3


def test_a_line_that_the_machines_stop_tore_is_told_and_the_chain_goes_on(path: Path) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-1]) + lines[-1][:25])
    head_of(path).write_text(f"{7:016d} {json.loads(lines[6])['hash']}\n")
    AuditLog(path).close()
    assert check_audit(path).problem == ""
    assert "torn" in json.loads(path.read_bytes().splitlines()[-2])


@pytest.mark.parametrize("takes", [0, 40])
def test_a_full_disk_is_told_once_and_lines_that_are_lost_are_counted(
    tmp_path: Path, takes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, said, full = tmp_path / "audit.jsonl", [], [False]
    write = os.write

    def writing(file: int, data: bytes) -> int:
        if not full[0] or len(data) < 100:
            return write(file, data)
        if not takes:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(file, data[:takes])

    monkeypatch.setattr(os, "write", writing)
    log = AuditLog(path, failed=said.append)
    log.note("control", who="before " * 20)
    _until(lambda: path.exists() and path.read_bytes().count(b"\n") == 2)
    full[0] = True
    log.note("control", who="lost " * 20)
    log.note("control", who="lost " * 20)
    _until(lambda: log.lost == 2)
    full[0] = False
    log.note("control", who="after " * 20)
    log.close()
    assert check_audit(path).problem == ""
    assert [one.get("lost") for one in facts(path)] == [None, None, 2, None]
    assert len(said) == 2
    assert "space" in said[0]


def test_lines_are_on_the_disk_and_one_that_fails_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, fails, kept, fsync = tmp_path / "audit.jsonl", [False], [0], os.fsync

    def syncing(file: int) -> None:
        if fails[0]:
            raise OSError(errno.EIO, os.strerror(errno.EIO))
        fsync(file)
        kept[0] = path.stat().st_size

    monkeypatch.setattr(os, "fsync", syncing)
    log = AuditLog(path)
    log.note("control", who="Ada")
    _until(lambda: path.read_bytes().count(b"\n") == 2 and kept[0] == path.stat().st_size)
    assert log.health() == {"problem": "", "lost": 0}
    fails[0] = True
    log.note("control", who="Bo")
    _until(lambda: log.health() == {"problem": f"audit log {path}: Input/output error", "lost": 1})
    with pytest.raises(FormatError, match="another process writes it"):
        AuditLog(path)
    fails[0] = False
    log.close()
    assert check_audit(path).problem == ""
    AuditLog(path).close()


def _until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 30.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_what_is_refused_again_and_again_is_counted(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    log = AuditLog(path)
    for _ in range(10_000):
        log.refused(who="Mallory", what="hello", why="no token")
    for k in range(10_000):
        log.refused(who=f"Mallory {k}", what="hello", why="no token")
    log.close()
    refused = [one for one in facts(path) if one["event"] == "refused"]
    assert len(refused) < 2 * LINES_BURST + 100
    assert sum(one.get("again", 1) for one in refused) == 20_000
    assert check_audit(path).problem == ""


@pytest.mark.parametrize("step", [-3600.0, 3600.0])
def test_a_calendar_that_steps_holds_no_refusal_back(
    tmp_path: Path, step: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("interfaces.stream.audit.COUNTED", 0.01)
    log, calendar = AuditLog(tmp_path / "audit.jsonl"), time.time
    for _ in range(2):
        log.refused(who="Mallory", what="hello", why="no token")
    monkeypatch.setattr(time, "time", lambda: calendar() + step)
    time.sleep(0.02)
    log.advance()
    _until(lambda: [one.get("again") for one in facts(log.path)] == [None, None, 1])
    log.close()


def test_a_hub_writes_who_has_control_who_takes_over_and_what_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "audit.jsonl"
    log = AuditLog(path)
    with served(audit=log) as serving:
        url = f"ws://127.0.0.1:{serving.port}/ws"
        with pytest.raises(UnreachableError):
            connect(url, role="admin", token="b" * 43, name="Mallory")
        with connect(url, name="Ada") as ada, connect(url, role="admin", token=ADMIN, name="Bo") as bo:
            ada.designer.issue(to(1), wait=5.0)
            ada.acquire()
            bo.acquire()
            bo.take_over()
            ada.designer.issue(to(1), wait=5.0)
            bo.release()
    log.close()
    assert check_audit(path).problem == ""
    told = [(one["event"], one.get("who"), one.get("what") or one.get("why")) for one in facts(path)[1:-1]]
    assert told == [
        ("refused", "Mallory", "hello"),
        ("refused", "Ada", "order"),
        ("control", "Ada", None),
        ("refused", "Bo", "acquire"),
        ("takes over", "Bo", None),
        ("control ended", "Ada", "taken over"),
        ("control", "Bo", None),
        ("control ended", "Bo", "released"),
        # The second one, counted.
        ("refused", "Ada", "order"),
    ]
    text = path.read_text()
    assert ADMIN not in text
    assert "b" * 43 not in text
    assert all(one["address"] == "127.0.0.1" for one in facts(path)[1:-1])
