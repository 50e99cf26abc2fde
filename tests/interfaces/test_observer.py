from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from interfaces import Designer, Observer, Supervisor
from interfaces.clients.observer import PENDING
from interfaces.clients.ports import RemotePort
from interfaces.engine_server.forecasts import Forecasts
from interfaces.engine_server.journal import Journal
from interfaces.engine_server.site import Site, engine_time
from interfaces.messages import Answer, Frame, FrameStatus
from interfaces.runtime.laboratory import run_parts
from tests.interfaces.joined import HOME, MODEL, Joined, bad, constant, place, to
from tests.memory import values_held
from vrs import Engine, JointTarget, ManualClock, MotionCommand, Stop
from vrs.errors import InvalidValueError, NonFiniteTimeError

PREDICTED, CONFIRMED, FALSIFIED = FrameStatus.PREDICTED, FrameStatus.CONFIRMED, FrameStatus.FALSIFIED


@pytest.fixture(params=["local", "instant", "delayed"])
def pair(request) -> tuple[Joined, Supervisor]:
    delay = 0.2 if request.param == "delayed" else 0.0
    joined = Joined()
    port = joined.local() if request.param == "local" else joined.remote(constant(delay), constant(delay))
    return joined, joined.add(Supervisor(port))


class TestEveryPort:
    def test_any_time_is_answered_by_g(self, pair):
        joined, supervisor = pair
        supervisor.issue(to(1), now=joined.now, execute_in=0.5)
        joined.run(1.0)
        numbers = {t: supervisor.ask(t, now=joined.now) for t in (-5.0, 0.0, 0.7, 1.1, 30.0)}
        joined.run(1.0)
        for t, number in numbers.items():
            frame = supervisor.observation(number).frame
            assert frame.t == t
            assert np.array_equal(frame.q, joined.engine.joints(t))
            assert not frame.q.flags.writeable

    def test_the_past_is_confirmed_the_future_predicted_until_it_is_past(self, pair):
        joined, supervisor = pair
        joined.run(1.0)
        past, future = (supervisor.ask(t, now=joined.now) for t in (0.5, 4.0))
        joined.run(0.5)
        assert supervisor.observation(past).status is CONFIRMED
        assert supervisor.observation(future).status is PREDICTED
        joined.run(4.0)
        assert supervisor.observation(future).status is CONFIRMED
        assert supervisor.observer.share_falsified == 0

    def test_the_first_command_that_changes_it_falsifies_it(self, pair):
        joined, supervisor = pair
        supervisor.issue(to(1), now=joined.now, execute_in=1.0)
        joined.run(0.5)
        before, after = (supervisor.ask(t, now=joined.now) for t in (1.2, 1.6))
        joined.run(0.5)
        for k in (2, 3):
            supervisor.issue(to(k), now=joined.now, execute_in=0.4)
            joined.run(0.01)
        joined.run(2.0)
        assert supervisor.observation(before).status is CONFIRMED
        found = supervisor.observation(after)
        assert (found.status, found.frame.falsified_by) == (FALSIFIED, 2)
        assert supervisor.observer.share_falsified == 0.5

    def test_a_command_taken_back_does_not_make_it_true_again(self, pair):
        joined, supervisor = pair
        number = supervisor.ask(2.0, now=joined.now)
        joined.run(0.5)
        supervisor.issue(to(1), now=joined.now, execute_in=1.0)
        joined.run(0.5)
        supervisor.undo(now=joined.now)
        joined.run(3.0)
        assert np.array_equal(joined.engine.joints(2.0), HOME)
        assert supervisor.observation(number).status is FALSIFIED

    def test_age_and_lateness(self, pair):
        joined, supervisor = pair
        joined.run(1.0)
        number = supervisor.ask(now=joined.now)
        joined.run(1.0)
        found = supervisor.observation(number)
        delay = found.lateness / 2
        assert delay == pytest.approx(0.2) or delay == 0
        assert found.frame.t == pytest.approx(1.0 + delay, abs=2e-9)
        assert found.age == pytest.approx(delay, abs=2e-9)

    def test_edits_that_others_make_are_found(self, pair):
        joined, supervisor = pair
        number = supervisor.ask(2.0, now=joined.now)
        other = supervisor.ask(1.2, now=joined.now)
        joined.run(0.5)
        joined.engine.execute(to(1, execute_at=1.5))
        joined.engine.execute(to(2, execute_at=1.0))
        joined.run(3.0)
        assert supervisor.observation(number).frame.falsified_by in (1, 2)
        assert supervisor.observation(other).frame.falsified_by == 2


