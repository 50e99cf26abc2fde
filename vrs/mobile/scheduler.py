"""The scheduler of a mobile robot: f, eq. (1) of Doulgeri et al. Time is an argument, no clock is read."""

from __future__ import annotations

from typing import cast

import numpy as np
from typing_extensions import override

from vrs.commands import DriveCommand, Insertion, Lateness, Stop
from vrs.errors import PlanningError
from vrs.insertion import Edit, tail_at
from vrs.ledger import Ledger, Receipt
from vrs.mobile.model import DriveLimits, MobileModel, braking
from vrs.mobile.timeline import ArcPiece, ArcTimeline
from vrs.notes import Note, NoteCode, Notes
from vrs.scheduler import BaseScheduler, Edited
from vrs.segment import HOLD

_NOWHERE = np.empty(0)
"""A drive command has no target."""


class DriveScheduler(BaseScheduler[ArcTimeline]):
    """What an engine has planned for a mobile robot."""

    def __init__(
        self, model: MobileModel, timeline: ArcTimeline, ledger: Ledger[ArcTimeline], lateness: Lateness
    ) -> None:
        super().__init__(timeline, ledger, lateness)
        self.limits: DriveLimits = model.limits
        self._period = model.period

    @override
    def carry_out(self, command: Edited, now: float | None) -> Receipt:
        if isinstance(command, Stop):
            return self._stop(command, now)
        return self._drive(cast("DriveCommand", command), now)

    def _drive(self, command: DriveCommand, now: float | None) -> Receipt:
        end = self.timeline.end
        refusal = self.limits.refusal(command.v, command.w)
        if refusal:
            raise PlanningError(refusal)
        timing = self.timing(command, now, end)
        t = max(timing.t, end) if command.execute_at is None else timing.t
        command_id = self.ledger.newest + 1
        edit = self._spliced(t, ArcPiece(command.duration, command.v, command.w, command_id))
        appended = t >= end
        shifted, dropped = ((), ()) if appended else self.touched(edit, t)
        entry = self.entry(
            command_id, timing, (t, edit.arrival), edit.timeline.version, (), shift=edit.shift,
            shifted_names=shifted, superseded_names=dropped,
        )  # fmt: skip
        return self.accept(entry, edit, t, appended=appended)

    def _spliced(self, t: float, piece: ArcPiece) -> Edit[ArcTimeline]:
        """The past, the new arc, standing while there's slack, and the tail from where the robot then is."""
        timeline = self.timeline
        tail, dropped = tail_at(timeline, t, Insertion.SPLICE)
        arrival = t + piece.duration
        if tail is None:
            return Edit(timeline.edited(t, [piece]), t, arrival, _NOWHERE, dropped=dropped)
        scheduled = timeline.start_of(tail)
        slack = scheduled - arrival
        pieces = [piece, ArcPiece(slack, 0.0, 0.0, HOLD)] if slack > 0 else [piece]
        after = timeline.edited(t, pieces, tail, max(scheduled, arrival))
        return Edit(after, t, arrival, _NOWHERE, max(-slack, 0.0), tail, dropped)

    def _stop(self, command: Stop, now: float | None) -> Receipt:
        """Brake along the present arc and drop what is scheduled."""
        timing = self.timing(command, now, self.timeline.end)
        command_id, t = self.ledger.newest + 1, timing.t
        after, notes = self.brake(t, command_id)
        edit = Edit(after, t, max(after.end, t), _NOWHERE, dropped=None)
        _, names = self.touched(edit, t)
        entry = self.entry(command_id, timing, (t, edit.arrival), after.version, notes, superseded_names=names)
        return self.accept(entry, edit, t)

    @override
    def brake(self, t: float, command_id: int) -> tuple[ArcTimeline, Notes]:
        """What is scheduled, with the robot braking along its arc from t [s] on, a command every period."""
        steps = braking(self.timeline.speeds_before(t), self._period, self.limits)
        pieces = [ArcPiece(self._period, v, w, command_id) for v, w in steps]
        note = Note(NoteCode.STOPPED_ON_ARC if pieces else NoteCode.STOOD)
        return self.timeline.edited(t, pieces), (note,)
