"""What the camera costs the robot's body: its control periods while nobody looks and while somebody does, in turn.

Each turn runs `vrs serve` with a robot of its own, which stands in a furnished room. Who looks is an aiortc
receiver in this process; it decodes every picture.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
import time
import urllib.request
from collections.abc import AsyncIterator
from typing import Any

from websockets.asyncio.client import connect

SECONDS = 30.0
"""A turn; the robot counts its control periods over the last minute."""
TURNS = 3
_COMMAND = ("-m", "interfaces.cli", "serve", "--robot", "ipr", "--room", "furnished", "--port", "0", "--until-eof")


def main() -> None:
    """Print a table."""
    print(
        f"{'':14}{'pictures/s':>11}{'periods':>9}{'skipped':>9}{'late p99':>10}{'took':>10}{'took p99':>10}  [ms]"
    )
    for _ in range(TURNS):
        for looks in (False, True):
            print(asyncio.run(turn(looks)), flush=True)


async def turn(looks: bool) -> str:
    """One run, as a row of the table."""
    async with served() as url:
        robot = await robot_of(url)
        before = health(robot)["ticks"]
        rate = await watched(url) if looks else await asyncio.sleep(SECONDS, 0.0)
        ticks = health(robot)["ticks"]
    counts = "".join(f"{ticks[key] - before[key]:>9}" for key in ("run", "skipped"))
    figures = "".join(f"{1000 * ticks[key]:>10.1f}" for key in ("late_p99", "took", "took_p99"))
    return f"{'watched' if looks else 'nobody looks':14}{rate:>11.2f}{counts}{figures}"


@contextlib.asynccontextmanager
async def served() -> AsyncIterator[str]:
    """Serve a robot meanwhile; where."""
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(
        sys.executable, *_COMMAND, stdin=pipe, stdout=pipe, stderr=asyncio.subprocess.DEVNULL
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        line = (await process.stdout.readline()).decode()
        yield next(word for word in line.split() if word.startswith("http")).removesuffix("/view")
    finally:
        process.stdin.close()
        await process.wait()


def health(url: str) -> dict[str, Any]:
    """What a site says of itself."""
    with urllib.request.urlopen(f"{url}/health", timeout=10) as answer:  # noqa: S310 - our own server
        found: dict[str, Any] = json.load(answer)
    return found


async def robot_of(url: str) -> str:
    """Where the robot's own site is, once it's connected."""
    while not (found := await asyncio.to_thread(health, url))["connected"]:
        await asyncio.sleep(0.2)
    address: str = found["robot_at"]
    return address.replace("ws://", "http://").removesuffix("/site")


async def watched(url: str) -> float:
    """Watch for a while; how many pictures were decoded a second."""
    from aiortc import RTCConfiguration, RTCPeerConnection, RTCSessionDescription

    peer, times = RTCPeerConnection(RTCConfiguration(iceServers=[])), []

    async def take(track: Any) -> None:
        while True:
            await track.recv()
            if track.kind == "video":
                times.append(time.monotonic())

    tasks: list[asyncio.Task[None]] = []
    peer.on("track", lambda track: tasks.append(asyncio.create_task(take(track))))
    for kind in ("video", "audio"):
        peer.addTransceiver(kind, direction="recvonly")
    await peer.setLocalDescription(await peer.createOffer())
    async with connect(f"{url.replace('http', 'ws')}/media") as socket:
        await socket.send(json.dumps({"token": None}))
        await socket.send(json.dumps({"do": "watch", "offer": peer.localDescription.sdp}))
        while (message := json.loads(await socket.recv()))["kind"] != "answer":
            pass
        await peer.setRemoteDescription(RTCSessionDescription(message["sdp"], "answer"))
        await asyncio.sleep(SECONDS)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)
    await peer.close()
    return (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 0.0


if __name__ == "__main__":
    main()
