"""Processes that are killed or stand still at random instants, live."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AsyncExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from websockets.sync.client import connect as dial
from websockets.typing import Subprotocol

from benchmarks.results import Result
from interfaces import connect
from interfaces.messages.control import Lease
from interfaces.recording import open_recording
from interfaces.runtime.live.physics_body import PhysicsBody
from interfaces.stream.connection import Connection
from interfaces.teleop import RobotSiteConfig
from robots.onboard.lease import LeaseState
from tests.fault_suite.effort import Effort, Tries, most
from tests.interfaces import live_rig
from tests.interfaces.live_rig import HALT, LEAD, MODEL, NOMINAL, READY, Child, Lost, Rows, until
from tests.interfaces.recording.test_killed import MISSING, Keeper
from tests.interfaces.test_link_loss import Client
from tests.interfaces.test_robot_dies import children, health, last, serving
from tests.interfaces.test_robot_dies import until as soon
from vrs import JointTarget, MotionCommand
from vrs.model import Array

BRAKE = 2 * float((MODEL.limits.qd_max / MODEL.limits.qdd_max).max())
"""How long a stop takes at most [s], on the planned path."""
IN_TIME = HALT.timeout + 0.02
"""By when the robot brakes that has lost its operator [s]."""
TOLD = 1.0
"""Who dies is told within that [s]."""
AWAY = NOMINAL + np.array([0.4, 0.1, -0.1, 0.2, 0.2, 0.2])
SITE = RobotSiteConfig(beat=0.03, watchdog=HALT)
ROBOT = "--body", "exact", "--max-age", "2", "--lead", str(LEAD)


def operator_killed(effort: Effort) -> tuple[Result, ...]:
    """The operator's site is killed in mid-motion

    `vrs serve`, through which a program lets the arm go to and fro, is killed (SIGKILL) at a random instant; the
    robot's site and its body's process are others, with T_loss of 0.5 s. What the body was asked for is looked at
    tick by tick. The site records: the file is opened after the kill.
    """
    with tempfile.TemporaryDirectory() as folder:
        losses = asyncio.run(_operators_lost(effort, signal.SIGKILL, Path(folder)))
    missing = max(missing for _, missing in losses.found)
    return *_braked(losses), most("recordings end before the kill by", missing, MISSING, "s", tries=losses.count)


def operator_stopped(effort: Effort) -> tuple[Result, ...]:
    """The operator's site stands still in mid-motion

    As above with SIGSTOP; after a second and a half it goes on (SIGCONT), with a plan that isn't done and four more
    commands that came while it stood.
    """
    return _braked(asyncio.run(_operators_lost(effort, signal.SIGSTOP, None)))


async def _operators_lost(effort: Effort, number: int, folder: Path | None) -> Tries[tuple[Lost, float]]:
    """What the robot did each time, and how much of a recording's end was missing [s]."""
    tries: Tries[tuple[Lost, float]] = Tries(effort, 0.3, 2.0)
    async with live_rig.robot_here(site=SITE) as (robot, url):
        rows = Rows(robot)
        for instant in tries:
            rows.q.clear()
            path = None if folder is None else folder / f"{time.monotonic_ns()}.mcap"
            options = () if path is None else ("--record", str(path))
            lost = await live_rig.lose_operator(robot, rows, url, instant, number, *options)
            missing = 0.0
            if path is not None:
                killed = time.time() - (robot.clock.now() - lost.at)
                with open_recording(path) as recording:
                    cut = recording.damage.cut and not recording.damage.blocks
                    missing = killed - recording.session.began - recording.span[1] if cut else np.inf
            tries.take((lost, missing), sound=lost.halted + LEAD <= IN_TIME and missing <= MISSING)
    return tries


def _braked(tries: Tries[tuple[Lost, float]]) -> tuple[Result, ...]:
    losses = [lost for lost, _ in tries.found]
    moving = sum(lost.moved for lost in losses)
    if not moving:
        raise AssertionError("the robot stood at each of these instants")
    note = f"it moved at {moving} of them" + f"; {tries.note}" * bool(tries.note)
    unsaid = sum("link loss" not in lost.said for lost in losses)
    brakes, stands = (
        1e3 * max(each) for each in zip(*((one.halted + LEAD, one.rested) for one in losses), strict=True)
    )
    return (
        most("halts for another reason than the lost link, or without one", unsaid, 0, tries=tries.count),
        most("brakes after", brakes, 1e3 * IN_TIME, "ms", tries=tries.count, note=note),
        most("stands after", stands, 1e3 * (IN_TIME + BRAKE), "ms", tries=tries.count),
        most("speeds and accelerations asked for, of the limits", max(lost.excess for lost in losses), 1.00001,
             tries=tries.count),
        most("moves by itself afterwards", max(lost.went_on for lost in losses), 0, "rad", tries=tries.count),
    )  # fmt: skip


