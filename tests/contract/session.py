"""Scripted sessions against servers: an arm's, a base's, and a robot's own site; and what they say, as a document.

`python -m tests.contract.session` prints what the sessions of `wire.json` find today.
"""

from __future__ import annotations

import asyncio
import contextlib
import tempfile
from collections import defaultdict
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from tests.contract.doors import directory, served
from tests.contract.shapes import Shape, shape
from tests.contract.talk import Talk, talking

NOMINAL = [0.0, 0.7854, -3.1416, 0.0, 0.7854, 0.0]
"""Where the PUMA begins, roughly [rad]."""
POSE = [[0.0, 0.0, 1.0, 0.45], [0.0, -1.0, 0.0, -0.15], [1.0, 0.0, 0.0, 0.2], [0.0, 0.0, 0.0, 1.0]]
RARE: dict[str, Shape] = {
    "pulse": {"past": ["absent", "null", "number"]},
    "state": {
        "late": ["absent", "array"],
        "late[]": ["array"],
        "late[][]": ["array", "number"],
        "late[][][]": ["number"],
        "connected": ["absent", "boolean"],
        "epoch": ["absent", "text"],
        "halted": ["absent", "text"],
        "reference": ["absent", "array"],
        "reference[]": ["number"],
    },
    "broadcast": {"falsified": ["absent", "array"], "falsified[]": ["array"], "falsified[][]": ["integer", "null"]},
    "postures": {
        "connected": ["absent", "boolean"],
        "starved": ["absent", "boolean"],
        "halted": ["absent", "text"],
        **{name: ["absent", "number"] for name in ("D", "path_error", "time_difference", "round_trip")},
    },
    "tasks": {
        "goal": ["absent", "map"],
        "goal.x": ["number"],
        "goal.y": ["number"],
        "goal.heading": ["absent", "number"],
        "route": ["absent", "array"],
        "route[]": ["array"],
        "route[][]": ["number"],
        "left": ["absent", "number"],
        **{name: ["absent", "text"] for name in ("doing", "journey", "reason", "loss", "shows", "says", "problem")},
    },
}
"""Fields of docs/protocol.md that a short session may miss: whether they come hangs on the time."""
WRONG_FOR_ALL: tuple[dict[str, Any], ...] = (
    {"type": "nonsense", "number": 1},
    {"number": 1},
    {"type": "ping", "number": 1},
    {"type": "ping", "number": 1, "t": 1e13},
    {"type": "ping", "number": 0, "t": 1.0},
    {"type": "ping", "number": 1, "t": "now"},
    {"type": "hello", "protocol": 1, "role": "viewer", "name": "twice"},
    {"type": "welcome"},
    {"type": "release", "number": 1, "epoch": "12"},
    {"type": "resume", "number": 1, "epoch": "12"},
    {"type": "beat", "epoch": "012"},
    {"type": "beat", "epoch": 12},
    {"type": "share", "number": 1, "session": "nobody"},
    {"type": "take-over", "number": 1},
    {"type": "impair", "number": 1, "epoch": "12", "forward": {"delay": "mon"}},
    {"type": "impair", "number": 1, "epoch": "12", "forward": {"delay": "sunday"}},
)
"""Messages that are refused of any robot; `impair` of somebody without the lease."""
WRONG_FOR_ARMS: tuple[dict[str, Any], ...] = (
    {"type": "follow", "number": 1, "form": "pictures", "rate": 30.0},
    {"type": "follow", "number": 1, "form": "frames", "rate": 0.0},
    {"type": "want", "edit": -1},
    {"type": "ask", "number": 1, "t": 1e10},
    {"type": "acquire", "number": 0},
)
WRONG_FOR_BASES: tuple[dict[str, Any], ...] = (
    {"type": "task", "number": 1, "epoch": "12", "task": {"go": {"x": 1e4, "y": 1.0}}},
    {"type": "task", "number": 1, "epoch": "12", "task": {"do": "dance"}},
    {"type": "task", "number": 1, "epoch": "12", "task": {}},
    {
        "type": "task",
        "number": 1,
        "epoch": "12",
        "task": {"jobs": {"jobs": [{"number": 1, "do": "move", "to": "nowhere"}]}},
    },
    {
        "type": "order",
        "number": 1,
        "epoch": "12",
        "command": {"type": "drive", "v": 1e10, "w": 0.0, "duration": 1.0},
    },
    {
        "type": "order",
        "number": 1,
        "epoch": "12",
        "command": {"type": "drive", "v": 0.1, "w": 0.0, "duration": 0.0},
    },
    {"type": "follow", "number": 1, "form": "segments"},
    {"type": "ask", "number": 2, "t": 1.0},
)
WRONG_ORDERS: tuple[dict[str, Any], ...] = (
    {"type": "move", "target": {"type": "joints", "q": NOMINAL}, "speed": 2.0},
    {"type": "move", "target": {"type": "joints", "q": NOMINAL}, "speed": 5e-324},
    {"type": "move", "target": {"type": "joints", "q": [1e18] * 6}},
    {"type": "move", "target": {"type": "place", "q": NOMINAL}},
    {"type": "move", "target": {"type": "joints", "q": NOMINAL}, "motion": "leap"},
    {"type": "steer", "rates": NOMINAL, "twist": NOMINAL},
    {"type": "scale", "factor": 0.0},
    {"type": "dance"},
)
"""Commands that can't be read, whoever sends them."""


