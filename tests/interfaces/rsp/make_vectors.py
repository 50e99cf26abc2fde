"""Golden vectors of RSP, for implementations in any language.

`python -m tests.interfaces.rsp.make_vectors` writes vectors.json anew.
"""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import Any

from interfaces.rsp.local import LocalCore
from interfaces.rsp.model import RobotModel, example, write_model
from interfaces.rsp.robot import RobotCore
from interfaces.rsp.session import Keyring, Rank

PATH = Path(__file__).with_name("vectors.json")
SECRET = bytes(range(32))
MODEL: RobotModel = example("rover", 0x0102)


def conversation(*, sealed: bool) -> list[dict[str, Any]]:
    """Every datagram of a short session on a perfect link: what each side was told before it was sent, and its
    hex."""
    random = Random(6)
    keys = Keyring({Rank.OPERATOR: SECRET}) if sealed else None
    local, robot = LocalCore(MODEL, random.randbytes, keys=keys), RobotCore(MODEL, random.randbytes, keys=keys)
    found: list[dict[str, Any]] = []
    said = {
        0.1: "write left_wheel 100; request sensing; the robot measures position 1, -2, 3",
        0.16: "command ir_fire 7; store program 'abc'; the robot stores log 'hello' and bumper occurs with 1",
        0.3: "end",
    }
    now = 0.0
    local.open(now=now)
    for step in range(20):
        now = round(0.02 * step, 6)
        what = said.get(now, "")
        if now == 0.1:
            local.write(MODEL.index("left_wheel"), (100).to_bytes(2, "big"))
            local.request(MODEL.index("sensing"), True)
            values = (n.to_bytes(4, "big", signed=True) for n in (1, -2, 3))
            robot.measure(MODEL.index("position"), b"".join(values))
        elif now == 0.16:
            local.command(MODEL.index("ir_fire"), b"\7")
            local.store(MODEL.index("program"), b"abc", deadline=9.0)
            robot.store(MODEL.index("log"), b"hello", deadline=9.0)
            robot.occur(MODEL.index("bumper"), b"\1")
        elif now == 0.3:
            local.end(now=now)
        for data in local.to_send(now=now):
            robot.receive(data, b"address", now=now)
            found.append({"t": now, "to": "robot", "said": what, "hex": data.hex()})
        robot.effectors(now=now)
        for data, _ in robot.to_send(now=now):
            local.receive(data, now=now)
            found.append({"t": now, "to": "local", "said": what, "hex": data.hex()})
    assert not any(local.dropped.values())
    assert not any(robot.dropped.values())
    return found


def made() -> dict[str, Any]:
    """All of it."""
    return {
        "schema": "vrs-rsp-vectors/1",
        "model": write_model(MODEL).decode(),
        "secret": SECRET.hex(),
        "open": conversation(sealed=False),
        "sealed": conversation(sealed=True),
    }


if __name__ == "__main__":
    PATH.write_text(json.dumps(made(), indent=1) + "\n", encoding="utf-8")
