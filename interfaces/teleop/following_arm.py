"""An arm that follows an operator: an engine of its own, played out under jitter, and reports.

With an adaptive offset the engine is a replica: it carries out the operator's log in its order, each entry as of
the time at which it was given, and so has the operator's timeline to the bit; how late messages come is a matter
of the playout alone. With a fixed offset D, as in the paper, entries are carried out as they come, at the time that
the robot's own clock then reads; late ones are postponed, and the timelines part.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import chain, islice
from typing import Annotated, Any, NamedTuple, cast

import numpy as np
from typing_extensions import override

from interfaces.engine_server.site import engine_time
from interfaces.link.delivery import Incoming
from interfaces.messages.control import HandReport
from interfaces.messages.fields import Epoch
from interfaces.messages.sites import LogEntry, Orders, PlanPart, Report
from interfaces.teleop.connection import Host, HostConfig
from interfaces.teleop.robot import AdaptiveOffset, OffsetConfig, RobotSite
from interfaces.teleop.samples import SampleLog
from robots.bullet.grasping import HandState
from robots.onboard.following import SensorMonitor, Violation, too_far
from robots.onboard.playout import EvenPlay, Playout, PlayoutConfig, PlayState, play_of
from robots.onboard.servo import from_commanded
from robots.onboard.watchdog import StopReason, WatchdogConfig
from robots.things import ThingPose, has_moved
from vrs.checks import finite, validated, within
from vrs.clock import ManualClock
from vrs.commands import Profile
from vrs.engine import Engine
from vrs.errors import VrsError
from vrs.insertion import hold, piece
from vrs.ledger import Receipt, Status
from vrs.model import Array, RobotModel
from vrs.planning.jerk_limited import stop
from vrs.segment import HOLD, State
from vrs.timeline import Timeline

WAITING_MOST = 4096
"""So far ahead of the one that's missing entries are kept."""


class ReceivedLog:
    """Which entries came, and up to when the timeline is complete with those that were carried out."""

    def __init__(self, complete_until: float) -> None:
        self.complete_until = complete_until
        self._entries: Incoming[LogEntry] = Incoming(WAITING_MOST)
        self._claims: deque[tuple[int, float]] = deque(maxlen=WAITING_MOST)

    @property
    def executed(self) -> int:
        """Number of the newest entry before which none is missing."""
        return self._entries.count

    def due(self, entries: tuple[LogEntry, ...], *, as_they_come: bool) -> list[LogEntry]:
        """Entries to be carried out now, each once."""
        new = {entry.number: entry for entry in entries if self._entries.expects(entry.number)}
        in_order = [due for entry in entries for due in self._entries.take(entry.number, (entry,))]
        return list(new.values()) if as_they_come else in_order

    def claim(self, newest: int, complete_until: float) -> None:
        """A message said that with all entries up to the newest nothing changes before a time."""
        self._claims.append((newest, complete_until))
        held = [c for c in self._claims if c[0] > self.executed]
        if len(held) < len(self._claims):
            kept = max(c[1] for c in self._claims if c[0] <= self.executed)
            self.complete_until = max(self.complete_until, kept)
            self._claims = deque(held, maxlen=WAITING_MOST)


_TELL_MOST = 4096
"""Most receipts that wait to be reported."""
SEGMENTS_MOST = 2000
"""Most segments of a plan in one report."""
_SETTLE = 0.05
"""How long the arm is held at least where it was measured [s]."""
_AIM = 5
"""Messages after which the aim of play is worked out again."""
_REPEAT = 4
"""Reports that a receipt is told in."""
_AGAIN = 10
"""Every so many reports tell the oldest receipts again that the operator isn't known to have."""
_OLDEST = 64
"""So many of them."""
_PLAYS = 16
"""Epochs and stops of which the play time is kept."""
_SAME = 1e-9
"""Times nearer than this [s] are one."""


@dataclass(frozen=True, slots=True)
@validated
class RobotSiteConfig:
    """How the robot's site behaves."""

    fixed_offset: float | None = None
    """D = −D_f, as in the paper: timeline time less the robot's clock [s]; None adapts."""
    offset: OffsetConfig = field(default_factory=OffsetConfig)
    """How much delay an adaptive offset hides."""
    playout: PlayoutConfig = field(default_factory=PlayoutConfig)
    """How play follows it."""
    beat: Annotated[float, within(1e-3, 10.0)] = 0.1
    """Time between two reports [s], in [0.001, 10]."""
    tolerance: Annotated[float, within(1e-6, 10.0)] = 0.1
    """Following error of a joint above which the robot stops [rad, of a prismatic one m], in [1e-6, 10]."""
    watchdog: WatchdogConfig | None = None
    """When the link counts as lost, and the robot halts; None holds: it goes on when messages come again."""

    def __post_init__(self) -> None:
        if self.fixed_offset is not None:
            finite("fixed_offset", self.fixed_offset, "None or finite seconds")