def test_two_observers_and_a_designer_share_a_port():
    joined = Joined()
    port = joined.local()
    one, two, designer = Observer(port), Observer(port), Designer(port)
    numbers = one.ask(1.0, now=0.0), two.ask(2.0, now=0.0)
    designer.issue(to(1), now=0.0)
    assert one.observation(numbers[0]).frame.t == 1.0
    assert one.observation(numbers[1]) is None
    assert two.observation(numbers[1]).frame.falsified_by == 1


def test_news_of_another_frame_are_passed_over():
    observer = Observer(Joined().engine)
    number = observer.ask(5.0, now=0.0)
    frame = observer.observation(number).frame
    observer.receive(Answer.showing(replace(frame, q=frame.q + 1, status=CONFIRMED), 6.0), now=6.0)
    assert observer.observation(number).status is PREDICTED
    observer.receive(Answer.showing(replace(frame, status=CONFIRMED), 6.0), now=6.0)
    assert observer.observation(number).status is CONFIRMED


def test_an_offline_engine_promises_nothing():
    engine = Engine(MODEL, q=HOME)
    engine.execute(MotionCommand(JointTarget(place(1)), execute_at=0.0))
    observer = Observer(engine)
    assert observer.observation(observer.ask(0.1, now=0.0)).status is PREDICTED
    now = observer.observation(observer.ask(now=0.0)).frame
    assert now.t == engine.timeline.end


def test_only_finite_times_are_asked_for():
    observer = Observer(Engine(MODEL))
    for t in (np.nan, np.inf):
        with pytest.raises(NonFiniteTimeError):
            observer.ask(t, now=0.0)


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 2**31), loss=st.floats(0, 0.5), duplicate=st.floats(0, 1), mean=st.floats(0.02, 0.4))
def test_over_any_link_every_fate_comes_to_be_known_and_is_true(seed, loss, duplicate, mean):
    joined = Joined()
    link = bad(loss, duplicate, mean)
    supervisor = joined.add(Supervisor(joined.remote(link, link, seed=seed)))
    rng = np.random.default_rng(seed)
    numbers = []
    for k in range(8):
        supervisor.issue(to(k), now=joined.now, execute_in=float(rng.uniform(0.2, 1.5)))
        numbers += [supervisor.ask(joined.now + float(x), now=joined.now) for x in rng.uniform(-0.5, 2.0, 3)]
        joined.run(0.3)
    for _ in range(100):
        found = [supervisor.observation(number) for number in numbers]
        if all(x is not None and x.status is not PREDICTED for x in found):
            break
        joined.run(1.0)
    ids = {receipt.command_id for receipt in joined.engine.receipts}
    for x in found:
        assert x.status is not PREDICTED
        true = np.abs(x.frame.q - joined.engine.joints(x.frame.t)).max() <= 1e-9
        assert true if x.status is CONFIRMED else x.frame.falsified_by in ids


def test_a_question_that_was_given_up_is_sent_no_more():
    port = RemotePort()
    observer = Observer(port, resend=0.3)
    for k in range(PENDING + 10):
        observer.ask(float(k), now=0.001 * k)
        port.advance(now=0.001 * k)
    observer.advance(now=1.2)
    assert port.advance(now=1.2)[0].t == 10.0


def test_a_prediction_is_asked_for_again_when_its_time_has_passed_there():
    """The engine's time may be far behind the user's."""
    port = RemotePort()
    observer = Observer(port, resend=0.3)
    number = observer.ask(4.0, now=10.0)
    port.advance(now=10.0)
    frame = Frame(number, 4.0, 3.0, HOME, PREDICTED)
    observer.receive(Answer.showing(frame, 3.0), now=10.0)
    for now in (10.0, 10.3, 10.9):
        observer.advance(now=now)
        assert port.advance(now=now) == ()
    observer.advance(now=11.0)
    assert [ask.number for ask in port.advance(now=11.0)] == [number]