def ordering(
    talk: Talk, epoch: str, first: int = 1
) -> Callable[[dict[str, Any] | None], Awaitable[dict[str, Any]]]:
    """Make what sends commands as orders, numbered from one on, and waits for their outcomes."""
    number = first - 1

    async def order(command: dict[str, Any] | None) -> dict[str, Any]:
        nonlocal number
        number += 1
        return await talk.ask({"type": "order", "number": number, "epoch": epoch, "command": command}, "outcome")

    return order


async def refusals(talk: Talk, messages: tuple[dict[str, Any], ...]) -> list[dict[str, Any]]:
    """Send messages that are wrong, each answered by a problem; more than 20 would close the connection."""
    found = []
    for message in messages:
        before = await talk.send(message)
        found.append({"sent": message, **problem_of(await talk.wait("problem", after=before))})
    return found


def problem_of(problem: dict[str, Any]) -> dict[str, Any]:
    """What of a problem is the protocol's; its text is for people."""
    return {key: problem.get(key) for key in ("code", "number", "fatal")}


async def hello_refused(address: str, **hello: Any) -> dict[str, Any]:
    """What becomes of a hello that's wrong."""
    async with talking(address, **{"role": "viewer", **hello}) as talk:
        return {"sent": hello, **problem_of(await talk.wait("problem"))}


def told(outcome: dict[str, Any]) -> list[Any]:
    """What of an outcome doesn't hang on the time: its type, code or status, and why it was refused."""
    receipt = outcome.get("receipt") or {}
    refusal = outcome.get("refusal", "").split("; given")[0]
    return [outcome["type"], outcome.get("code", receipt.get("status")), refusal]


