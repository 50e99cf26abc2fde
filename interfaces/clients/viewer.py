"""The Viewer: shows the robot at its own rate, from its own place in time.

Source: Doulgeri, Zikos, Delopoulos, section III.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass, replace

from interfaces.clients.playhead import Mode, PlayHead
from interfaces.clients.ports import RemotePort, port_to
from interfaces.clients.viewer_sources import FrameSource, SegmentSource
from interfaces.engine_server.forecasts import WINDOW
from interfaces.engine_server.site import earliest
from interfaces.messages import FrameStatus, Reply, Scene, ViewForm
from vrs.checks import finite
from vrs.engine import Engine
from vrs.errors import InvalidValueError
from vrs.model import Array
from vrs.timeline import Timeline

DUE = 1e-9
"""How much too early [s] a tick counts as reached."""


@dataclass(frozen=True, slots=True, eq=False)
class ShownFrame:
    """A frame that a viewer showed."""

    number: int
    """Counts the viewer's frames, from 1."""
    t: float
    """Time it shows [s]."""
    q: Array
    """Joints [rad], (n,)."""
    shown_at: float
    """The user's time when it was shown [s]."""
    lateness: float
    """How far it lies behind the place of the play head [s]; negative where it lies ahead."""
    status: FrameStatus
    """As far as it's known now."""
    falsified_by: int | None = None
    """Id of the first command that changed what happens at t; None where nobody knows, or none did."""

    @property
    def age(self) -> float:
        """The user's time when it was shown less the time it shows [s]."""
        return self.shown_at - self.t