def client_killed(effort: Effort) -> tuple[Result, ...]:
    """The program that commands is killed in mid-motion

    Both sites live; a program in a process of its own has control, and kills itself (SIGKILL) at a random instant.
    Its lease is to end after 2 s without it, and to be free once the robots rest: the body a lead (0.2 s) later.
    """
    return asyncio.run(_clients_lost(effort, signal.SIGKILL))


def client_stopped(effort: Effort) -> tuple[Result, ...]:
    """The program that commands stands still in mid-motion

    As above with SIGSTOP, and SIGCONT a second after its lease has ended: what it sends then is of an old epoch.
    """
    return asyncio.run(_clients_lost(effort, signal.SIGSTOP))


async def _clients_lost(effort: Effort, number: int) -> tuple[Result, ...]:
    tries: Tries[tuple[float, float]] = Tries(effort, 0.3, 2.0)
    async with (
        live_rig.robot_here(site=SITE) as (robot, url),
        live_rig.operator_here(url) as (operator, at),
    ):
        rows = Rows(robot)
        for instant in tries:
            rows.q.clear()
            killer = await asyncio.create_subprocess_exec(
                sys.executable, str(Path(live_rig.__file__).with_name("killer.py")), at, "0", str(instant),
                str(number), stdout=asyncio.subprocess.PIPE,
            )  # fmt: skip
            try:
                assert killer.stdout is not None
                _, when = (await killer.stdout.readline()).split()
                await until(lambda: operator.hub.lease_state is LeaseState.FREE, 30.0)
                ended = time.monotonic() - float(when)
                stood = 1e3 * (robot.clock.now() + LEAD + 0.05)
                await asyncio.sleep(1.0)
                if number == signal.SIGSTOP:
                    killer.send_signal(signal.SIGCONT)
                    await asyncio.sleep(1.5)
                await killer.wait()
            finally:
                with suppress(ProcessLookupError):
                    killer.kill()
            ticks, asked = rows.until(round(1e3 * robot.clock.now()))
            moved = float(np.ptp(asked[ticks >= stood, :6], axis=0).max())
            tries.take((ended, moved), sound=ended <= 2.0 + BRAKE + TOLD)
    ended, moved = (max(each) for each in zip(*tries.found, strict=True))
    return (
        most("the lease is free after", ended, 2.0 + BRAKE + TOLD, "s", tries=tries.count, note=tries.note),
        most("moves by itself from then on", moved, 0, "rad", tries=tries.count),
    )


def robot_killed(effort: Effort) -> tuple[Result, ...]:
    """The robot's site is killed in mid-motion

    `vrs robot` is killed at a random instant while it follows, and started again at the same address. It's to be
    missed, to stand where it begins until somebody resumes, and to follow again then.
    """
    tries: Tries[tuple[float, float, bool, bool]] = Tries(effort)

    async def session() -> None:
        async with AsyncExitStack() as robots:
            robot = await robots.enter_async_context(
                live_rig.child_beside("robot", "--listen", "127.0.0.1:0", *ROBOT)
            )
            address = f"127.0.0.1:{robot.url.split(':')[2].split('/')[0]}"
            _, at = await robots.enter_async_context(live_rig.operator_here(robot.url))
            for instant in tries:
                client = await asyncio.to_thread(_move_on, at, instant)
                robot.kill()
                died = time.monotonic()
                await asyncio.to_thread(client.wait, lambda r: not r.state.connected, 10.0)
                missed = time.monotonic() - died
                robot.process.wait()
                robot = await robots.enter_async_context(
                    live_rig.child_beside("robot", "--listen", address, *ROBOT)
                )
                tries.take((missed, *await asyncio.to_thread(_waits, client, robot)), sound=missed <= TOLD)
                await asyncio.to_thread(client.close)

    asyncio.run(session())
    missed, drifts, taken, deaf = zip(*tries.found, strict=True)
    return (
        most("it's missed after", max(missed), TOLD, "s", tries=tries.count, note=tries.note),
        most("moves before somebody resumes", max(drifts), 0, "rad", tries=tries.count),
        most("takes an order before that", sum(taken), 0, tries=tries.count),
        most("doesn't follow again", sum(deaf), 0, tries=tries.count),
    )


def _move_on(at: str, wait: float) -> Connection:
    """A client with control, while the robot moves."""
    client = connect(at)
    end = time.monotonic() + 30.0
    # Whoever had control before may still be on the way to rest.
    while not isinstance(client.acquire(), Lease):
        assert time.monotonic() < end
        time.sleep(0.1)
    assert client.wait(lambda r: r.state is not None and not r.state.halted and r.state.connected, 30.0)
    for q in (READY, AWAY, NOMINAL):
        client.designer.issue(MotionCommand(JointTarget(q)), wait=5.0)
    time.sleep(wait)
    return client