class JointReference(NamedTuple):
    """What the body is to follow, (k, n) each."""

    q: Array
    """[rad]."""
    qd: Array
    """[rad/s]."""
    qdd: Array
    """[rad/s²]."""


class FollowingArm(RobotSite[Orders, Report]):
    """What runs beside a real arm, all but its body."""

    rearms = False

    def __init__(
        self,
        model: RobotModel,
        q: Array,
        *,
        now: float,
        config: RobotSiteConfig | None = None,
        reported: int = 0,
        opening: float = math.inf,
    ) -> None:
        """Stand at rest until the first message comes.

        Args:
            model: The robot.
            q: Joints [rad], (n,).
            now: By the robot's clock [s].
            config: How to behave.
            reported: Number that no report or sample of an earlier life, which the operator may know, was above.
            opening: What the hand was told before [m]; infinity: it's open.
        """
        self.config = RobotSiteConfig() if config is None else config
        super().__init__(self.config.watchdog, self.config.beat, now=now, reported=reported)
        self._model = model
        self._clock = ManualClock(now)
        self.engine = Engine(model, q=q)
        self._held_since = -math.inf
        """Play time at which it was last let hold elsewhere than it was to be [s]: a jump of its plan."""
        self.engine.begin_with(opening)
        self.violation: Violation | None = None
        """What was measured that stopped it; None where it wasn't that, or since it may move again."""
        self._prismatic = model.prismatic
        self._monitor = SensorMonitor(model.limits, model.prismatic)
        self.parted = False
        """Whether its timeline is another than the operator's."""
        fixed = self.config.fixed_offset
        self._play: Playout | EvenPlay = EvenPlay(now, 0.0) if fixed is None else EvenPlay(fixed)
        self._plays: deque[tuple[float, Playout | EvenPlay]] = deque([(now, self._play)], maxlen=_PLAYS)
        self._offset = AdaptiveOffset(self.config.offset)
        self._log = ReceivedLog(-math.inf)
        self._messages = 0
        self._receipts: deque[tuple[int, int, Receipt]] = deque(maxlen=_TELL_MOST)
        self._measured, self._measured_at = np.array(q, float), (now, self._play_at(now))
        self._samples = SampleLog(len(self._measured), reported)
        self._hand: HandState | None = None
        self._moved: dict[int, tuple[int, ThingPose]] = {}
        """Of each thing that moves, the number of the report in which it was told to have moved, and where to."""

    @property
    def playout(self) -> Playout | None:
        """How an adaptive offset is played; None with a fixed one."""
        return self._play if isinstance(self._play, Playout) else None

    @property
    def complete_until(self) -> float:
        """Up to where its timeline is known to be complete [s]."""
        return self._log.complete_until

    @override
    def join(self, orders: Orders, reason: str, *, now: float) -> None:
        """Meet an operator whose timeline isn't known here: as after a stop by itself, in the operator's epoch."""
        super().join(orders, reason, now=now)
        fixed = self.config.fixed_offset
        self._renew(now, timeline=Timeline(self._measured, orders.sent_at))
        # The next epoch begins after that by the operator's own clock, perhaps before now by what is known of it.
        self._play = EvenPlay(0.0, end=orders.sent_at) if fixed is None else EvenPlay(fixed)
        self._plays = deque([(now, self._play)], maxlen=_PLAYS)
        self.parted = True

    @override
    def receive(self, orders: Orders, *, now: float, correction: float = 0.0, uncertainty: float = 0.0) -> None:
        self._samples.ask(orders.wanted)
        self.advance_play(now=now)
        super().receive(orders, now=now, correction=correction, uncertainty=uncertainty)

    @override
    def _follow(self, orders: Orders, now: float, *, new: bool) -> None:
        while self._receipts and self._receipts[0][0] <= orders.heard:
            self._receipts.popleft()
        if orders.halted:
            self.halt(f"the operator's site: {orders.halted}", now=now)
        if self.halted:
            return
        self._offset.heard(self._log.complete_until, now=now)
        fixed = not isinstance(self._play, Playout)
        for entry in self._log.due(orders.entries, as_they_come=fixed):
            self._carry_out(entry, now)
        self._log.claim(orders.newest, orders.complete_until)
        if isinstance(self._play, Playout):
            if self._messages % _AIM == 0:
                D = self._offset.D
                assert D is not None
                self._play.aim(D - self._play.reserve, now=now)
            self._messages += 1
            self._play.hear(self._log.complete_until, self.engine.timeline, now=now)

    @override
    def _admits(self, orders: Orders) -> bool:
        return True

    @override
    def _start(self, orders: Orders, now: float) -> None:
        fixed, stood = self.config.fixed_offset, self.engine.timeline
        began = orders.epoch_began if fixed is None else engine_time(now, fixed)
        # Play never goes back.
        began = max(began, self._play_at(now))
        self._clock = ManualClock(began)
        if len(stood):
            self._renew(now, timeline=stood, clock=self._clock)
        else:
            self._renew(now, q=stood.initial, clock=self._clock)
        self.violation, self.parted = None, False
        self._log, self._messages = ReceivedLog(began), 0
        self._offset = AdaptiveOffset(self.config.offset)
        self._receipts.clear()
        self._play = self._playing(began, now) if fixed is None else EvenPlay(fixed)
        self._plays.append((now, self._play))

    def _playing(self, p: float, now: float) -> Playout:
        """Play of the engine's timeline from p on [s], by the law."""
        return Playout(self.engine.timeline, self.engine.limits, now=now, p=p, config=self.config.playout)

    def _renew(self, now: float, **start: Any) -> None:
        """Begin with another engine, the hand as it has been told by now [s]."""
        told = float(self.engine.opening(self._play_at(now)))
        self.engine = Engine(self._model, **start)
        self.engine.begin_with(told)

    def _carry_out(self, entry: LogEntry, now: float) -> None:
        at = entry.at if isinstance(self._play, Playout) else engine_time(self._play_at(now), 0.0)
        self._clock.set(max(at, self._clock.now()))
        newest = self.engine.newest
        try:
            self.engine.count_from(entry.command_id)
            command = entry.command
            answer = self.engine.undo() if command is None else self.engine.execute(command)
        except VrsError:
            self.parted = True
            return
        finally:
            self.engine.count_from(max(newest, self.engine.newest))
        if not isinstance(answer, Receipt):
            return
        asked = getattr(entry.command, "execute_at", None)
        late = asked is not None and answer.execute_at is not None and answer.execute_at > asked + _SAME
        self.parted = self.parted or late or answer.status is Status.REJECTED
        self._receipts.append((self._reports + 1, entry.number, answer))

    def advance_play(self, *, now: float) -> None:
        """Let play do what is due by now."""
        if isinstance(self._play, Playout):
            self._play.advance(now=now)

    @override
    def advance(self, *, now: float) -> tuple[Report, ...]:
        self.advance_play(now=now)
        return super().advance(now=now)

    @override
    def rests(self, *, now: float) -> bool:
        """Whether everything is over that it plays."""
        return self._play_at(now) >= self.engine.timeline.end

    @override
    def next_deadline(self) -> float:
        play = None if isinstance(self._play, EvenPlay) else self._play.next_deadline()
        return min(super().next_deadline(), math.inf if play is None else play)

    def play_at(self, t: Array) -> PlayState:
        """Where play is at ascending times up to the next deadline, by the robot's clock [s], (k,)."""
        return self._played(t, self._play.at)

    def foreseen(self, t: Array) -> PlayState:
        """Where play is at ascending times by the robot's clock [s], (k,), if nobody looks at it before."""
        return self._played(t, self._play.foreseen)

    def _played(self, t: Array, newest: Callable[[Array], PlayState]) -> PlayState:
        """Where play is at ascending times by the robot's clock [s], (k,), the newest course by that function."""
        since = self._plays[-1][0]
        if not len(t) or t[0] >= since:
            return newest(t)
        earlier = ((began, play.at) for began, play in islice(reversed(self._plays), 1, None))
        return play_of(chain([(since, newest)], earlier), t)

    def reference(self, play: PlayState) -> JointReference:
        """What the body follows where play is, (k, n) each."""
        p, pace, rate = play.p, play.pace[:, None], play.rate[:, None]
        q, qd, qdd = (self.engine.timeline.sample(p, derivative=k) for k in range(3))
        return JointReference(q, qd * pace, qdd * pace * pace + qd * rate)

    def openings(self, play: PlayState) -> Array:
        """What the hand is told where play is [m], (k,); infinity for as far open as it goes."""
        return self.engine.opening(play.p)

    def hand(self, state: HandState) -> None:
        """Take in how the hand and the things around it were measured."""
        self._hand = state
        for k, pose in enumerate(state.poses):
            known = self._moved.get(k)
            if has_moved(known and known[1], pose):
                self._moved[k] = self._reports + 1, pose

    def measured(self, q: Array, *, now: float, at: float | None = None) -> bool:
        """Take in measured joints; where one is too far from its reference, the robot stops.

        What isn't sound is left out; where nothing else comes for `BLIND` seconds, the robot brakes.

        Args:
            q: Joints [rad], (n,): anything.
            now: By the robot's clock [s].
            at: When it was to be there, where that's another time [s].

        Returns:
            Whether it stops for that, and is to be held where it was measured.
        """
        if not self._monitor.look(q, now=now):
            return self._violated(self._monitor.blind(now=now), now)
        at = now if at is None else at
        p = float(self.play_at(np.array([at])).p[0])
        self._measured, self._measured_at = np.array(q, float), (at, p)
        reference = self.engine.timeline.sample(p)
        self._samples.add(at, p, self._measured, reference)
        abort = too_far(reference, self._measured, self.config.tolerance, self._prismatic)
        return self._violated(abort, now, measured=self._measured)

    def _violated(self, violation: Violation | None, now: float, measured: Array | None = None) -> bool:
        """Stop for what was measured, if it's something; whether it's to be held where it was measured."""
        if violation is None or self.halted or self.epoch == 0:
            return False
        self.violation = violation
        self.halt(str(violation), now=now, measured=measured)
        return measured is not None

    @override
    def halt(self, reason: str, *, now: float, measured: Array | None = None) -> None:
        """Stop at once, and wait for a new epoch; who has stopped already only lets itself be held elsewhere.

        Args:
            reason: What to report.
            now: By the robot's clock [s].
            measured: Where to hold the arm [rad], (n,), when it's not where it should be; without it the arm brakes
                from its reference, within the limits.
        """
        if self.halted and measured is None:
            return
        play = self.play_at(np.array([now]))
        p, limits, timeline = float(play.p[0]), self.engine.limits, self.engine.timeline
        if measured is not None:
            timeline = timeline.edited(p, [hold(_SETTLE, np.clip(measured, limits.q_min, limits.q_max))])
            self._held_since = p
        elif play.pace[0] == 1.0 and play.rate[0] == 0.0:
            timeline = from_commanded(timeline, p, limits).timeline
        else:
            # At another pace the arm moves at other speeds than the plan says.
            state = State(*(row[0] for row in self.reference(play)))
            timeline = timeline.edited(p, [piece(stop(state, Profile.PARABOLIC, limits)[0], HOLD)])
        self._clock = ManualClock(p)
        self._renew(now, timeline=timeline, clock=self._clock)
        # What the next epoch puts after this end isn't played before that begins.
        self._play = EvenPlay(p - now, end=timeline.end)
        self._plays.append((now, self._play))
        self.halted, self.parted = self.halted or reason, True
        self._due = now
        self._stop_watching(StopReason.FAULT if self.violation is None else StopReason.TOLERANCE, now)

    def _play_at(self, now: float) -> float:
        return float(self._play.at(np.array([now])).p[0])

    @override
    def _report(self, now: float) -> Report:
        p, pace, _ = self._play.at(np.array([now]))
        plan = self._plan_from(float(p[0])) if self.parted else None
        q = self._measured.copy()
        q.flags.writeable = False
        return Report(
            cast("Epoch", self.epoch), self._reports, now, self._log.executed, float(p[0]), float(pace[0]), q,
            *self._measured_at, self._newest, self.halted, self._told(), plan,
            self.engine.timeline.sample(self._measured_at[1]), self._uncertainty, self._samples.take(),
            self._samples.oldest, self._hand_report(),
        )  # fmt: skip

    def _hand_report(self) -> HandReport | None:
        """The hand, and the things that have moved in the reports just before; now and then all of them."""
        hand = self._hand
        if hand is None:
            return None
        all_of_them = self._reports % _AGAIN == 0
        things = tuple(
            (k, pose)
            for k, pose in enumerate(hand.poses)
            if all_of_them or self._moved[k][0] > self._reports - _REPEAT
        )
        return HandReport(hand.opening, hand.goal, hand.holds, things)

    def _told(self) -> tuple[tuple[int, Receipt], ...]:
        """Receipts for a report: new ones, those of the reports just before, and now and then the oldest."""
        told = []
        for since, number, receipt in reversed(self._receipts):
            if since <= self._reports - _REPEAT:
                break
            told.append((number, receipt))
        if self._reports % _AGAIN == 0:
            told += [(number, receipt) for _, number, receipt in islice(self._receipts, _OLDEST)]
        return tuple(told)

    def _plan_from(self, p: float) -> PlanPart:
        timeline = self.engine.timeline
        low = max(timeline.index_at(max(p, self._held_since)), 0)
        high = min(low + SEGMENTS_MOST, len(timeline))
        since = timeline.start_of(low) if low < len(timeline) else timeline.end
        segments = tuple(timeline.segment(i) for i in range(low, high))
        return PlanPart(timeline.version, since, timeline.sample(since), segments=segments)