async def command_an_arm(address: str, tokens: dict[str, str]) -> dict[str, Any]:
    """Go through all that an arm's server knows."""
    outcomes: dict[str, Any] = {}
    kinds: defaultdict[str, list[dict[str, Any]]] = defaultdict(list)
    async with (
        talking(address, "operator", token=tokens["operator"]) as operator,
        talking(address, "viewer", text=True, token=tokens["viewer"]) as viewer,
        talking(address, "viewer", token=tokens["viewer"]) as reader,
        contextlib.AsyncExitStack() as holding,
    ):
        await operator.wait("state", lambda state: state.get("connected", True))
        session = (await operator.wait("welcome"))["session"]
        await operator.ask({"type": "ping", "number": 1, "t": 5.5}, "pong")
        await operator.ask({"type": "survey", "number": 2}, "network", "answers")
        lease = await operator.ask({"type": "acquire", "number": 3}, "lease", "answers")
        epoch = lease["epoch"]
        await operator.wait("state", lambda state: not state.get("halted"))
        await holding.enter_async_context(operator.beating(epoch))

        await viewer.send({"type": "follow", "number": 1, "form": "frames", "rate": 30.0})
        await viewer.wait("broadcast")
        scene = await _scene(reader)
        await reader.send({"type": "want", "edit": scene["edit"], "index": 0})
        await reader.send({"type": "want", "edit": scene["edit"]})
        await reader.wait("pulse")

        order = ordering(operator, epoch)
        for name, command in _commands().items():
            outcomes[name] = told(await order(command))
        await reader.wait("change")
        scene = await _scene(reader, number=2)
        before = await reader.send({"type": "want", "edit": scene["edit"], "index": 0})
        await reader.wait("history", after=before)
        await viewer.ask({"type": "ask", "number": 1}, "answer")
        await viewer.ask({"type": "ask", "number": 2, "t": 0.5}, "answer")
        impair = {"type": "impair", "number": 4, "epoch": epoch, "forward": {"delay": "constant:0.01", "loss": "0"}}
        await viewer.ask({"type": "survey", "number": 3}, "network", "answers")
        before = len(viewer.came)
        await operator.ask(impair, "network", "answers")
        await viewer.wait("network", after=before)
        async with talking(address, "operator", text=True, token=tokens["operator"]) as second:
            await second.wait("welcome")
            outcomes["acquire what is held"] = told(
                await second.ask({"type": "acquire", "number": 1}, "lease", "answers")
            )
            share = await second.ask({"type": "share", "number": 2, "session": session}, "lease", "answers")
            outcomes["shared"] = share.get("shared")
            outcomes["stale"] = told(await ordering(second, "12")(_commands()["stop"]))
            kinds["operator"] += second.came
        outcomes["a viewer's order"] = told(await ordering(viewer, epoch)(_commands()["stop"]))
        outcomes["a viewer acquires"] = told(await viewer.ask({"type": "acquire", "number": 9}, "lease", "answers"))
        async with talking(address, "admin", token=tokens["admin"]) as admin:
            await admin.wait("welcome")
            await holding.aclose()
            await admin.ask({"type": "take-over", "number": 1}, "lease", "answers")
            yours = await admin.wait("lease", lambda lease: lease.get("yours"))
            await operator.wait("lease", lambda lease: lease.get("ended") == "taken over")
            outcomes["after the take-over"] = told(await ordering(operator, epoch, 100)(_commands()["stop"]))
            released = {"type": "release", "number": 2, "epoch": yours["epoch"]}
            await admin.ask(released, "lease", "answers")
            kinds["admin"] += admin.came
        kinds["operator"] += operator.came
        kinds["viewer"] += [*viewer.came, *reader.came]
    async with talking(address, "operator", token=tokens["operator"]) as wrong:
        await wrong.wait("welcome")
        found = await refusals(wrong, WRONG_FOR_ALL)
    async with talking(address, "operator", token=tokens["operator"]) as wrong:
        await wrong.wait("welcome")
        orders = ({"type": "order", "number": 1, "epoch": "12", "command": command} for command in WRONG_ORDERS)
        found += await refusals(wrong, tuple(orders))
    async with talking(address, "viewer", text=True, token=tokens["viewer"]) as wrong:
        await wrong.wait("welcome")
        found += await refusals(wrong, WRONG_FOR_ARMS)
    found += [
        await hello_refused(address, role="boss"),
        await hello_refused(address, role="admin"),
        await hello_refused(address, role="admin", token="wrong"),
        await hello_refused(address, protocol=0),
        await hello_refused(address, name=""),
    ]
    return {"shapes": _shapes(kinds), "outcomes": outcomes, "refusals": found}


async def _scene(reader: Talk, number: int = 1) -> dict[str, Any]:
    """Follow segments anew."""
    before = await reader.send({"type": "follow", "number": number, "form": "segments"})
    return await reader.wait("scene", lambda scene: scene["number"] == number, after=before)


