"""Camera, voice and screen of a mobile robot's operator site, and the pages that look and listen."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import AsyncIterator, Callable, Hashable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final

from interfaces.media.camera import CameraConfig, LiveCamera, Stand
from interfaces.media.coding import VoicePlayout, missing
from interfaces.media.hearing import LiveMicrophone
from interfaces.media.messages import CameraView
from interfaces.media.offer import OfferError
from interfaces.media.presenter import Presenter
from interfaces.media.speech import PROGRAM, SpeechError, cleaned, program
from robots.mobile.camera import PanTilt
from robots.mobile.microphone import Microphone
from robots.robot import HeadCamera, load
from robots.rooms import Room
from vrs.clock import Clock
from vrs.errors import InvalidValueError, VrsError

if TYPE_CHECKING:
    from interfaces.media.peers import Peer

MOST_PEERS: Final = 8
"""Pages that get picture and sound by RTP; more see single pictures."""
TELL: Final = 0.1
"""Time between two looks at what there's to tell [s]."""
_DECIMALS: Final = 4
"""Decimals of an angle that is told [rad]."""


@dataclass(frozen=True, slots=True)
class MediaChoice:
    """What a page wants to see and hear."""

    view: CameraView = CameraView.ROBOT
    hears: bool = False
    """Whether it listens to the robot's microphone."""