@dataclass(frozen=True, slots=True)
class RobotHostConfig(HostConfig):
    """How an arm's end of a connection behaves."""

    site: RobotSiteConfig = field(default_factory=RobotSiteConfig)
    """How its site behaves."""

    def decided(self) -> RobotSiteConfig:
        """How the site behaves that decides a lead ahead: a stop at T_loss is decided that much sooner."""
        watchdog = self.site.watchdog
        if watchdog is None:
            return self.site
        return replace(self.site, watchdog=replace(watchdog, timeout=max(watchdog.timeout - self.lead, 0.1)))


class RobotHost(Host[FollowingArm, Orders, Report]):
    """An arm's end of a connection: what its body is to do are joints.

    Everything is decided some `lead` ahead of the robot's clock: what the body has been given for the next ticks
    never changes.
    """

    orders = Orders

    def __init__(
        self, model: RobotModel, q: Array, *, now: float, config: RobotHostConfig | None = None, seed: int = 0
    ) -> None:
        """Stand at rest, and wait for an operator.

        Args:
            model: The robot.
            q: Joints [rad], (n,).
            now: By the robot's clock [s].
            config: How to behave.
            seed: Random number in [0, 2**32), new for each life of the robot: echoes of an earlier one don't count.
        """
        self.config = RobotHostConfig() if config is None else config
        super().__init__(self._site_from, self.config, now=now, seed=seed)
        self._model = model
        self._q, self._opening = np.array(q, float), math.inf
        self._hand: HandState | None = None

    def _site_from(self, t: float) -> FollowingArm:
        site = replace(self.config.site, watchdog=self.watchdog(self.config.site.watchdog))
        config = replace(self.config, site=site).decided()
        reported = max(0, math.floor(1000.0 * t))
        made = FollowingArm(self._model, self._q, now=t, config=config, reported=reported, opening=self._opening)
        if self._hand is not None:
            made.hand(self._hand)
        return made

    @override
    def _left(self, now: float) -> None:
        # A stop near a limit may end beyond it by rounding, and no engine begins there.
        limits = self._model.limits
        self._q = np.clip(self.reference(np.array([now])).q[0], limits.q_min, limits.q_max)
        self._opening = float(self.openings(np.array([now]))[0])

    def openings(self, t: Array) -> Array:
        """What the hand is told at ascending times of the robot's clock [s] if no more is heard [m], (k,)."""
        if self.site is None:
            return np.full(len(t), self._opening)
        return self.site.openings(self.site.foreseen(np.asarray(t, float) + self.offset))

    def hand(self, state: HandState) -> None:
        """Take in how the hand and the things around it were measured."""
        self._hand = state
        if self.site is not None:
            self.site.hand(state)

    def reference(self, t: Array) -> JointReference:
        """What the body is to do, (k, n) each, at ascending times of the robot's clock [s] if no more is heard."""
        if self.site is None:
            still = np.zeros((len(t), len(self._q)))
            return JointReference(still + self._q, still, still)
        play = self.site.foreseen(np.asarray(t, float) + self.offset)
        return self.site.reference(play)

    def measured(self, q: Array, *, at: float, now: float) -> bool:
        """Take in measured joints.

        Args:
            q: Joints [rad], (n,).
            at: When they were to be there, by the robot's clock [s].
            now: By the robot's clock [s].

        Returns:
            Whether one is too far away, so that the robot stops and is to be held where it was measured.
        """
        return self.site is not None and self.site.measured(q, now=self.site_time(now), at=at + self.offset)

    def fault(self, reason: str, q: Array, *, now: float) -> None:
        """Stop, for the body has left its references by itself.

        Args:
            reason: What to report.
            q: Where it will rest [rad], (n,).
            now: By the robot's clock [s].
        """
        if self.site is None:
            self._q = np.array(q, float)
        else:
            self.site.halt(reason, now=self.site_time(now), measured=q)
