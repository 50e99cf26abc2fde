"""The scheduler: f, eq. (1), on one timeline, with its receipts. It's given the time and reads no clock.

Source: Doulgeri, Zikos, Delopoulos, section II-B.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

from vrs.agenda import Agenda
from vrs.commands import (
    Insertion,
    Lateness,
    MotionCommand,
    Profile,
    SteerCommand,
)
from vrs.errors import InvalidValueError, PlanningError, UnreachablePoseError
from vrs.insertion import (
    Edit,
    JoinPlanner,
    MovePlanner,
    insert,
    joined,
    lengthened,
    piece,
)
from vrs.ledger import Ledger
from vrs.model import Limits, RobotModel, frozen_array
from vrs.moves import join, move
from vrs.planning import Plan
from vrs.planning.plan import end_position
from vrs.receipt import Receipt, Status
from vrs.rescheduling import owner_before
from vrs.timeline import Timeline

REFUSALS = (PlanningError, UnreachablePoseError, InvalidValueError)
"""What planning raises when a command can't be."""

FRESH = 0.2
"""Age [s] at which a steering input ends."""


class Paused(NamedTuple):
    """What a stop interrupted."""

    version: int
    """Version of the timeline that the stop made: any later edit makes it the past."""
    timeline: Timeline
    """As it was before."""
    at: float
    """When the stop began [s]."""


class _Session(NamedTuple):
    """Steering inputs in a row."""

    command_id: int
    version: int
    """Version of the timeline that the newest made."""
    start: float
    """When the first began [s]."""