class LiveMedia:
    """What sees, speaks and shows for one robot. Enter `running` in the loop that serves."""

    def __init__(
        self,
        config: CameraConfig,
        room: Room,
        clock: Clock,
        *,
        stand: Stand,
        commands: Callable[[str, int], bool],
        screen: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Wait for pages.

        Args:
            config: The camera.
            room: Where the robot is.
            clock: Session time.
            stand: Where the robot is.
            commands: Whether a session has the lease, by its name and the epoch.
            screen: Shows a message on the robot in the 3D view; an empty one clears it.
        """
        self.clock, self._commands = clock, commands
        self.missing = missing() if config.video else ""
        """What there's no video and sound for want of; empty with the whole extra."""
        video = config.video and not self.missing
        config = replace(config, video=video)
        axes = PanTilt(config.pan_tilt, now=clock.now())
        self.cameras = {view: LiveCamera(config, room, clock, stand, view, axes) for view in CameraView}
        """By what they show."""
        self.camera = self.cameras[CameraView.ROBOT]
        """The robot's own."""
        head = load(config.robot).device(HeadCamera)
        self.microphone = LiveMicrophone(Microphone(room, 0.0 if head is None else head.neck[2]), stand)
        """The robot's, in its head."""
        self._playout = VoicePlayout()
        audible = video and program() is not None
        self.presenter = Presenter(clock, self._playout, screen=screen, audible=audible)
        """Says and shows what jobs, or people, want."""
        if video and not audible:
            self.presenter.problem = str(SpeechError(f"the program {PROGRAM} isn't installed"))
        self.changed: Callable[[], None] = lambda: None
        """Called when there's something new to tell pages."""
        self.presenter.changed = self._note
        self._video = video
        self._peers: dict[Hashable, Peer] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def peers(self) -> int:
        """Pages that get picture and sound by RTP."""
        return len(self._peers)

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[LiveMedia]:
        """Make pictures, and tell pages how everything is."""
        telling = asyncio.create_task(self._tell())
        try:
            async with contextlib.AsyncExitStack() as cameras:
                for camera in self.cameras.values():
                    await cameras.enter_async_context(camera.running())
                yield self
        finally:
            tasks = {telling, *self._tasks}
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            await self.presenter.close()
            for key in tuple(self._peers):
                await self.leave(key)

    def _note(self) -> None:
        """Something is new to tell pages."""
        self.changed()

    async def _tell(self) -> None:
        before: dict[str, Any] = {}
        while True:
            facts = self.facts()
            if facts != before:
                before = facts
                self._note()
            await asyncio.sleep(TELL)

    def facts(self) -> dict[str, Any]:
        """How everything is, for pages."""
        camera, presenter = self.camera, self.presenter
        look, limits = camera.axes.look(self.clock.now()), camera.config.pan_tilt
        return {
            "kind": "media",
            "video": self._video,
            "missing": self.missing,
            "pan": round(look.pan, _DECIMALS),
            "tilt": round(look.tilt, _DECIMALS),
            "target": list(camera.axes.target),
            "limits": [-limits.pan, limits.pan, -limits.down, limits.up],
            "view": camera.config.lens.view,
            "rate": camera.config.rate,
            "problem": self._problem,
            "saying": presenter.saying,
            "voice": presenter.problem,
            "message": presenter.message,
            "microphone": self.microphone.hears,
            "level": self._level(),
            "peers": self.peers,
        }

    @property
    def _problem(self) -> str:
        """Why a camera gives no pictures; empty while all do that are asked."""
        return next((camera.problem for camera in self.cameras.values() if camera.problem), "")

    def _level(self) -> int | None:
        """How loud it is at the robot, in whole dB; None below what people hear."""
        level = self.microphone.level(self.clock.now()) if self.microphone.hears else -math.inf
        return round(level) if level >= 0.0 else None

    def health(self) -> dict[str, Any]:
        """How it is, for `/health`."""
        camera = self.camera
        return {
            "video": self._video,
            "pictures": camera.taken,
            "rate": camera.rate,
            "took": camera.took,
            "problem": self._problem,
            "voice": self.presenter.problem,
            "peers": self.peers,
        }

    def commands(self, session: str, epoch: str) -> bool:
        """Whether a session has control, by its name and its epoch as a page has it."""
        return epoch.isascii() and epoch.isdigit() and len(epoch) <= 20 and self._commands(session, int(epoch))

    def aim(self, pan: float, tilt: float) -> None:
        """Turn the camera [rad].

        Raises:
            InvalidValueError: If an angle is outside its limits.
        """
        self.camera.axes.aim(pan, tilt, now=self.clock.now())

    def speak(self, text: str) -> None:
        """Say something, and don't wait for its end.

        Raises:
            InvalidValueError: If it isn't a text that can be said.
        """
        words = cleaned(text)
        task = asyncio.create_task(self._speak(words))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _speak(self, words: str) -> None:
        try:
            await self.presenter.speak(words)
        except VrsError as error:
            self.presenter.problem = str(error)

    def choose(self, page: Hashable, choice: MediaChoice) -> None:
        """Show and play another choice to a page from now on, if it watches."""
        if (peer := self._peers.get(page)) is not None:
            peer.choose(self.cameras[choice.view], hears=choice.hears)

    async def watch(self, page: Hashable, offer: str, choice: MediaChoice) -> str:
        """Give a page picture and sound, in place of what it had.

        Args:
            page: Who asks.
            offer: SDP.
            choice: What it wants to see and hear.

        Returns:
            The answer, SDP.

        Raises:
            InvalidValueError: If there's no video here.
            OfferError: If it can't be answered, or too many watch.
        """
        if not self._video:
            why = f"{self.missing} isn't installed" if self.missing else "it's switched off here"
            raise InvalidValueError("watch", "video", f"left out: {why}")
        from interfaces.media.peers import CONNECT_TIME, Peer

        await self.leave(page)
        if len(self._peers) >= MOST_PEERS:
            raise OfferError(f"{MOST_PEERS} watch already")
        peer = self._peers[page] = Peer(self.camera, self._playout, self.microphone, self.clock)
        self.choose(page, choice)
        try:
            answer = await peer.answer(offer)
        except OfferError:
            await self.leave(page)
            raise
        task = asyncio.create_task(self._mind(page, peer, CONNECT_TIME))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return answer

    async def _mind(self, page: Hashable, peer: Peer, within: float) -> None:
        """Forget a peer that doesn't connect in time, or whose connection is over."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(within):
                await peer.connected.wait()
            await peer.ended.wait()
        if self._peers.get(page) is peer:
            await self.leave(page)

    async def leave(self, page: Hashable) -> None:
        """End what a page gets; nothing where it gets nothing."""
        peer = self._peers.pop(page, None)
        if peer is not None:
            await peer.close()