def _commands() -> dict[str, dict[str, Any] | None]:
    """A command of each kind, in an order in which each has something to do."""
    move = {"type": "move", "target": {"type": "joints", "q": [0.3, *NOMINAL[1:]]}}
    return {
        "move": move,
        "appended": {**move, "target": {"type": "joints", "q": NOMINAL}, "insertion": "append", "speed": 0.02},
        "to a pose": {
            **move,
            "target": {"type": "pose", "X": POSE},
            "insertion": "append",
            "profile": "jerk-limited",
        },
        "undo": None,
        "redo": {"type": "redo"},
        "undo what was redone": None,
        "to a pose again": {
            **move,
            "target": {"type": "pose", "X": POSE},
            "insertion": "append",
            "profile": "jerk-limited",
        },
        "too far": {**move, "target": {"type": "pose", "X": [[*row[:3], 5.0] for row in POSE[:3]] + [POSE[3]]}},
        "beyond a limit": {**move, "target": {"type": "joints", "q": [9.0, *NOMINAL[1:]]}},
        "before it was issued": {**move, "issued_at": 2.0, "execute_at": 1.0},
        "via": {
            "type": "via",
            "command_id": 2,
            "target": {"type": "joints", "q": [0.1, *NOMINAL[1:]]},
            "deviation": 0.01,
        },
        "scale": {"type": "scale", "factor": 0.9},
        "retime": {"type": "retime", "command_id": 4, "execute_at": 90.0},
        "retime what isn't there": {"type": "retime", "command_id": 99, "execute_at": 60.0},
        "cancel": {"type": "cancel", "command_id": 4},
        "parameter": {"type": "parameter", "name": "nothing", "value": 1},
        "query": {"type": "query", "t": 1.0},
        "drive": {"type": "drive", "v": 0.1, "w": 0.0, "duration": 1.0},
        "stop": {"type": "stop"},
        "resume": {"type": "resume"},
        "stop again": {"type": "stop"},
        "steer by an old input": {"type": "steer", "rates": [0.1, 0, 0, 0, 0, 0], "issued_at": 0.0},
        "steer by a twist": {"type": "steer", "twist": [0, 0.05, 0, 0, 0, 0], "frame": "tool"},
        "redo what isn't there": {"type": "redo"},
    }


async def command_a_base(address: str) -> dict[str, Any]:
    """Go through what a mobile robot's server knows beside."""
    outcomes: dict[str, Any] = {}
    kinds: defaultdict[str, list[dict[str, Any]]] = defaultdict(list)
    async with (
        talking(address, "operator", text=True) as operator,
        talking(address, "viewer") as viewer,
        contextlib.AsyncExitStack() as holding,
    ):
        await operator.wait("postures", lambda postures: postures.get("connected", True) and postures.get("real"))
        lease = await operator.ask({"type": "acquire", "number": 1}, "lease", "answers")
        epoch = lease["epoch"]
        await operator.wait("postures", lambda postures: not postures.get("halted"), after=len(operator.came))
        await holding.enter_async_context(operator.beating(epoch))
        order = ordering(operator, epoch)
        drive = {"type": "drive", "v": 0.2, "w": 0.1, "duration": 0.3}
        outcomes["drive"] = told(await order(drive))
        outcomes["drive at a time"] = told(await order({**drive, "execute_at": 1.0}))
        outcomes["an arm's command"] = told(await order({"type": "scale", "factor": 0.5}))
        await operator.wait("postures", lambda postures: any(postures["command"]))
        outcomes["stop"] = told(await order({"type": "stop"}))
        await operator.wait("postures", lambda postures: not any(postures["command"]), after=len(operator.came))

        async def task(number: int, **task: Any) -> None:
            asked = {"type": "task", "number": number, "epoch": epoch, "task": task}
            answer = await operator.ask(asked, "tasks", "answers")
            outcomes[f"task {next(iter(task))} {number}"] = told(answer)

        jobs = [
            {"number": 1, "do": "voice", "text": "Hello"},
            {"number": 2, "do": "wait", "seconds": 0.2},
            {"number": 3, "do": "message", "text": "Look"},
            {"number": 4, "do": "move", "to": "B"},
        ]
        await task(2, jobs={"jobs": jobs, "places": {"B": {"x": 1.0, "y": 1.0, "heading": 0.5}}})
        await task(3, do="dry-run")
        await operator.wait("tasks", lambda tasks: tasks.get("forecast"))
        await task(4, do="run")
        await operator.wait(
            "tasks", lambda tasks: tasks.get("progress", {}).get("jobs", [{}])[0].get("stage") == "done"
        )
        await task(5, do="pause")
        await task(6, do="abort")
        await task(7, go={"x": 900.0, "y": 1.0})
        await operator.wait("seen")
        await viewer.wait("plan")
        await holding.aclose()
        await operator.ask({"type": "release", "number": 11, "epoch": epoch}, "lease", "answers")
        kinds["operator"] += operator.came
        kinds["viewer"] += viewer.came
    async with talking(address, "operator", text=True) as wrong:
        await wrong.wait("mobile-welcome")
        found = await refusals(wrong, WRONG_FOR_BASES)
    return {"shapes": _shapes(kinds), "outcomes": outcomes, "refusals": found}