class Scheduler(Agenda[Timeline]):
    """What an engine has planned: a timeline, the limits in force, and a ledger of receipts."""

    def __init__(self, model: RobotModel, timeline: Timeline, ledger: Ledger[Timeline], lateness: Lateness) -> None:
        super().__init__(timeline, ledger, lateness)
        self.model = model
        self.limits = model.limits
        self.paused: Paused | None = None
        self.profiles: dict[int, Profile] = {}
        """Of commands that are no motion commands."""
        self._session: _Session | None = None

    def move(self, command: MotionCommand, now: float | None) -> Receipt:
        """Carry out a motion command.

        Args:
            command: Checked by the analyser.
            now: Present time [s]; None offline.
        """
        issued = command.issued_at if command.issued_at is not None else now
        asked, end = command.execute_at, self.timeline.end
        try:
            t, _, _, status, reason = self.beginning(command, now, end if now is None else now)
        except PlanningError as error:
            return self.reject(issued, asked, str(error))
        if command.insertion is Insertion.APPEND and t < end:
            t = end
            if asked is not None:
                status = Status.POSTPONED
                reason = joined(reason, f"appended at the end of the plan, {t:.9g} s")
        command_id = self.ledger.newest + 1
        planner, joiner = self.planner(command), self.joiner(command)
        try:
            if command.deviation > 0:
                edit = self._passing(command, t, command_id, now)
            else:
                edit = insert(self.timeline, t, command.insertion, command_id, planner, joiner)
        except REFUSALS as error:
            return self.reject(issued, asked, str(error))
        appended = command.insertion is Insertion.APPEND
        appended, t = appended and edit.start == t, edit.start
        shifted, dropped = ((), ()) if appended else self.touched(edit, t)
        target = frozen_array(edit.target) if edit.target.flags.writeable else edit.target
        receipt = Receipt(
            command_id, status, issued, asked, t, edit.arrival, target,
            joined(reason, edit.notes), edit.timeline.version, edit.shift,
            shifted_names=shifted, superseded_names=dropped,
        )  # fmt: skip
        return self.accept(receipt, command, edit, t, appended=appended)

    def _passing(self, command: MotionCommand, t: float, command_id: int, now: float | None) -> Edit[Timeline]:
        from vrs.passing import passing

        return passing(self, command, t, command_id, now)

    def planner(self, command: MotionCommand, limits: Limits | None = None) -> MovePlanner:
        """Plan a command's move, under the limits in force now or others."""
        return partial(move, command, self.model, self.limits if limits is None else limits)

    def joiner(self, command: MotionCommand) -> JoinPlanner:
        """Plan a joining move at a command's speed and by its profile."""
        return partial(join, command, self.limits)

    def stop_at(self, t: float) -> tuple[Plan, str]:
        """Plan a stop of each joint at t [s], jerk-limited where the motion is; and what must be said of it."""
        from vrs.planning import stopping

        profile = self.profile(owner_before(self.timeline, t))
        return stopping.stop(self.timeline.state_before(t), profile, self.limits)

    def profile(self, command_id: int) -> Profile:
        """By which profile a command moves the arm."""
        made = self.profiles.get(command_id)
        if made is not None:
            return made
        command = self.ledger.command(command_id)
        return Profile.PARABOLIC if command is None else command.profile

    def note_profile(self, command_id: int, profile: Profile) -> None:
        """Write down by which profile a command that's no motion command moves the arm."""
        if self.profiles.get(command_id) is not profile:
            # Another dictionary: `atomic` puts the one before back.
            self.profiles = {**self.profiles, command_id: profile}

    def smooth(self, command_id: int) -> bool:
        """Whether a command moves the arm with bounded jerk throughout."""
        reason = self.ledger.receipt(command_id).reason if command_id in self.ledger else ""
        rough = "parabolas" in reason or "accelerations dropped" in reason
        return self.profile(command_id) is Profile.JERK_LIMITED and not rough

    def steer(self, command: SteerCommand, now: float | None) -> Receipt:
        """Go on, from now, as a hand asks; inputs in a row with nothing else between are one command."""
        from vrs.planning import steering

        asked = command.execute_at
        issued = command.issued_at if command.issued_at is not None else now
        try:
            moment = self.moment(command, now, self.timeline.end)
            t = moment.t
            hold = FRESH - (0.0 if issued is None else max(t - issued, 0.0))
            if hold <= 0:
                raise PlanningError(f"the input is {FRESH - hold:.3g} s old; it moves nothing from {FRESH} s on")
            state = self.timeline.state_before(t)
            plan, note, hindrance = steering.steer(
                state, command.rates, command.twist, command.frame, hold, self.model, self.limits
            )
        except REFUSALS as error:
            return self.reject(issued, asked, str(error))
        before, session = self.timeline, self._session
        rests = not state.qd.any() and not state.qdd.any()
        if session is not None and (
            session.version != before.version or t < session.start or (rests and t < before.end)
        ):
            session = None
        command_id, start = (self.ledger.newest + 1, t) if session is None else (session.command_id, session.start)
        after = before
        if len(plan) or t < before.end or session is None:
            after = lengthened(before, t, piece(plan, command_id))
        if after is before:
            stands = self.ledger.receipt(command_id)
            if stands.hindrance != hindrance:
                stands = replace(stands, hindrance=hindrance)
                self.ledger.rewrite(stands)
            return stands
        target = end_position(plan) if len(plan) else state.q
        self.note_profile(command_id, Profile.JERK_LIMITED)
        self._session = _Session(command_id, after.version, start)
        receipt = Receipt(
            command_id, moment.status, moment.issued, asked, start, t + plan.duration, frozen_array(target),
            joined(moment.reason, note), after.version, hindrance=hindrance,
        )  # fmt: skip
        if session is not None:
            self.timeline = after
            self.ledger.rewrite(receipt)
            return receipt
        edit = Edit(after, t, t + plan.duration, target, dropped=None)
        receipt = replace(receipt, superseded_names=self.touched(edit, t)[1])
        return self.accept(receipt, None, edit, t)

    def brake(self, t: float, command_id: int) -> tuple[Timeline, str]:
        """What is scheduled, with each joint braking from t on; and what must be said of it."""
        stop, note = self.stop_at(t)
        self.note_profile(command_id, self.profile(owner_before(self.timeline, t)))
        return self.timeline.edited(t, [piece(stop, command_id)]), note

    @property
    def steered(self) -> tuple[int, float] | None:
        """The command that the next steering input may go on with, and when it began [s]."""
        session = self._session
        if session is None or session.version != self.timeline.version:
            return None
        return session.command_id, session.start

    def go_on_steering(self, command_id: int, start: float) -> None:
        """Let the next steering input go on with a command that began at a time [s]."""
        self._session = _Session(command_id, self.timeline.version, start)