class TestForecasts:
    def test_they_agree_with_an_edit_by_edit_comparison(self):
        rng = np.random.default_rng(5)
        clock = ManualClock(0.0)
        engine = Engine(MODEL, q=HOME, clock=clock)
        journal, forecasts, seen = Journal(engine), Forecasts(), 0
        shown, truth = {}, {}
        for number in range(1, 400):
            clock.advance(0.02)
            forecasts.settle(clock.now())
            if rng.random() < 0.15:
                command = Stop() if rng.random() < 0.2 else to(number, execute_at=clock.now() + rng.uniform(0, 2))
                journal.execute(command)
                for edit in journal.since(seen):
                    forecasts.edited(edit.timeline, edit.culprit)
                    for n, (t, q) in shown.items():
                        late = t <= clock.now()
                        if not late and n not in truth and np.abs(edit.timeline.sample(t) - q).max() > 1e-9:
                            truth[n] = edit.command_id
                seen = journal.number
            t = clock.now() + rng.uniform(0, 1.5)
            shown[number] = t, engine.joints(t)
            forecasts.add(number, t, shown[number][1], now=clock.now())
        forecasts.settle(1e9)
        assert len(truth) > 50
        for number in shown:
            verdict = forecasts.verdict(number)
            assert verdict.falsified_by == truth.get(number)
            assert (verdict.status is FALSIFIED) == (number in truth)
        assert forecasts.share_falsified == len(truth) / len(shown)

    def test_the_present_is_past(self):
        forecasts = Forecasts()
        assert forecasts.add(1, 2.0, HOME, now=2.0) is CONFIRMED
        assert forecasts.add(2, 2.0 + 1e-9, HOME, now=2.0) is PREDICTED

    def test_memory_is_bounded_and_what_is_dropped_is_counted(self):
        forecasts = Forecasts(window=100)
        for number in range(1, 10_001):
            forecasts.add(number, 1e6 + number, HOME, now=0.0)
        assert forecasts.dropped == forecasts.forgotten == 9900
        assert values_held(forecasts) < 2000
        assert len(forecasts.settle(1e9)) == 100


class TestJournal:
    def test_a_lone_edit_of_others_is_known_exactly(self):
        engine = Engine(MODEL, q=HOME, clock=ManualClock(0.0))
        journal = Journal(engine)
        engine.execute(to(1, execute_at=1.0))
        assert journal.look() == 1
        assert journal.since(0)[0].command_id == 1

    def test_on_a_branch_ids_go_on(self):
        first = Engine(MODEL, q=HOME)
        first.execute(to(1))
        branch = Engine(MODEL, timeline=first.timeline, clock=ManualClock(0.0))
        journal = Journal(branch)
        branch.execute(to(2, execute_at=5.0))
        journal.look()
        assert journal.since(0)[0].culprit(5.5) == 2

    def test_what_is_not_kept_any_more_is_one_edit_by_nobody_known(self):
        engine = Engine(MODEL, q=HOME, clock=ManualClock(0.0))
        journal = Journal(engine)
        for k in range(300):
            journal.execute(to(k, execute_at=1.0))
        assert len(journal.since(100)) == 200
        assert [edit.command_id for edit in journal.since(0)] == [None]
        assert journal.since(300) == ()


class TestDriver:
    def test_times_at_the_engine_are_not_late_by_rounding(self):
        rng = np.random.default_rng(0)
        for t, delay in rng.uniform(0, 1e4, (1000, 2)):
            assert engine_time(t + delay, -delay) <= t

    def test_a_part_that_never_is_quiet_is_found(self):
        class Restless:
            def advance(self, *, now: float) -> None:
                pass

            def next_deadline(self) -> float:
                return -1.0

        with pytest.raises(InvalidValueError, match="deadline"):
            run_parts([Restless()], now=0.0, until=1.0)

    def test_the_clock_of_an_engine_never_runs_back(self):
        site = Site(Engine(MODEL, clock=ManualClock(0.0)))
        assert site.time(2.0) == 2.0
        site.D = -1.0
        assert site.time(2.5) == 2.0
        assert site.time(3.5) == 2.5
