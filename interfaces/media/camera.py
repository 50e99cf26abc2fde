"""The robot's camera, live: both axes, and pictures by a process of its own, made while somebody looks."""

from __future__ import annotations

import asyncio
import contextlib
import subprocess
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass, field
from typing import Final, TypeAlias

from interfaces.media.messages import NEWS, CameraView, News, Order, Setup, Shot, Taken, decode, encode, size_of
from interfaces.pipes import HEAD, start
from robots.mobile.camera import Lens, PanTilt, PanTiltConfig
from robots.robot import USUAL_BASE
from robots.rooms import Room
from vrs.checks import number_in
from vrs.clock import Clock
from vrs.errors import FormatError, VrsError

RATE: Final = 6.0
"""Pictures a second unless others are asked for: the paper's 5, and one to spare."""
START_TIME: Final = 60.0
"""How long the process may take to start [s]."""
SHOT_TIME: Final = 10.0
"""How long a picture may take [s]."""
STILL_TIME: Final = 30.0
"""How long a single picture may take, the start of the process included [s]."""
AGAIN: Final = 2.0
"""After so long a process that failed is started anew [s]."""
_LOOK: Final = 0.05
"""Time between two looks at whether pictures are wanted [s]."""
_COUNTED: Final = 2.0
"""Over so long pictures are counted for their rate [s]."""

Stand: TypeAlias = Callable[[float], tuple[tuple[float, float, float], float]]
"""Where the robot is at a session time [s], x, y [m], θ [rad], and the time in its room [s]."""
Ask: TypeAlias = Callable[[Order, float], Awaitable[News]]
"""Sends a message to the camera's process and waits for the answer, at most so long [s]."""


class CameraError(VrsError):
    """The process of the camera failed."""

    def __init__(self, problem: str) -> None:
        self.problem = problem
        super().__init__(f"the camera gives no pictures: {problem}")


@dataclass(frozen=True, slots=True)
class CameraConfig:
    """A camera."""

    rate: float = RATE
    """Pictures a second, 1 to 30."""
    lens: Lens = field(default_factory=Lens)
    """What it sees."""
    pan_tilt: PanTiltConfig = field(default_factory=PanTiltConfig)
    """How it can be turned."""
    video: bool = True
    """Whether there's video; else only single pictures are made."""
    robot: str = USUAL_BASE
    """What `robots.load` finds the robot by in whose head it is."""

    def __post_init__(self) -> None:
        number_in("camera", self.rate, 1.0, 30.0, unit=" pictures a second")


@contextlib.asynccontextmanager
async def camera_process(setup: Setup) -> AsyncIterator[Ask]:
    """Run a camera's process meanwhile, and yield what asks it, a question at a time.

    Raises:
        CameraError: If it doesn't start; of what is asked, if there's no answer.
    """
    process, ours = start("interfaces.media.camera_process")
    reader, writer = await asyncio.open_connection(sock=ours)

    async def ask(order: Order, within: float) -> News:
        try:
            async with asyncio.timeout(within):
                writer.write(encode(order))
                await writer.drain()
                head = await reader.readexactly(HEAD)
                return decode(await reader.readexactly(size_of(head)), NEWS)
        except TimeoutError:
            raise CameraError(f"it took longer than {within:g} s") from None
        except (OSError, EOFError):
            raise CameraError("its process ended") from None
        except FormatError as error:
            raise CameraError(str(error)) from None

    try:
        if await ask(setup, START_TIME) is not None:
            raise CameraError("it doesn't get ready")
        yield ask
    finally:
        writer.close()
        try:
            await asyncio.to_thread(process.wait, 1.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class LiveCamera:
    """Both axes, and pictures for whoever looks. Enter `running` in the loop that serves."""

    def __init__(
        self,
        config: CameraConfig,
        room: Room,
        clock: Clock,
        stand: Stand,
        view: CameraView = CameraView.ROBOT,
        axes: PanTilt | None = None,
    ) -> None:
        """Look straight ahead; nobody looks yet.

        Args:
            config: The camera.
            room: Where the robot is.
            clock: Session time.
            stand: Where the robot is.
            view: What its pictures are of.
            axes: Those of the robot's camera, where another one has them, too.
        """
        self.config, self._room, self._clock, self._stand, self._view = config, room, clock, stand, view
        self.axes = PanTilt(config.pan_tilt, now=clock.now()) if axes is None else axes
        self.problem = ""
        """Why there are no pictures; empty while there are, or none was asked for."""
        self.watchers: set[Callable[[Taken, float], None]] = set()
        """Who gets each picture, with the session time at which it was asked for [s]."""
        self.taken = 0
        """Pictures so far."""
        self.took = 0.0
        """How long the newest one took in its process [s]."""
        self._key = True
        self._stills: list[asyncio.Future[bytes]] = []
        self._times: deque[float] = deque(maxlen=64)

    @property
    def rate(self) -> float:
        """Pictures a second, over the last 2 s."""
        since = self._clock.now() - _COUNTED
        return sum(t > since for t in self._times) / _COUNTED

    def watch(self, watcher: Callable[[Taken, float], None]) -> None:
        """Give somebody each picture from now on, a whole one first."""
        self.watchers.add(watcher)
        self._key = True

    async def still(self) -> bytes:
        """A picture by itself, as JPEG.

        Raises:
            CameraError: If there's none in time.
        """
        future: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()
        self._stills.append(future)
        try:
            async with asyncio.timeout(STILL_TIME):
                return await future
        except TimeoutError:
            raise CameraError(self.problem or f"none within {STILL_TIME:g} s") from None
        finally:
            with contextlib.suppress(ValueError):
                self._stills.remove(future)

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[LiveCamera]:
        """Make pictures while they're wanted."""
        task = asyncio.create_task(self._run())
        try:
            yield self
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    @property
    def wanted(self) -> bool:
        """Whether anybody looks."""
        return bool(self.watchers or self._stills)

    async def _run(self) -> None:
        """Have a process while somebody looks, and another one when it failed."""
        while True:
            while not self.wanted:
                await asyncio.sleep(_LOOK)
            config = self.config
            try:
                async with camera_process(
                    Setup(config.robot, self._room, config.lens, config.rate, config.video, self._view)
                ) as ask:
                    self.problem = ""
                    await self._shoot(ask)
            except (CameraError, OSError) as error:
                self.problem = str(error)
                await asyncio.sleep(AGAIN)

    async def _shoot(self, ask: Ask) -> None:
        """Ask for a picture as often as it's said; those for which there's no time are left out."""
        due = self._clock.now()
        while True:
            now = self._clock.now()
            if now < due or not self.wanted:
                await asyncio.sleep(min(max(due - now, 0.001), _LOOK))
                continue
            due = max(due + 1.0 / self.config.rate, now)
            stills, key, self._key = self._stills, self._key, False
            posture, world = self._stand(now)
            look = self.axes.look(now)
            shot = Shot(self.taken + 1, posture, (look.pan, look.tilt), world, key, bool(stills))
            taken = await ask(shot, SHOT_TIME)
            if taken is None:
                raise CameraError("it answers something else")
            self._give(taken, now)

    def _give(self, taken: Taken, now: float) -> None:
        self.taken, self.took = taken.number, taken.took
        self._times.append(self._clock.now())
        for watcher in tuple(self.watchers):
            watcher(taken, now)
        if taken.still:
            for future in self._stills:
                if not future.done():
                    future.set_result(taken.still)
