"""Browsers that get picture and sound by RTP: a peer connection each, all fed with what was encoded once.

Loads aiortc, of the extra `[media]`: import it where somebody is to watch. Nothing elsewhere is asked for anything.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections import deque
from fractions import Fraction
from typing import Any, Final

from aiortc import (
    MediaStreamTrack,
    RTCConfiguration,
    RTCPeerConnection,
    RTCRtpCodecCapability,
    RTCRtpSender,
    RTCSessionDescription,
)
from aiortc.exceptions import InvalidAccessError, InvalidStateError
from aiortc.mediastreams import MediaStreamError
from av.packet import Packet

from interfaces.media.camera import LiveCamera
from interfaces.media.coding import SILENCE, SOUND_PERIOD, SOUND_RATE, VIDEO_CLOCK, VoicePlayout
from interfaces.media.hearing import LiveMicrophone
from interfaces.media.messages import Taken
from interfaces.media.offer import OfferError, canonical
from vrs.clock import Clock

VIDEO: Final = "video/VP8"
CONNECT_TIME: Final = 20.0
"""Who isn't connected after so long is given up [s]."""
_BACKLOG: Final = 8
"""Frames that wait for a peer; then it waits for the next whole picture."""
_LATE: Final = 0.3
"""Sound that is so late is left out [s]."""


class VideoTrack(MediaStreamTrack):
    """The camera's pictures for one peer, as they were encoded for all."""

    kind = "video"

    def __init__(self) -> None:
        super().__init__()
        self._frames: deque[Packet[Any]] = deque()
        self._come = asyncio.Event()
        self._whole = True

    def put(self, taken: Taken, t: float) -> None:
        """Take a picture of a session time [s]; those that refer to one that isn't there are left out."""
        if self._whole and not taken.key:
            return
        if len(self._frames) >= _BACKLOG:
            self._frames.clear()
            self._whole = not taken.key
            if self._whole:
                return
        self._whole = False
        packet: Packet[Any] = Packet(taken.video)
        packet.pts, packet.time_base = round(t * VIDEO_CLOCK), Fraction(1, VIDEO_CLOCK)
        self._frames.append(packet)
        self._come.set()

    def renew(self) -> None:
        """Go on with the pictures of another camera, the first whole one first."""
        self._frames.clear()
        self._whole = True

    async def recv(self) -> Packet[Any]:
        """The next picture."""
        while not self._frames:
            if self.readyState != "live":
                raise MediaStreamError
            self._come.clear()
            await self._come.wait()
        return self._frames.popleft()

    def stop(self) -> None:
        """End, also for who waits."""
        super().stop()
        self._come.set()


class SoundTrack(MediaStreamTrack):
    """What is said, for one peer, in time with all others; while nothing is, what the robot hears, if it's wanted.

    A robot that speaks doesn't listen: it would hear itself alone.
    """

    kind = "audio"

    def __init__(self, playout: VoicePlayout, microphone: LiveMicrophone, clock: Clock) -> None:
        super().__init__()
        self._playout, self._microphone, self._clock = playout, microphone, clock
        self.hears = False
        """Whether the microphone is wanted."""
        self._origin, self._count = clock.now(), 0

    async def recv(self) -> Packet[Any]:
        """The next packet, when it's due."""
        if self.readyState != "live":
            raise MediaStreamError
        due = self._origin + self._count * SOUND_PERIOD
        late = self._clock.now() - due
        if late > _LATE:
            self._count += int(late / SOUND_PERIOD)
            due = self._origin + self._count * SOUND_PERIOD
        await asyncio.sleep(max(0.0, -late))
        data = self._playout.at(due)
        if self.hears and data is SILENCE:
            data = self._microphone.at(due)
        packet: Packet[Any] = Packet(data)
        packet.pts, packet.time_base = round(self._count * SOUND_PERIOD * SOUND_RATE), Fraction(1, SOUND_RATE)
        self._count += 1
        return packet


class Peer:
    """One browser that watches and listens."""

    def __init__(self, camera: LiveCamera, playout: VoicePlayout, microphone: LiveMicrophone, clock: Clock) -> None:
        self._camera = camera
        self.connection = RTCPeerConnection(RTCConfiguration(iceServers=[]))
        self._video = VideoTrack()
        transceiver = self.connection.addTransceiver(self._video, "sendonly")
        transceiver.setCodecPreferences(_codecs())
        self._sound = SoundTrack(playout, microphone, clock)
        self.connection.addTransceiver(self._sound, "sendonly")
        self.connected = asyncio.Event()
        """Set when picture and sound are under way."""
        self.ended = asyncio.Event()
        """Set when the connection is over."""
        self.connection.on("connectionstatechange", self._look)

    def choose(self, camera: LiveCamera, *, hears: bool) -> None:
        """Show what a camera sees from now on, and let the microphone be heard, or not."""
        self._sound.hears = hears
        if camera is self._camera:
            return
        before, self._camera = self._camera, camera
        if self._video.put in before.watchers:
            before.watchers.discard(self._video.put)
            self._video.renew()
            camera.watch(self._video.put)

    async def answer(self, offer: str) -> str:
        """Answer a browser's offer to receive a picture and a sound.

        Args:
            offer: SDP.

        Returns:
            SDP.

        Raises:
            OfferError: If it can't be answered.
        """
        connection = self.connection
        try:
            await connection.setRemoteDescription(RTCSessionDescription(canonical(offer), "offer"))
            await connection.setLocalDescription(await connection.createAnswer())
        except (InvalidAccessError, InvalidStateError, ValueError, OSError) as error:
            raise OfferError(str(error) or "this offer can't be answered") from None
        return str(connection.localDescription.sdp)

    def _look(self) -> None:
        state = self.connection.connectionState
        if state == "connected":
            self.connected.set()
            self._camera.watch(self._video.put)
        elif state in {"failed", "closed"}:
            self._camera.watchers.discard(self._video.put)
            self.ended.set()

    async def close(self) -> None:
        """End; a second call does nothing."""
        self._camera.watchers.discard(self._video.put)
        with contextlib.suppress(ConnectionError):
            await self.connection.close()
        self.ended.set()


def _codecs() -> list[RTCRtpCodecCapability]:
    """What video is sent in, and how what was lost is sent again."""
    found = RTCRtpSender.getCapabilities("video").codecs
    return [codec for codec in found if codec.mimeType in {VIDEO, "video/rtx"}]
