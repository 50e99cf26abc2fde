"""How the recordings of this suite were made: `python -m tests.contract.recordings` makes them anew.

They are older than the code that reads them now, and that is their use: make them anew only where their format is
to change on purpose.
"""

from __future__ import annotations

import asyncio
import shutil
import tempfile
from pathlib import Path
from typing import Any, Final

from tests.contract.doors import DATA, VRS, directory, run, served
from tests.contract.session import ordering
from tests.contract.talk import talking

RECORDINGS: Final = DATA / "recordings"
CUT: Final = 130_000
"""Bytes of the live recording that the cut one has: its writer was killed there."""
MADE: Final = {
    "demo": "demo --commands data/plan.jsonl --delay wed --seed 3",
    "val2": "run data/programs/motions.v2 --delay thu --seed 2",
    "mobile": "lab --architecture timeline --operator slalom --runs 1 --length 4 --workers 1 --record --out out",
}


async def command(address: str) -> None:
    """Move a live arm for some ten seconds: several kinds of commands, and steering."""
    async with talking(address, "operator") as operator:
        await operator.wait("state", lambda state: state.get("connected", True))
        lease = await operator.ask({"type": "acquire", "number": 1}, "lease", "answers")
        await operator.wait("state", lambda state: not state.get("halted"), after=len(operator.came))
        async with operator.beating(lease["epoch"]):
            order = ordering(operator, lease["epoch"])

            def move(*degrees: float, **more: Any) -> dict[str, Any]:
                q = [round(angle * 0.017453292519943295, 6) for angle in degrees]
                return {"type": "move", "target": {"type": "joints", "q": q}, **more}

            await order(move(30, 50, -170, 0, 30, 0, speed=0.6))
            await asyncio.sleep(0.5)
            await order(move(-10, 60, -150, 10, 40, 20, profile="jerk-limited"))
            await order(move(10, 45, -150, 0, 40, 0, insertion="append", speed=0.5))
            await asyncio.sleep(2.0)
            await order({"type": "scale", "factor": 0.8})
            await order(None)
            await asyncio.sleep(1.0)
            await order({"type": "stop"})
            await asyncio.sleep(0.5)
            await order({"type": "resume"})
            for _ in range(20):
                await order({"type": "steer", "rates": [0.3, 0, 0, 0, 0, 0.1]})
                await asyncio.sleep(0.05)
            await asyncio.sleep(4.0)
            await operator.ask({"type": "release", "number": 2, "epoch": lease["epoch"]}, "lease", "answers")
        await asyncio.sleep(1.0)


def make() -> None:
    """Make all five."""
    RECORDINGS.mkdir(exist_ok=True)
    for name, line in MADE.items():
        with tempfile.TemporaryDirectory() as place:
            here = directory(Path(place))
            done = run(VRS, *line.split(), cwd=here)
            assert done.status == 0, done.errors
            [made] = (path for path in here.rglob("*.mcap") if "data" not in path.relative_to(here).parts)
            shutil.copyfile(made, RECORDINGS / f"{name}.mcap")
    with tempfile.TemporaryDirectory() as place:
        here = directory(Path(place))
        live = ("serve", "--port", "0", "--delay", "wed", "--seed", "4", "--record", "live.mcap", "--until-eof")
        with served(*live, cwd=here) as serving:
            asyncio.run(command(serving.address))
        data = (here / "live.mcap").read_bytes()
    (RECORDINGS / "live.mcap").write_bytes(data)
    (RECORDINGS / "cut.mcap").write_bytes(data[:CUT])


if __name__ == "__main__":
    make()
