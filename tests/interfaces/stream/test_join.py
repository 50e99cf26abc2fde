"""A class comes in: links and QR codes, over HTTP and on a terminal; thirty at one server."""

from __future__ import annotations

import asyncio
import io
import json
import time
import urllib.error
import urllib.request
from itertools import pairwise

import numpy as np
import pytest
import segno

from benchmarks.classroom import OLDEST, QUICKLY, Pupil
from interfaces.cli.options import shown_host
from interfaces.messages.control import Role
from interfaces.stream.access import Access
from interfaces.stream.invitations import RENEWED, Invitations
from interfaces.stream.join import JoinPages
from tests.interfaces.live_rig import child
from tests.interfaces.stream.served import ADMIN, served
from tests.interfaces.test_cli import run
from vrs.clock import ManualClock

BASE = "http://192.168.1.20:8600/"


def got(url, token=None, **options):
    """What a path answers: status, type, bytes."""
    request = urllib.request.Request(url, headers={"Authorization": f"Bearer {token}"} if token else {}, **options)
    try:
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status, answer.headers, answer.read()
    except urllib.error.HTTPError as refused:
        with refused:
            return refused.status, refused.headers, refused.read()


@pytest.fixture(scope="module")
def lesson():
    """`vrs serve --class`: its address, the teacher's token and the codes that it has printed."""
    with child("serve", "--class", "--port", "0") as server:
        lines = [server.process.stdout.readline() for _ in range(4)]
        codes = {line.split()[2].rstrip(":"): line.rstrip().rpartition("?code=")[2] for line in lines[2:]}
        yield server.url.removesuffix("view"), lines[1].split()[-1], codes


def test_the_codes_are_printed_and_told_to_the_teacher(lesson):
    base, token, printed = lesson
    status, headers, body = got(f"{base}class", token)
    told = {one["role"]: one for one in json.loads(body)["invitations"]}
    assert (status, headers["Cache-Control"]) == (200, "no-store")
    for role, does in (("viewer", "watch"), ("operator", "operate")):
        assert told[role]["code"] == printed[does]
    for one in told.values():
        assert one["link"] == f"{base}?code={one['code']}"
        assert RENEWED - 60 < one["expires_in"] <= RENEWED
    for role in ("viewer", "operator"):
        status, headers, body = got(f"{base}class/{role}.svg", token)
        assert (status, headers["Content-Type"], headers["Cache-Control"]) == (200, "image/svg+xml", "no-store")
        drawn = io.BytesIO()
        segno.make_qr(told[role]["link"]).save(drawn, kind="svg", scale=8, light="#fff")
        assert body == drawn.getvalue()
    assert got(f"{base}class/admin.svg", token)[0] == 404


def test_nobody_else_is_told_them(lesson):
    base, _, printed = lesson
    for token in (None, "b" * 43, printed["operate"]):
        assert json.loads(got(f"{base}class", token)[2]) == {"invitations": []}
        assert got(f"{base}class/operator.svg", token)[0] == 403


def test_the_session_that_a_code_opened_opens_the_other_doors(lesson):
    base, _, printed = lesson
    port = int(base.rsplit(":", 1)[1].strip("/"))

    async def sessions():
        found = []
        for does in ("watch", "operate"):
            pupil, _ = await Pupil.join(port, does, "operator", printed[does])
            found.append((pupil.role, pupil.session))
            await pupil.leave()
        return found

    (watches, viewer), (operates, operator) = asyncio.run(sessions())
    assert (watches, operates) == ("viewer", "operator")
    ask = {"data": json.dumps({"do": "record"}).encode(), "method": "POST"}
    for shown in (None, printed["watch"], printed["operate"]):
        assert got(f"{base}recordings", shown, **ask)[0] == 403
    assert got(f"{base}recordings", viewer, **ask)[0] == 403
    assert got(f"{base}class", operator)[0] == 200
    assert json.loads(got(f"{base}class", operator)[2]) == {"invitations": []}


def test_without_a_class_there_is_no_such_page():
    with child("serve", "--port", "0") as server:
        assert got(f"{server.url.removesuffix('view')}class")[0] == 404


def test_a_terminal_shows_new_codes_in_time():
    clock, invitations = ManualClock(0.0), Invitations(0.0)
    pages = JoinPages(invitations, Access({Role.ADMIN: ADMIN}, free=(), invitations=invitations), clock, BASE)
    text, left = pages.shown(pictures=False)
    assert left == RENEWED
    assert text.splitlines() == [
        f"vrs: to {does}: {BASE}?code={one.code}"
        for does, one in zip(("watch", "operate"), invitations.shown(now=0.0), strict=True)
    ]
    clock.advance(RENEWED)
    new, left = pages.shown(pictures=True)
    assert left == RENEWED
    assert not set(text.splitlines()) & set(new.splitlines())
    drawn = [line for line in new.splitlines() if not line.startswith("vrs")]
    assert len({len(line) for line in drawn}) == 1
    assert len(drawn[0]) <= 50, "on a narrow terminal, too"


def test_the_teacher_has_a_token(tmp_path):
    path = tmp_path / "tokens"
    path.write_text(f"operator {'t' * 43}\n")
    path.chmod(0o600)
    found = run("serve", "--class", "--token-file", str(path))
    assert found.returncode == 2
    assert "admin" in found.stderr
    assert run("serve", "--class", "--host", "0.0.0.0").returncode == 2


def test_a_link_names_an_address_of_this_machine():
    assert shown_host("127.0.0.1") == "127.0.0.1"
    assert shown_host("arm.example") == "arm.example"
    assert shown_host("0.0.0.0") not in {"", "0.0.0.0"}


def test_thirty_come_in_ask_get_and_lose_control_in_time():
    invitations = Invitations(0.0)
    code = invitations.shown(now=0.0)[1].code

    async def lesson(port):
        teacher, _ = await Pupil.join(port, "Teacher", "admin", ADMIN)
        joined = await asyncio.gather(*(Pupil.join(port, "pupil", "operator", code) for _ in range(30)))
        pupils, times = [pupil for pupil, _ in joined], [took for _, took in joined]
        await asyncio.gather(*(pupil.follow() for pupil in pupils), *(pupil.ask("who") for pupil in pupils))
        times += await asyncio.gather(*(pupil.ask("request-control") for pupil in pupils))
        waiting = sorted(pupils, key=lambda pupil: pupil.lease.get("waiting", 0))
        assert [pupil.lease.get("waiting", 0) for pupil in waiting] == list(range(30))
        for holder, following in pairwise(waiting):
            begun = time.monotonic()
            if holder.lease["member"] % 2:
                await teacher.ask("take-over")
                times.append(await holder.until(holder.has_none))
                await teacher.ask("release", epoch=teacher.lease["epoch"])
            else:
                await holder.ask("release", epoch=holder.lease["epoch"])
            await following.until(following.is_offered)
            await following.ask("acquire")
            assert following.has_control()
            times.append(time.monotonic() - begun)
            await pupils[0].until(pupils[0].sees(following))
        names = [member["name"] for member in pupils[0].present["members"]]
        assert sorted(names) == sorted(["Teacher", "pupil", *(f"pupil {k}" for k in range(2, 31))])
        ages = [age for pupil in pupils for age in pupil.ages]
        for pupil in (*pupils, teacher):
            await pupil.leave()
        return times, ages

    with served(invitations=invitations) as server:
        times, ages = asyncio.run(lesson(server.port))
    # Medians, as other tests run beside it: `benchmarks.classroom` looks at the worst.
    assert np.median(times) <= QUICKLY
    assert len(ages) > 1000
    assert np.median(ages) <= OLDEST
