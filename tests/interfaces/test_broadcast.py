"""Broadcasters, and what delays do to commands and frames: Figs 4 to 6 of Doulgeri et al. in small."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces import Designer, Viewer
from interfaces.engine_server.broadcast import RANGES, Broadcaster, ranges, status_of
from interfaces.messages import FrameStatus, FrameVerdict, ViewForm
from tests.interfaces.joined import HOME, MODEL, Joined, constant, to
from vrs import Engine, ManualClock
from vrs.errors import InvalidValueError

D_F, D_B = 0.3, 0.2


def run(D: float, lead: float, form: ViewForm, ahead: float = 0.0):
    """Ten commands, a half second apart, over constant delays."""
    joined = Joined(D=D)
    joined.site.broadcast(50, lead=lead)
    port = joined.remote(constant(D_F), constant(D_B))
    designer = joined.add(Designer(port))
    viewer = joined.add(Viewer(port, rate=50, form=form, lead=lead if form is ViewForm.SEGMENTS else 0.0))
    joined.run(2.0)
    for k in range(10):
        designer.issue(to(k, speed=0.4), now=joined.now, execute_in=ahead)
        joined.run(0.5)
    joined.run(4.0)
    ages = [shown.age for shown in viewer.history if shown.shown_at > 1.0]
    late = [issued.receipt.execute_at - issued.receipt.asked_at for issued in designer.history]
    assert len(ages) > 400
    return ages, late, viewer, joined


@pytest.mark.parametrize("form", list(ViewForm))
class TestDelays:
    def test_fig_4_unshifted_clocks(self, form):
        ages, late, _, _ = run(0.0, 0.0, form)
        assert min(ages) >= D_B - 1e-8
        assert max(ages) <= D_B + 0.02 + 1e-8
        assert min(late) >= D_F - 1e-8
        _, late, _, _ = run(0.0, 0.0, form, ahead=D_F)
        assert max(late) == 0
        _, late, _, _ = run(0.0, 0.0, form, ahead=D_F - 0.001)
        assert min(late) > 0

    def test_fig_5_the_engines_clock_behind_by_the_forward_delay(self, form):
        ages, late, _, _ = run(-D_F, 0.0, form)
        assert max(late) == 0
        assert min(ages) >= D_F + D_B - 1e-8
        assert max(ages) <= D_F + D_B + 0.02 + 1e-8

    def test_predicted_transmission(self, form):
        ages, late, viewer, joined = run(-D_F, D_F + D_B, form)
        assert max(late) == 0
        assert min(ages) >= -1e-8
        assert max(ages) <= 0.02 + 1e-8
        assert 0.2 < viewer.share_falsified < 0.9
        _, _, early, _ = run(-D_F, D_F + D_B, form, ahead=D_F + D_B + 0.1)
        assert early.share_falsified == 0
        for shown in viewer.history[:-50]:
            true = np.abs(shown.q - joined.engine.joints(shown.t)).max() <= (
                1e-5 if form is ViewForm.COMPACT else 1e-9
            )
            assert shown.status is (FrameStatus.CONFIRMED if true else FrameStatus.FALSIFIED)

    def test_fig_6_the_engines_clock_ahead_by_the_backward_delay(self, form):
        ages, late, _, _ = run(D_B, 0.0, form)
        assert min(ages) >= -1e-8
        assert max(ages) <= 0.02 + 1e-8
        assert min(late) >= D_F + D_B - 1e-8


def make(rate: float = 50.0, **options):
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=HOME, clock=clock)
    return engine, clock, Broadcaster(engine, rate=rate, **options)


def tick(clock, broadcaster, seconds):
    """Advance at each deadline; the messages."""
    messages = []
    end = clock.now() + seconds
    while True:
        messages += broadcaster.advance(now=clock.now())
        due = broadcaster.next_deadline()
        if due > end:
            clock.set(end)
            return messages
        clock.set(max(due, clock.now()))


class TestBroadcaster:
    def test_frames_come_at_the_rate_and_show_g(self):
        engine, clock, broadcaster = make(60.0, lead=0.25)
        engine.execute(to(1, execute_at=0.5))
        messages = tick(clock, broadcaster, 2.0)
        assert len(messages) == 121
        for k, message in enumerate(messages):
            frame = message.frame
            assert (frame.number, frame.made_at) == (k + 1, pytest.approx(k / 60, abs=1e-12))
            assert frame.t == frame.made_at + 0.25
            assert np.array_equal(frame.q, engine.joints(frame.t))

    def test_overdue_frames_are_no_burst(self):
        _, clock, broadcaster = make(50.0)
        tick(clock, broadcaster, 0.1)
        clock.advance(10.0)
        messages = tick(clock, broadcaster, 0.0)
        assert len(messages) == 1
        assert messages[0].frame.t == clock.now()
        assert broadcaster.skipped == pytest.approx(499, abs=2)
        assert len(tick(clock, broadcaster, 1.0)) in (50, 51)

    def test_a_slow_client_costs_a_slot_and_slows_nobody(self):
        _, clock, broadcaster = make(50.0)
        slow, quick = broadcaster.join(), broadcaster.join()
        taken = 0
        for _ in range(200):
            tick(clock, broadcaster, 0.02)
            taken += quick.take() is not None
        assert taken >= 197
        assert taken + quick.missed == broadcaster.number
        newest = slow.take()
        assert newest.frame.number == broadcaster.number
        assert slow.take() is None
        assert slow.missed == broadcaster.number - 1
        broadcaster.leave(slow)
        broadcaster.leave(slow)
        assert broadcaster.viewers == 1

    def test_each_message_says_what_became_of_the_frames_before(self):
        engine, clock, broadcaster = make(50.0, lead=0.5)
        messages = tick(clock, broadcaster, 1.0)
        assert [message.frame.status for message in messages] == [FrameStatus.PREDICTED] * len(messages)
        r = engine.execute(to(1, execute_at=1.2))
        messages += tick(clock, broadcaster, 0.1)
        engine.execute(to(2, execute_at=1.3))
        messages += tick(clock, broadcaster, 2.0)
        newest = messages[-1].verdicts
        falsified = [
            m for m in messages if status_of(m.frame.number, newest) == FrameVerdict(m.frame.number, "falsified", 1)
        ]
        assert [m.frame.t for m in falsified] == [m.frame.t for m in messages[:51] if m.frame.t > 1.2 + 1e-4]
        assert r.command_id == 1
        for message in messages[:-30]:
            verdict = status_of(message.frame.number, newest)
            true = np.abs(engine.joints(message.frame.t) - message.frame.q).max() <= 1e-9
            assert verdict.status is (FrameStatus.CONFIRMED if true else FrameStatus.FALSIFIED)
            assert broadcaster.status(message.frame.number) == verdict
        assert {by for _, _, by in newest.falsified} == {1, 2}
        assert status_of(messages[-1].frame.number, newest) is None

    def test_what_frames_say_of_others_stays_small(self):
        engine, clock, broadcaster = make(50.0, lead=0.3)
        most = 0
        for k in range(400):
            engine.execute(to(k, execute_at=clock.now() + 0.1))
            for message in tick(clock, broadcaster, 0.15):
                most = max(most, len(message.verdicts.falsified))
                listed = message.verdicts.falsified
                assert not listed or listed[0][0] >= message.verdicts.since
        assert most == RANGES
        assert len(broadcaster.falsified) <= 4096

    def test_ranges(self):
        def by(*pairs):
            return [FrameVerdict(number, FrameStatus.FALSIFIED, command) for number, command in pairs]

        assert ranges(by((4, 1), (3, 1), (5, 2), (9, 2))) == (((3, 4, 1), (5, 5, 2), (9, 9, 2)), 0)
        many, left_out = ranges(by(*((2 * k, k) for k in range(1, 101))))
        assert (len(many), left_out) == (RANGES, 2 * (100 - RANGES))

    def test_several_rates_on_one_engine(self):
        joined = Joined()
        broadcasters = [joined.site.broadcast(rate) for rate in (10, 25, 60)]
        joined.run(5.0)
        assert [b.number for b in broadcasters] == [51, 126, 301]

    def test_misuse(self):
        engine = Engine(MODEL)
        for options in ({"rate": 0.0}, {"rate": np.nan}, {"rate": 50, "lead": 61}, {"rate": 50, "lead": np.inf}):
            with pytest.raises(InvalidValueError):
                Broadcaster(engine, **options)

    def test_a_viewer_gets_the_broadcaster_of_the_nearest_rate(self):
        joined = Joined()
        for rate in (10, 30, 60):
            joined.site.broadcast(rate)
        viewers = [joined.add(Viewer(joined.local(), rate=rate, form=ViewForm.FRAMES)) for rate in (5, 26, 1000)]
        joined.run(1.0)
        assert [viewer.scene.rate for viewer in viewers] == [10, 30, 60]
        assert np.abs(viewers[2].history[-1].q - joined.engine.joints()).max() == 0