async def be_a_site(address: str) -> dict[str, Any]:
    """Speak to a robot as an operator's site does, without a command."""
    async with talking(address, "site", path="site", session="contract", link_loss="hold") as site:
        attached = await site.wait("attached")
        for number in range(1, 4):
            orders = {
                "type": "orders", "epoch": "7", "number": number, "sent_at": 0.05 * number, "newest": 0,
                "complete_until": 0.05 * number, "epoch_began": 0.0, "entries": [],
            }  # fmt: skip
            await site.send(orders)
            await site.wait("report", after=len(site.came))
        await site.wait("report", lambda report: report.get("samples"))
        said = {
            key: attached.get(key) for key in ("protocol", "robot", "link_loss", "timeout", "offset", "max_age")
        }
        return {"shapes": _shapes({"site": site.came}), "attached": said}


def _shapes(kinds: dict[str, list[dict[str, Any]]]) -> dict[str, Any]:
    """The shape of each kind of message that each role was told."""
    found: dict[str, Any] = {}
    for role, messages in kinds.items():
        by_type: defaultdict[str, list[dict[str, Any]]] = defaultdict(list)
        for message in messages:
            by_type[message["type"]].append(message)
        found[role] = {kind: shape(those) for kind, those in sorted(by_type.items())}
    return found


def sessions(place: Path) -> dict[str, Any]:
    """Hold all three sessions, each with a server of its own."""
    found = {}
    directory(place)
    tokens = {"viewer": "v" * 43, "operator": "o" * 43, "admin": "a" * 43}
    kept = place / "tokens"
    kept.write_text("".join(f"{role} {token}\n" for role, token in tokens.items()))
    kept.chmod(0o600)
    with served(
        "serve", "--port", "0", "--token-file", "tokens", "--body", "exact", "--until-eof", cwd=place
    ) as arm:
        found["arm"] = asyncio.run(command_an_arm(arm.address, tokens))
    base = ("serve", "--port", "0", "--robot", "ipr", "--room", "home", "--camera", "0", "--until-eof")
    with served(*base, cwd=place) as mobile:
        found["base"] = asyncio.run(command_a_base(mobile.address))
    with served("robot", "--listen", "127.0.0.1:0", "--body", "exact", "--until-eof", cwd=place) as robot:
        found["site"] = asyncio.run(be_a_site(robot.address))
    return found


if __name__ == "__main__":
    import json

    with tempfile.TemporaryDirectory() as place:
        print(json.dumps(sessions(Path(place)), indent=1, sort_keys=True))  # noqa: T201
