"""The watchdog as a state machine: hypothesis looks for a short schedule that breaks a law."""

from __future__ import annotations

import os
import pickle

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule, run_state_machine_as_test

from robots.onboard.watchdog import (
    AcceptedFuture,
    BeginStop,
    GoOn,
    Kind,
    LossPolicy,
    Manner,
    Stamp,
    StopReason,
    Verdict,
    Watchdog,
    WatchdogConfig,
    WatchdogState,
)

SCHEDULES = int(os.environ.get("VRS_WATCHDOG_SCHEDULES", "100"))


class WatchdogMachine(RuleBasedStateMachine):
    """Any schedule of messages, losses, duplicates and reorderings; a plain record says what must come of it."""

    @initialize(
        policy=st.sampled_from(LossPolicy),
        future=st.sampled_from(AcceptedFuture),
        timeout=st.sampled_from((0.1, 0.25, 0.5, 2.0)),
        max_age=st.sampled_from((0.05, 0.5, 2.0)),
    )
    def begin(self, policy: LossPolicy, future: AcceptedFuture, timeout: float, max_age: float) -> None:
        self.config = WatchdogConfig(timeout=timeout, policy=policy, future=future, max_age=max_age, window=64)
        self.dog = Watchdog(self.config, epoch=7)
        self.ms = 0
        self.wall = 0.0
        self.sent: list[Stamp] = []
        self.epoch, self.live, self.next, self.first = 7, False, 0, 0
        self.executed: set[tuple[int, int]] = set()
        self.fed: float | None = None
        self.known = 0
        self.way: BeginStop | None = None
        self.resting = True

    @property
    def now(self) -> float:
        return self.ms / 1000

    def lapse(self) -> None:
        """What time alone does, by the record."""
        if self.fed is not None and self.now >= self.fed + self.config.timeout:
            self.fed = None

    @rule(ms=st.integers(0, 60) | st.integers(0, 900), look=st.booleans(), rest=st.none() | st.floats(-1, 2))
    def time_passes(self, ms: int, look: bool, rest: float | None) -> None:
        self.ms += ms
        if not look:
            return
        due = None if self.fed is None else self.fed + self.config.timeout
        self.lapse()
        for action in self.dog.advance(now=self.now, rest_at=None if rest is None else self.now + rest):
            assert action.at == self.now
            if isinstance(action, GoOn):
                assert action.epoch == self.epoch
                self.way, self.resting = None, False
                continue
            assert action.due <= self.now
            if action.manner is Manner.FINISH:
                assert action.reason is StopReason.LINK_LOSS
                assert rest is not None
                assert self.now + rest <= action.due + self.config.timeout
                assert self.config.future is AcceptedFuture.FINISH
            if due is not None and self.fed is None and self.dog.reason is StopReason.LINK_LOSS:
                assert action.due == due
            assert action.number > self.known
            self.known, self.way, self.resting = action.number, action, False
        running = self.dog.state is WatchdogState.RUNNING
        assert running == (self.fed is not None)
        if self.way is not None and self.way.manner is Manner.FINISH and self.dog.state is WatchdogState.STOPPING:
            assert self.now < self.way.due + self.config.timeout
        deadline = self.dog.next_deadline()
        assert deadline is None or deadline > self.now

    @rule(step=st.sampled_from((0.0, 3600.0, -3600.0, 0.3)))
    def the_wall_clock_steps(self, step: float) -> None:
        self.wall = step

    @rule(kind=st.sampled_from(Kind), skip=st.integers(1, 3), seen=st.booleans())
    def send(self, kind: Kind, skip: int, seen: bool) -> None:
        answers = (self.dog.number if seen else 1) or 1
        self.sent.append(
            Stamp(self.epoch, self.next, self.now + self.wall, kind, answers if kind is Kind.RESUME else None)
        )
        self.next += skip

    @precondition(lambda self: self.sent)
    @rule(back=st.integers(0, 3) | st.integers(0, 80), authentic=st.sampled_from((True, True, True, False)))
    def deliver(self, back: int, authentic: bool) -> None:
        stamp = self.sent[max(len(self.sent) - 1 - back, 0)]
        before, known = pickle.dumps(self.dog), self.fed
        reason, state, number = self.dog.reason, self.dog.state, self.dog.number
        self.lapse()
        lapsed = known is not None and self.fed is None
        verdict = self.dog.heard(stamp, now=self.now, authentic=authentic)
        age = self.now - stamp.issued_at
        gate = self.config.policy is LossPolicy.HOLD or -1e-6 <= age <= self.config.max_age
        mine = self.live and stamp.epoch == self.epoch and stamp.sequence >= self.first
        newest = max((s for e, s in self.executed if e == self.epoch), default=-1)
        new = (stamp.epoch, stamp.sequence) not in self.executed and stamp.sequence > newest - 64
        good = authentic and gate and mine and new
        if lapsed:
            reason, state, number = StopReason.LINK_LOSS, WatchdogState.STOPPING, number + 1
        goes_on = self.config.policy is LossPolicy.HOLD and reason is StopReason.LINK_LOSS
        if not good:
            assert not verdict.counts
        elif self.fed is not None:
            assert verdict is Verdict.FRESH
        elif stamp.kind is Kind.RESUME:
            resumed = state is WatchdogState.HALTED and stamp.answers == number
            assert (verdict is Verdict.FRESH) == resumed
            self.first = stamp.sequence if resumed else self.first
        elif stamp.kind is Kind.HEARTBEAT:
            assert verdict is Verdict.NOTED
        else:
            assert verdict is (Verdict.FRESH if goes_on else Verdict.HALTED)
        if verdict.counts:
            self.executed.add((stamp.epoch, stamp.sequence))
        elif not lapsed:
            assert pickle.dumps(self.dog) == before
        if verdict is Verdict.FRESH:
            self.fed = self.now

    @rule(number=st.integers(-1, 1))
    def the_robot_rests(self, number: int) -> None:
        self.lapse()
        stopping = self.dog.state is WatchdogState.STOPPING
        done = self.dog.stopped(self.known + number, now=self.now)
        assert not done or (stopping and number == 0)
        self.resting = self.resting or done

    @rule(ahead=st.integers(-1, 3))
    def arm(self, ahead: int) -> None:
        # An old epoch is refused, and what's refused changes nothing: nobody has looked at the time then.
        if ahead > 0:
            self.lapse()
        resting = self.dog.state in (WatchdogState.WAITING, WatchdogState.HALTED)
        verdict = self.dog.arm(self.epoch + ahead, now=self.now)
        if ahead <= 0:
            assert verdict is Verdict.STALE_EPOCH
        else:
            assert (verdict is Verdict.FRESH) == resting
        if verdict is Verdict.FRESH:
            assert self.resting
            self.epoch, self.live, self.next, self.first, self.fed = self.epoch + ahead, True, 0, 0, self.now

    @rule(reason=st.sampled_from([r for r in StopReason if r is not StopReason.LINK_LOSS]), end=st.booleans())
    def stop(self, reason: StopReason, end: bool) -> None:
        if end:
            self.dog.disarm(now=self.now)
            self.live = False
        else:
            self.dog.stop(reason, now=self.now)
        self.fed = None
        assert self.dog.state is WatchdogState.STOPPING


def test_any_schedule_keeps_the_laws() -> None:
    chosen = settings(max_examples=SCHEDULES, stateful_step_count=40, deadline=None)
    run_state_machine_as_test(WatchdogMachine, settings=chosen)
