"""The place that a viewer shows: paces, loops, steps, and the way back to live."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.clients.playhead import LiveEdge, Mode, PlayHead
from vrs.errors import InvalidValueError


class TestPlayHead:
    def head(self, offset=-0.2, span=(0.0, 30.0)):
        return PlayHead(lambda now: now + offset, lambda: span)

    def test_it_stays_within_the_timeline(self):
        head = self.head(span=(0.0, 5.0))
        head.seek(-3.0, now=20.0)
        assert head.position(20.0) == 0.0
        head.seek(100.0, now=20.0)
        assert head.position(20.0) == 19.8
        head.rewind(now=20.0, rate=10)
        assert head.position(30.0) == 0.0

    def test_rates_out_of_range_are_refused_and_change_nothing(self):
        head = self.head()
        for rate in (0.0, -0.0, 11.0, -10.1, np.nan, np.inf, True, "1"):
            with pytest.raises(InvalidValueError):
                head.play(now=1.0, rate=rate)
            with pytest.raises(InvalidValueError):
                head.set_rate(rate, now=1.0)
        assert (head.mode, head.rate) == (Mode.LIVE, 1.0)
        head.pause(now=1.0)
        head.set_rate(3.0, now=2.0)
        assert head.position(9.0) == 0.8

    @settings(max_examples=200, deadline=None)
    @given(
        place=st.floats(0, 60),
        rate=st.sampled_from([0.0, 0.1, 1.0, 5.0, 10.0, -0.1, -1.0, -10.0]),
        wait=st.floats(0, 2),
        again=st.floats(0.01, 0.99),
    )
    def test_going_live_never_jumps_from_anywhere(self, place, rate, wait, again):
        head = self.head(span=(0.0, 60.0))
        head.seek(place, now=30.0)
        head.pause(now=30.0) if rate == 0 else head.play(now=30.0, rate=rate)
        now = 30.0 + wait
        begin = head.position(now)
        done = head.go_live(now=now)
        middle = now + again * (done - now)
        head.position(middle)
        assert head.go_live(now=middle) >= middle
        done = head.go_live(now=middle)
        t = np.linspace(middle, done, 400)
        seen = np.array([head.position(x) for x in t])
        if done > middle:
            pace = np.diff(seen) / np.diff(t)
            assert np.abs(pace).max() <= 10.0 + 1e-6
            assert pace.min() >= -1e-6 or begin > now - 0.2
        assert seen[-1] == pytest.approx(done - 0.2, abs=1e-6)
        assert head.mode is Mode.LIVE

    @pytest.mark.parametrize("rate", [0.0, 0.5, 10.0, -5.0])
    def test_until_what_it_needs_has_come_it_goes_on_as_before(self, rate):
        head = self.head()
        head.seek(12.0, now=30.0)
        head.pause(now=30.0) if rate == 0 else head.play(now=30.0, rate=rate)
        done = head.go_live(now=30.0, wait=0.4)
        t = np.linspace(30.0, done, 2000)
        seen = np.array([head.ahead(x) for x in t])
        first = t <= 30.4
        assert np.abs(seen[first] - (12.0 + rate * (t[first] - 30.0))).max() < 1e-9
        assert np.abs(np.diff(seen) / np.diff(t)).max() <= 10 + 1e-6
        assert head.mode is Mode.CATCHING_UP
        assert head.position(done) == pytest.approx(done - 0.2)
        assert head.mode is Mode.LIVE

    def test_steps_stay_in_the_timeline_and_stand(self):
        head = self.head()
        head.step(-0.5, now=10.0)
        assert (head.mode, head.position(10.0)) == (Mode.PAUSED, pytest.approx(9.3))
        head.step(-100.0, now=11.0)
        assert head.position(20.0) == 0.0
        head.step(1e6, now=12.0)
        assert head.position(99.0) == 30.0
        with pytest.raises(InvalidValueError):
            head.step(np.nan, now=1.0)

    @settings(max_examples=200, deadline=None)
    @given(
        low=st.floats(0, 20),
        length=st.floats(0.01, 9.0),
        rate=st.floats(-10, 10).filter(lambda rate: abs(rate) > 1e-3),
        place=st.floats(0, 30),
        waits=st.lists(st.floats(0, 5), min_size=1, max_size=8),
    )
    def test_a_loop_is_never_left_and_takes_its_time(self, low, length, rate, place, waits):
        head = self.head(span=(0.0, 30.0))
        head.seek(place, now=40.0)
        head.play(now=40.0, rate=rate)
        head.set_loop(low, low + length, now=40.0)
        high = head.loop[1]
        inside = low <= place <= high
        begin = place if inside else (low if rate > 0 else high)
        now = 40.0
        for wait in waits:
            now += wait
            t = head.position(now)
            assert low - 1e-9 <= t <= high + 1e-9
            off = (t - begin - rate * (now - 40.0)) % (high - low)
            assert min(off, high - low - off) < 1e-7
            assert head.mode is Mode.PLAYING
            assert head.ahead(now) == t

    def test_a_loop_about_the_live_edge_isnt_left_for_it(self):
        head = self.head()
        head.seek(1.0, now=5.0)
        head.play(now=5.0, rate=2.0)
        head.set_loop(0.0, 20.0, now=5.0)
        # At 8.8 s the live edge is caught up with, and passed.
        assert head.position(9.0) == pytest.approx(9.0)
        assert head.mode is Mode.PLAYING
        assert head.position(15.0) == pytest.approx(1.0)
        head.clear_loop(now=15.0)
        assert head.position(40.0) == pytest.approx(39.8)
        assert head.mode is Mode.LIVE

    def test_what_was_live_plays_a_loop_from_its_start(self):
        head = self.head()
        head.set_loop(2.0, 20.0, now=10.0)
        assert (head.mode, head.position(10.0)) == (Mode.PLAYING, 2.0)

    def test_what_is_sought_behind_a_loop_runs_freely_and_before_it_runs_in(self):
        head = self.head()
        head.set_loop(5.0, 6.0, now=40.0)
        head.seek(8.0, now=41.0)
        assert head.position(43.0) == pytest.approx(10.0)
        head.seek(4.0, now=43.0)
        assert head.position(43.5) == pytest.approx(4.5)
        assert head.position(46.25) == pytest.approx(5.25)
        head.play(now=46.25, rate=-1.0)
        assert head.position(46.75) == pytest.approx(5.75)
        head.pause(now=46.75)
        head.set_loop(1.0, 2.0, now=47.0)
        assert (head.mode, head.position(60.0)) == (Mode.PAUSED, 2.0)
        head.go_live(now=60.0)
        assert head.loop is None
        assert head.position(90.0) == pytest.approx(89.8)

    def test_loops_of_nothing_are_refused_and_change_nothing(self):
        head = self.head()
        head.seek(3.0, now=40.0)
        for start, end in ((5.0, 5.0), (6.0, 5.0), (np.nan, 5.0), (-9.0, -1.0), (50.0, 60.0), (1.0, 1.009)):
            with pytest.raises(InvalidValueError):
                head.set_loop(start, end, now=40.0)
        assert head.loop is None
        assert head.position(41.0) == pytest.approx(4.0)
        head.set_loop(-5.0, 2.0, now=41.0)
        assert head.loop == (0.0, 2.0)

    def test_where_nothing_is_live_it_begins_at_the_start_and_stops_at_the_end(self):
        head = PlayHead(lambda now: -np.inf, lambda: (2.0, 9.0))
        assert head.position(0.0) == 2.0
        head.seek(3.0, now=0.0)
        assert head.go_live(now=1.0) == 1.0
        head.play(now=1.0, rate=4.0)
        assert head.position(60.0) == 9.0
        assert head.mode is Mode.PLAYING

    def test_nothing_is_shown_before_anything_is_known(self):
        head = PlayHead(lambda now: None, lambda: None)
        head.pause(now=0.0)
        assert head.position(0.0) is None
        assert head.go_live(now=1.0) == 1.0


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 2**31), spread=st.floats(0, 2))
def test_the_live_edge_never_runs_back_nor_beyond_the_quickest_message(seed, spread):
    rng = np.random.default_rng(seed)
    edge = LiveEdge()
    sent = np.arange(0, 60, 0.1)
    arrivals = sorted((t + 0.1 + rng.exponential(spread), t) for t in sent.tolist())
    last = -np.inf
    for arrived, t in arrivals:
        edge.heard(t, now=arrived)
        place = edge.at(arrived)
        assert place >= last - 1e-9
        assert place <= arrived - 0.1 + 1e-9
        last = place