class Viewer:
    """An observer that asks periodically, with play-back: play, pause, step, rewind, seek, rate, loop, go live.

    It begins live. In the form of segments it holds the whole timeline and evaluates it itself; in the form of
    frames, plain or compact, it shows a broadcaster's while live, and asks for others. Nothing but its own user
    moves it away from where it is.
    """

    def __init__(
        self,
        engine: RemotePort | Engine,
        *,
        rate: float = 50.0,
        form: ViewForm = ViewForm.SEGMENTS,
        lead: float = 0.0,
        resend: float = 0.3,
        delay: float = 0.0,
    ) -> None:
        """Reach an engine; it's asked for the scene at the first `advance`.

        Args:
            engine: A port, or an engine in this process.
            rate: Frames to show a second, 0.1 to 1000; in the form of frames the nearest broadcaster's is followed.
            form: What crosses.
            lead: How far ahead of what is heard of the engine's time the live edge is [s], −60 to 60: with
                D_f + D_b frames are of age 0 by the user's clock where D = −D_f. For segments: broadcasters have
                their own.
            resend: After how long without an answer something is asked for again [s].
            delay: How long a compact frame may wait for others that go in the same message [s], 0 to 0.1: it's
                shown as much later, and costs a third.

        Raises:
            InvalidValueError: If something is out of range, a lead is given for frames, or a delay for anything but
                compact frames.
        """
        self.rate = finite("rate", rate, "0.1 to 1000 frames a second")
        if not 0.1 <= self.rate <= 1000:
            raise InvalidValueError("rate", rate, "0.1 to 1000 frames a second")
        lead = finite("lead", lead, "−60 to 60 s")
        if abs(lead) > 60 or (lead and form != ViewForm.SEGMENTS):
            raise InvalidValueError("lead", lead, "−60 to 60 s for segments, 0 for frames")
        if delay and form != ViewForm.COMPACT:
            raise InvalidValueError("delay", delay, "0 to 0.1 s for compact frames, else 0")
        port, self._own = port_to(engine)
        self.form = ViewForm(form)
        self.segments = SegmentSource(port, lead=lead, resend=resend) if self.form is ViewForm.SEGMENTS else None
        self._source = self.segments or FrameSource(
            port, rate=self.rate, resend=resend, form=self.form, delay=delay
        )
        port.join(self)
        self.port = port
        self.head = PlayHead(self._source.live.at, lambda: self._source.span)
        self._begun: float | None = None
        self._beat = 0
        self._latest = -math.inf
        self._shown: OrderedDict[int, ShownFrame] = OrderedDict()
        self.number = 0
        """Number of the frame that was shown last."""
        self.confirmed = 0
        """Predicted frames that came true."""
        self.falsified = 0
        """Predicted frames that a command changed."""

    @property
    def scene(self) -> Scene | None:
        """What there is to see; None before it's known."""
        return self._source.scene

    @property
    def timeline(self) -> Timeline | None:
        """The timeline as far as it has come; None before that, and in the forms of frames."""
        return None if self.segments is None else self.segments.timeline

    @property
    def mode(self) -> Mode:
        """What the play head does."""
        return self.head.mode

    def play(self, *, now: float, rate: float | None = None) -> None:
        """Run from here at a rate, −10 to 10 but not 0, negative to rewind; see `PlayHead.play`."""
        self.head.play(now=now, rate=rate)

    def pause(self, *, now: float) -> None:
        """Stand."""
        self.head.pause(now=now)

    def rewind(self, *, now: float, rate: float = 1.0) -> None:
        """Run backwards at a rate above 0, 10 at most."""
        self.head.rewind(now=now, rate=rate)

    def step(self, frames: float = 1.0, *, now: float) -> None:
        """Stand so many of its own frames further on, or back where that's negative."""
        self.head.step(finite("frames", frames) / self.rate, now=now)

    def set_rate(self, rate: float, *, now: float) -> None:
        """Change the rate of play."""
        self.head.set_rate(rate, now=now)

    def seek(self, t: float, *, now: float) -> None:
        """Go to a time [s] at once; see `PlayHead.seek`."""
        self.head.seek(t, now=now)

    def set_loop(self, start: float, end: float, *, now: float) -> None:
        """Loop a range [s]; see `PlayHead.set_loop`."""
        self.head.set_loop(start, end, now=now)

    def clear_loop(self, *, now: float) -> None:
        """Loop no more."""
        self.head.clear_loop(now=now)

    def go_live(self, *, now: float) -> float:
        """Catch up with the newest there is, smoothly; when it will be there [s]. See `PlayHead.go_live`."""
        return self.head.go_live(now=now, wait=self._source.delay)

    def receive(self, message: Reply, *, now: float) -> None:
        """Take a reply."""
        self._source.receive(message, now=now)

    def advance(self, *, now: float) -> tuple[ShownFrame, ...]:
        """Show the frame that is due, if there's one to show.

        Args:
            now: The user's time [s].
        """
        if self._own is not None:
            self._own.advance(now=now)
        self._source.advance(now=now)
        self._settle()
        if self._begun is None:
            self._begun = now
        due = self._begun + self._beat / self.rate
        if now < due - DUE:
            return ()
        self._beat += 1 + int((now - due + DUE) * self.rate)
        t = self.head.position(now)
        if t is None:
            return ()
        live = self.head.mode is Mode.LIVE
        floor = self._latest if live else -math.inf

        def ahead(seconds: float) -> float | None:
            return self.head.ahead(now + seconds)

        frame = self._source.frame(self.number + 1, t, now=now, live=live, ahead=ahead, floor=floor)
        if frame is None:
            return ()
        self._latest = frame.t
        self.number += 1
        shown = ShownFrame(self.number, frame.t, frame.q, now, t - frame.t, frame.status, frame.falsified_by)
        self._shown[shown.number] = shown
        self._settle()
        if len(self._shown) > WINDOW:
            self._shown.popitem(last=False)
        return (shown,)

    def _settle(self) -> None:
        for verdict in self._source.settled():
            self.confirmed += verdict.status is FrameStatus.CONFIRMED
            self.falsified += verdict.status is FrameStatus.FALSIFIED
            shown = self._shown.get(verdict.number)
            if shown is not None:
                status, by = verdict.status, verdict.falsified_by
                self._shown[verdict.number] = replace(shown, status=status, falsified_by=by)

    def next_deadline(self) -> float | None:
        """When the next frame is due, or something is asked for again [s]; None before the first `advance`."""
        if self._begun is None:
            return None
        tick = self._begun + self._beat / self.rate
        own = None if self._own is None else self._own.next_deadline()
        return earliest(tick, self._source.next_deadline(), own)

    def shown(self, number: int) -> ShownFrame | None:
        """A frame that was shown, with its status as it's known now; None where it's forgotten, or never was."""
        return self._shown.get(number)

    @property
    def history(self) -> tuple[ShownFrame, ...]:
        """The newest 4096 frames that were shown, oldest first."""
        return tuple(self._shown.values())

    @property
    def share_falsified(self) -> float | None:
        """Share of the predicted frames with a known fate that were falsified; None before the first."""
        settled = self.confirmed + self.falsified
        return self.falsified / settled if settled else None

    def close(self) -> None:
        """Listen no more."""
        self.port.leave(self)
        self._source.close()
        if self._own is not None:
            self._own.servlet.close()