def _waits(client: Connection, robot: Child) -> tuple[float, bool, bool]:
    """How far a robot that was started anew moves before it's resumed [rad], whether it takes an order before that,
    and whether it doesn't follow afterwards."""
    assert client.wait(lambda r: r.state.connected and r.state.halted != "", 30.0)
    stood = np.array(robot.wait(lambda facts: facts.get("q") is not None)["q"])
    receipt = client.designer.issue(MotionCommand(JointTarget(AWAY)), wait=5.0).receipt
    assert receipt is not None
    time.sleep(1.0)
    drift = float(np.abs(np.array(robot.health()["q"]) - stood).max())
    end = time.monotonic() + 30.0
    while not isinstance(client.resume(), Lease) and time.monotonic() < end:
        time.sleep(0.1)
    client.designer.issue(MotionCommand(JointTarget(AWAY)), wait=5.0)
    try:
        robot.wait(lambda facts: np.abs(np.array(facts["q"]) - AWAY).max() <= 1e-6, 20.0)
    except TimeoutError:
        return drift, receipt.stands, True
    return drift, receipt.stands, False


def robot_stopped(effort: Effort) -> tuple[Result, ...]:
    """The robot's site stands still in mid-motion

    `vrs robot` is stopped (SIGSTOP) at a random instant for a second and a half, while more commands come, and goes
    on.
    """
    tries: Tries[tuple[bool, float]] = Tries(effort)
    with live_rig.child("robot", "--listen", "127.0.0.1:0", *ROBOT) as robot:
        address = robot.url.removeprefix("ws://").removesuffix("/site")
        with live_rig.child("serve", "--port", "0", "--robot-at", address) as server:
            for instant in tries:
                with _move_on(server.url.replace("http", "ws").replace("/view", "/ws"), instant) as client:
                    robot.kill(signal.SIGSTOP)
                    for q in (READY, NOMINAL, AWAY):
                        client.designer.issue(MotionCommand(JointTarget(q)))
                        time.sleep(0.5)
                    robot.kill(signal.SIGCONT)
                    try:
                        robot.wait(lambda facts: facts["halted"] and facts["rests"], 10.0)
                    except TimeoutError:
                        tries.take((True, 0.0), sound=False)
                        continue
                    stood = np.array(robot.health()["q"])
                    time.sleep(1.5)
                    tries.take((False, float(np.abs(np.array(robot.health()["q"]) - stood).max())), sound=True)
    went_on, drifts = zip(*tries.found, strict=True)
    return (
        most("goes on without halting", sum(went_on), 0, tries=tries.count, note=tries.note),
        most("moves by itself afterwards", max(drifts), 0, "rad", tries=tries.count),
    )


def body_killed(effort: Effort) -> tuple[Result, ...]:
    """A process of the robot that `vrs serve` has is killed

    In turns its site's and its body's, at a random instant while the arm moves. It's to be told on standard error,
    by `/health` and to every page, and an order is to be refused.
    """
    tries: Tries[tuple[float, float, bool, bool]] = Tries(effort)
    for instant in tries:
        with serving("--body", "exact") as (process, url), _page(url) as page:
            page.until(lambda m: m["type"] == "state" and not m.get("halted") and m.get("connected", True))
            page.order(**_to(AWAY))
            time.sleep(instant)
            os.kill(last(process.pid) if len(tries.found) % 2 else children(process.pid)[0], signal.SIGKILL)
            died = time.monotonic()
            page.until(lambda m: m["type"] == "state" and "has ended" in m.get("halted", ""))
            told = time.monotonic() - died
            soon(lambda url=url: health(url)[0] == 503)
            healthy = time.monotonic() - died
            page.order(**_to(READY))
            outcome = page.until(lambda m, page=page: m["type"] == "outcome" and m["number"] == page.orders)
            why = outcome.get("refusal", "") + (outcome.get("receipt") or {}).get("reason", "")
            process.terminate()
            unsaid = "has ended" not in process.communicate(timeout=15)[1]
            tries.take((told, healthy, unsaid, "has ended" not in why), sound=max(told, healthy) <= TOLD)
    told, healthy, unsaid, taken = zip(*tries.found, strict=True)
    return (
        most("every page knows after", max(told), TOLD, "s", tries=tries.count, note=tries.note),
        most("/health fails after", max(healthy), TOLD, "s", tries=tries.count),
        most("not said on standard error", sum(unsaid), 0, tries=tries.count),
        most("takes an order afterwards", sum(taken), 0, tries=tries.count),
    )


@contextmanager
def _page(url: str) -> Iterator[Client]:
    """Somebody with control over a server, who knows the wire alone."""
    with dial(url.replace("http", "ws") + "/ws", subprotocols=[Subprotocol("vrs.1.json")]) as socket:
        yield Client(socket)


