"""A copy of an engine's timeline at the reader's end, kept up by the edits that cross."""

from __future__ import annotations

import math

from interfaces.changes import AHEAD, PART, changed
from interfaces.messages import Change, Follow, History, Pulse, Reply, Scene, ViewForm, Want
from interfaces.ports import EnginePort
from interfaces.resending import interval_of
from vrs.errors import InvalidValueError
from vrs.segment import PolynomialSegment
from vrs.timeline import Timeline

HELD = 64
"""Edits that came before the one that they build on, and parts of a history before those in front, at most."""

Edited = tuple[Timeline, int | None]
"""A timeline, and the command that made it."""


class Mirror:
    """Fetches the timeline so far, then follows its edits. What is lost, is asked for again."""

    def __init__(self, port: EnginePort, *, resend: float) -> None:
        self._port = port
        self._resend = interval_of(resend)
        self._follow = Follow(port.number(), ViewForm.SEGMENTS)
        self._fetching: list[PolynomialSegment] | None = None
        self._early: dict[int, History] = {}
        self._held: dict[int, Change] = {}
        self._due = -math.inf
        self._behind = False
        self._edited: list[Edited] = []
        self.scene: Scene | None = None
        """What it began with."""
        self.edit = 0
        """Number of the newest edit in it."""
        self.timeline: Timeline | None = None
        """The copy; None until the whole timeline so far has come."""
        self.past = -math.inf
        """Up to this time [s] the copy is what happened."""

    def receive(self, message: Reply, *, now: float) -> None:
        """Take what concerns the timeline."""
        if isinstance(message, Scene) and message.number == self._follow.number:
            self._begin(message, now)
        elif isinstance(message, History):
            self._add(message, now)
        elif isinstance(message, Change):
            self._hold(message, now)
        elif isinstance(message, Pulse) and self.timeline is not None:
            if message.edit <= self.edit:
                self.past = max(self.past, message.past)
            else:
                self._lack(now)

    def _begin(self, scene: Scene, now: float) -> None:
        known = self.scene
        if known is not None and scene.edit <= (known.edit if self.timeline is None else self.edit):
            return
        self.scene, self._fetching = scene, []
        self._early.clear()
        self._ask(now) if scene.segments else self._complete(now)

    def _add(self, part: History, now: float) -> None:
        scene, fetching = self.scene, self._fetching
        if scene is None or fetching is None or part.edit != scene.edit or part.index < len(fetching):
            return
        self._early[part.index] = part
        if len(self._early) > HELD:
            del self._early[max(self._early)]
        before = len(fetching)
        while (following := self._early.pop(len(fetching), None)) is not None:
            fetching.extend(following.segments)
        if len(fetching) == before:
            return
        self._due = now + self._resend
        if len(fetching) >= scene.segments:
            self._complete(now)
        elif len(fetching) // (AHEAD * PART) > before // (AHEAD * PART):
            self._ask(now)

    def _complete(self, now: float) -> None:
        scene, fetching = self.scene, self._fetching
        assert scene is not None
        assert fetching is not None
        self._fetching = None
        self._advance_to(Timeline(scene.initial, scene.start, fetching), scene.edit, None)
        self._ask(now)

    def _hold(self, message: Change, now: float) -> None:
        if message.edit <= self.edit and self.timeline is not None:
            return
        self._held[message.base] = message
        if len(self._held) > HELD:
            del self._held[min(self._held)]
        self._apply(now)
        if self._held and self.timeline is not None:
            self._lack(now)

    def _apply(self, now: float) -> None:
        while self.timeline is not None and (message := self._held.pop(self.edit, None)) is not None:
            try:
                timeline = changed(self.timeline, message)
            except InvalidValueError:
                self._follow = Follow(self._port.number(), ViewForm.SEGMENTS)
                self.scene = self.timeline = None
                self._due = now
                return
            self._advance_to(timeline, message.edit, message.command_id)

    def _advance_to(self, timeline: Timeline, edit: int, command_id: int | None) -> None:
        self.timeline, self.edit = timeline, edit
        self._edited.append((timeline, command_id))
        self._behind = False
        self._held = {base: change for base, change in self._held.items() if base >= edit}

    def _lack(self, now: float) -> None:
        """Some edit is missing: ask for it, if that hasn't just been done."""
        if not self._behind:
            self._behind = True
            self._ask(now)

    def _ask(self, now: float) -> None:
        scene = self.scene
        self._due = now + self._resend
        if scene is None:
            self._port.send(self._follow, now=now)
        elif self._fetching is not None:
            self._port.send(Want(scene.edit, len(self._fetching)), now=now)
        else:
            self._port.send(Want(self.edit, None), now=now)

    def advance(self, *, now: float) -> None:
        """Ask for what is missing."""
        if self._waits() and now >= self._due:
            self._ask(now)

    def edited(self) -> tuple[Edited, ...]:
        """The edits since the last call."""
        edited, self._edited = tuple(self._edited), []
        return edited

    def next_deadline(self) -> float | None:
        """When something is asked for again [s]; None when nothing is missing."""
        return self._due if self._waits() else None

    def _waits(self) -> bool:
        return self.timeline is None or self._fetching is not None or self._behind