def _to(q: Array) -> dict[str, Any]:
    return {"type": "move", "target": {"type": "joints", "q": q.tolist()}}


SILENT = 0.22
"""A body's process that says nothing is missed after that [s]."""


def body_stopped(effort: Effort) -> tuple[Result, ...]:
    """The body's process stands still in mid-motion

    The process of the physics is stopped for more than a second at a random instant, and goes on. The robot's site
    is to halt and to say why, and nothing moves before somebody resumes.
    """
    tries: Tries[tuple[float, float]] = Tries(effort, 0.2, 1.2)

    async def session() -> None:
        async with (
            live_rig.robot_here(site=SITE) as (robot, url),
            live_rig.operator_here(url) as (_, at),
        ):
            assert isinstance(robot.body, PhysicsBody)
            assert robot.body.physics is not None
            for instant in tries:
                client = await asyncio.to_thread(_move_on, at, instant)
                os.kill(robot.body.physics.pid, signal.SIGSTOP)
                begun = time.monotonic()
                try:
                    await until(lambda: robot.host.site is not None and robot.host.site.halted, 5.0)
                    halted = time.monotonic() - begun
                    await asyncio.sleep(1.0)
                finally:
                    os.kill(robot.body.physics.pid, signal.SIGCONT)
                await asyncio.sleep(1.0 + BRAKE)
                seen = []
                for _ in range(50):
                    await asyncio.sleep(0.01)
                    seen.append(robot.body.q.copy())
                tries.take((halted, float(np.ptp(np.array(seen), axis=0).max())), sound=halted <= SILENT + 0.02)
                await asyncio.to_thread(client.close)

    asyncio.run(session())
    halted, moved = (max(each) for each in zip(*tries.found, strict=True))
    return (
        most("halts after", halted, SILENT + 0.02, "s", tries=tries.count, note=tries.note),
        most("moves by itself afterwards", moved, 1e-9, "rad", tries=tries.count),
    )


def camera_killed(effort: Effort) -> tuple[Result, ...]:
    """The camera's process is killed

    `vrs serve --robot ipr` with somebody who looks: the process that draws is killed at a random instant. It's to
    be told, there are pictures again soon, and the robot takes orders meanwhile.
    """
    tries: Tries[tuple[float, float, bool]] = Tries(effort)
    with serving("--robot", "ipr") as (process, url):
        for instant in tries:
            assert soon(lambda: _picture(url))
            end = time.monotonic() + instant
            while time.monotonic() < end:
                _picture(url)
            os.kill(_camera(process.pid), signal.SIGKILL)
            died = time.monotonic()
            with ThreadPoolExecutor(1) as looking:
                picture = looking.submit(soon, lambda: _picture(url))
                soon(lambda: "gives no pictures" in str(health(url)[1]))
                told = time.monotonic() - died
                with _page(url) as page:
                    page.until(
                        lambda m: m["type"] == "postures" and not m.get("halted") and m.get("connected", True)
                    )
                    page.order(type="drive", v=0.1, w=0.0, duration=0.1)
                    outcome = page.until(lambda m: m["type"] == "outcome")
                picture.result()
            refused = bool(outcome.get("refusal")) or (outcome.get("receipt") or {}).get("status") == "rejected"
            tries.take((told, time.monotonic() - died, refused), sound=told <= TOLD)
    told, back, refused = zip(*tries.found, strict=True)
    return (
        most("/health says it after", max(told), TOLD, "s", tries=tries.count, note=tries.note),
        most("there are pictures again after", max(back), 10.0, "s", tries=tries.count),
        most("takes no order meanwhile", sum(refused), 0, tries=tries.count),
    )


def _picture(url: str) -> bool:
    """Look through the camera; whether there was a picture."""
    try:
        with urllib.request.urlopen(f"{url}/media/still", timeout=10) as answer:
            return bool(answer.read())
    except (urllib.error.HTTPError, TimeoutError):
        return False


def _camera(pid: int) -> int:
    """The process that draws for a server."""
    return next(one for one in children(pid) if b"camera_process" in Path(f"/proc/{one}/cmdline").read_bytes())


def recorder_killed(effort: Effort) -> tuple[Result, ...]:
    """A recorder is killed

    A process that records 60 samples a second is killed at a random instant within 1.2 s. What it had acknowledged
    is to be there, to the bit, and the file is to say that it was cut.
    """
    tries: Tries[float] = Tries(effort)
    with tempfile.TemporaryDirectory() as folder, Keeper() as keeper:
        for instant in tries:
            missing = keeper.killed(Path(folder) / f"{time.monotonic_ns()}.mcap", instant)
            tries.take(missing, sound=missing <= MISSING)
    return (most("of its end is missing", max(tries.found), MISSING, "s", tries=tries.count, note=tries.note),)
