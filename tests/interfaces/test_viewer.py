"""A viewer across a link: play-back, the copy of the timeline, and what it knows of its frames."""

from __future__ import annotations

import itertools
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from interfaces import Supervisor, Viewer
from interfaces.clients.playhead import Mode
from interfaces.clients.ports import LocalPort, MemoryTransport
from interfaces.engine_server.journal import changed, difference
from interfaces.link import Channel, Conditions
from interfaces.messages import FrameStatus, ViewForm
from tests.interfaces.joined import HOME, MODEL, Joined, bad, constant, to
from vrs import (
    Cancel,
    Engine,
    Insertion,
    InsertVia,
    JointTarget,
    ManualClock,
    PolynomialSegment,
    Resume,
    Retime,
    ScaleTime,
    SteerCommand,
    Stop,
    Timeline,
)
from vrs.errors import InvalidValueError

FORMS = list(ViewForm)
NEAR = {ViewForm.SEGMENTS: 1e-9, ViewForm.FRAMES: 1e-9, ViewForm.COMPACT: 1e-5}
"""How far a form's joints may be off [rad]."""


def watched(form: ViewForm, delay: float = 0.1, moves: int = 8, **options):
    """An arm that moves for a long time, and a viewer across a link."""
    joined = Joined()
    joined.site.broadcast(25)
    for k in range(moves):
        joined.engine.execute(to(k, insertion=Insertion.APPEND, speed=0.1))
    port = joined.remote(constant(delay), constant(delay))
    viewer = joined.add(Viewer(port, form=form, rate=options.pop("rate", 50.0), **options))
    return joined, viewer


def places(viewer, since=0.0):
    return np.array([(shown.shown_at, shown.t) for shown in viewer.history if shown.shown_at >= since - 1e-9])


@pytest.mark.parametrize("form", FORMS)
class TestPlayBack:
    def test_it_begins_live_with_the_whole_scene(self, form):
        joined, viewer = watched(form)
        joined.run(2.0)
        assert viewer.mode is Mode.LIVE
        assert viewer.scene.robot == MODEL.name
        assert viewer.scene.segments == len(joined.engine.timeline)
        assert viewer.history[-1].age == pytest.approx(0.1, abs=0.041)

    def test_every_frame_shows_g(self, form):
        joined, viewer = watched(form)
        joined.run(3.0)
        viewer.rewind(now=joined.now, rate=2.0)
        joined.run(1.0)
        viewer.play(now=joined.now, rate=0.5)
        joined.run(2.0)
        viewer.go_live(now=joined.now)
        joined.run(3.0)
        assert len(viewer.history) > 200
        for shown in viewer.history:
            assert np.abs(shown.q - joined.engine.joints(shown.t)).max() < NEAR[form]
            assert not shown.q.flags.writeable

    def test_pause_stands_and_play_goes_on(self, form):
        joined, viewer = watched(form)
        joined.run(3.0)
        viewer.pause(now=joined.now)
        place = viewer.head.position(joined.now)
        joined.run(5.0)
        assert viewer.head.position(joined.now) == place
        assert viewer.history[-1].t == pytest.approx(place, abs=1e-6)
        since = joined.now
        viewer.play(now=joined.now)
        joined.run(2.0)
        seen = places(viewer, since + 0.5)
        assert np.abs(seen[:, 1] - (place + seen[:, 0] - since)).max() < 0.013

    @pytest.mark.parametrize("rate", [-10.0, -4.0, -1.0, -0.1, 0.01, 0.5, 1.0])
    def test_rates(self, form, rate):
        joined, viewer = watched(form)
        joined.run(15.0)
        viewer.seek(12.0, now=joined.now)
        since = joined.now
        viewer.play(now=joined.now, rate=rate)
        joined.run(1.0)
        seen = places(viewer, since + 0.5)
        assert len(seen) >= 20
        assert np.abs(seen[:, 1] - (12.0 + rate * (seen[:, 0] - since))).max() < 0.6 * 0.02 * abs(rate) + 1e-6
        assert np.diff(seen[:, 0]).max() < 0.05

    def test_who_scrubbed_back_is_never_dragged_to_live(self, form):
        joined, viewer = watched(form)
        joined.run(5.0)
        viewer.seek(1.0, now=joined.now)
        viewer.play(now=joined.now, rate=1.0)
        since = joined.now
        supervisor = joined.add(Supervisor(joined.remote(constant(0.05), constant(0.05))))
        for k in range(20):
            supervisor.issue(to(k), now=joined.now, execute_in=0.2)
            joined.run(0.5)
        seen = places(viewer, since + 0.5)
        assert viewer.mode is Mode.PLAYING
        assert np.abs(seen[:, 1] - (1.0 + seen[:, 0] - since)).max() < 0.013
        viewer.pause(now=joined.now)
        joined.run(5.0)
        assert viewer.history[-1].t == pytest.approx(11.0, abs=0.02)

    def test_a_loop_goes_on_while_the_engine_runs(self, form):
        joined, viewer = watched(form)
        joined.run(10.0)
        viewer.set_loop(3.0, 4.0, now=joined.now)
        since = joined.now
        joined.run(6.5)
        assert viewer.mode is Mode.PLAYING
        seen = places(viewer, since + 0.5)
        wanted = 3.0 + (seen[:, 0] - since) % 1.0
        off = np.abs(seen[:, 1] - wanted)
        assert np.minimum(off, 1.0 - off).max() < 0.013
        assert len(seen) > 250
        viewer.clear_loop(now=joined.now)
        joined.run(2.0)
        assert viewer.history[-1].t > 4.5
        for shown in viewer.history:
            assert np.abs(shown.q - joined.engine.joints(shown.t)).max() < NEAR[form]

    def test_steps_stand_a_frame_further(self, form):
        joined, viewer = watched(form)
        joined.run(3.0)
        viewer.seek(1.5, now=joined.now)
        place = 1.5
        for frames in (1, 1, -3, 10, -0.5):
            viewer.step(frames, now=joined.now)
            place += frames / 50
            joined.run(0.5)
            assert viewer.mode is Mode.PAUSED
            assert viewer.history[-1].t == pytest.approx(place, abs=1e-9)

    def test_played_on_to_the_live_edge_it_is_live(self, form):
        joined, viewer = watched(form)
        joined.run(5.0)
        viewer.seek(3.0, now=joined.now)
        viewer.play(now=joined.now, rate=4.0)
        joined.run(0.5)
        assert viewer.mode is Mode.PLAYING
        joined.run(0.7)
        assert viewer.mode is Mode.LIVE
        assert (np.diff(places(viewer, 5.5)[:, 1]) > 0).all()

    @pytest.mark.parametrize("back", [0.3, 3.0, 19.0])
    def test_going_live_is_smooth_and_complete_in_the_stated_time(self, form, back):
        joined, viewer = watched(form)
        joined.run(20.0)
        viewer.seek(joined.now - 0.1 - back, now=joined.now)
        viewer.pause(now=joined.now)
        joined.run(1.0)
        since = joined.now
        done = viewer.go_live(now=joined.now)
        wait = 0.0 if form is ViewForm.SEGMENTS else 0.22
        assert done - since == pytest.approx(wait + max(0.5, 1.5 * (back + 1 + wait) / 8), abs=0.01)
        joined.run(done - since + 0.1)
        assert viewer.mode is Mode.LIVE
        assert viewer.history[-1].age == pytest.approx(0.1, abs=0.041)
        joined.run(1.0)
        seen = places(viewer, since)
        steps, spans = np.diff(seen[:, 1]), np.diff(seen[:, 0])
        assert steps.min() >= 0
        assert steps.max() <= 10 * 0.02 * 1.8
        assert spans.max() < 0.3

    def test_statuses_come_to_be_known_and_are_true(self, form):
        joined = Joined()
        joined.site.broadcast(25, lead=0.0 if form is ViewForm.SEGMENTS else 0.3)
        port = joined.remote(constant(0.1), constant(0.1))
        supervisor = joined.add(Supervisor(port))
        viewer = joined.add(Viewer(port, form=form, lead=0.3 if form is ViewForm.SEGMENTS else 0.0))
        for k in range(20):
            supervisor.issue(to(k), now=joined.now, execute_in=0.15)
            joined.run(0.4)
        joined.run(2.0)
        assert 0 < viewer.share_falsified < 1
        ids = {receipt.command_id for receipt in joined.engine.receipts}
        for shown in viewer.history[:-40]:
            if np.abs(shown.q - joined.engine.joints(shown.t)).max() <= NEAR[form]:
                assert shown.status is FrameStatus.CONFIRMED
            else:
                assert shown.status is FrameStatus.FALSIFIED
                assert shown.falsified_by in ids
                assert joined.engine.receipt(shown.falsified_by).execute_at <= shown.t
        last = viewer.history[-1]
        assert viewer.shown(last.number) is last
        assert viewer.shown(0) is None

    def test_a_late_joiner_sees_all_that_was(self, form):
        joined, early = watched(form)
        joined.run(30.0)
        late = joined.add(Viewer(joined.remote(constant(0.2), constant(0.2), seed=1), form=form))
        joined.run(2.0)
        assert late.scene.start == 0.0
        late.seek(0.5, now=joined.now)
        late.play(now=joined.now, rate=10.0)
        joined.run(2.0)
        seen = [shown for shown in late.history if shown.shown_at > 32.5]
        assert seen[0].t < 10
        for shown in seen:
            assert np.abs(shown.q - joined.engine.joints(shown.t)).max() < NEAR[form]
            assert shown.status is FrameStatus.CONFIRMED
        if form is ViewForm.SEGMENTS:
            t = np.linspace(-1, joined.engine.timeline.end + 1, 3000)
            assert np.abs(late.timeline.sample(t) - joined.engine.joints(t)).max() < 1e-9
            assert early.timeline == late.timeline

    def test_viewers_do_not_touch_each_other(self, form):
        joined = Joined()
        for rate in (10, 25, 60):
            joined.site.broadcast(rate)
        for k in range(8):
            joined.engine.execute(to(k, insertion=Insertion.APPEND, speed=0.1))
        rates = list(itertools.islice(itertools.cycle([5, 10, 20, 25, 50]), 100))
        viewers = [joined.add(Viewer(LocalPort(joined.site), rate=rate, form=form)) for rate in rates]
        ports = [viewer.port for viewer in viewers]
        joined.parts[1:] = [*ports, *viewers]
        joined.run(1.0)
        for k, viewer in enumerate(viewers):
            if k % 2:
                viewer.seek(0.01 * k, now=joined.now)
                viewer.pause(now=joined.now)
        joined.run(1.0)
        for k, viewer in enumerate(viewers):
            if k % 2:
                assert viewer.history[-1].t == pytest.approx(0.01 * k, abs=1e-6)
            else:
                assert viewer.mode is Mode.LIVE
                assert len(viewer.history) >= 0.85 * 2 * min(rates[k], 60)


def test_offline_the_plan_is_played_by_the_users_clock():
    engine = Engine(MODEL, q=HOME)
    receipt = engine.execute(to(1, execute_at=1.0))
    viewer = Viewer(engine)
    viewer.advance(now=0.0)
    viewer.seek(receipt.end, now=0.0)
    assert np.array_equal(viewer.advance(now=0.02)[0].q, engine.joints(receipt.end + 0.02))


EDITS = [
    lambda k, t: to(k, execute_at=t + 0.4),
    lambda k, t: to(k, execute_at=t + 3.0, insertion=Insertion.APPEND),
    lambda k, t: to(k, execute_at=t + 0.1, insertion=Insertion.REPLACE),
    lambda k, t: Retime(max(k - 2, 1), t + 2.0),
    lambda k, t: InsertVia(max(k - 1, 1), JointTarget(HOME + 0.1), 0.02),
    lambda k, t: Cancel(max(k - 1, 1)),
    lambda k, t: ScaleTime(0.8, execute_at=t + 0.2),
    lambda k, t: Stop(execute_at=t + 0.3),
    lambda k, t: Resume(),
    lambda k, t: SteerCommand(rates=[0.2] * 6),
    lambda k, t: None,
]


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    seed=st.integers(0, 2**31),
    loss=st.floats(0, 0.4),
    duplicate=st.floats(0, 1),
    edits=st.lists(st.sampled_from(EDITS), min_size=1, max_size=25),
)
def test_over_any_link_the_copy_becomes_the_timeline(seed, loss, duplicate, edits):
    joined = Joined()
    for k in range(3):
        joined.engine.execute(to(k, insertion=Insertion.APPEND))
    link = bad(loss, duplicate)
    viewer = joined.add(Viewer(joined.remote(link, link, seed=seed)))
    hand = joined.add(Supervisor(joined.local()))
    for k, edit in enumerate(edits):
        joined.run(0.07)
        command = edit(k, joined.now)
        hand.undo(now=joined.now) if command is None else hand.issue(command, now=joined.now)
    t = np.linspace(-1, 40, 1500)
    for _ in range(40):
        joined.run(1.0)
        if viewer.timeline is not None and viewer.segments.edit == joined.site.journal.number:
            break
    assert np.abs(viewer.timeline.sample(t) - joined.engine.joints(t)).max() < 1e-9
    assert [s.command_id for s in viewer.timeline.segments] == [
        s.command_id for s in joined.engine.timeline.segments
    ]
    joined.run(3.0)
    for shown in viewer.history:
        if shown.status is FrameStatus.CONFIRMED:
            assert np.abs(shown.q - joined.engine.joints(shown.t)).max() < 1e-9


def zigzag(count: int) -> Timeline:
    """So many segments of 10 ms."""
    q, segments = HOME, []
    for k in range(count):
        qd = 0.2 * np.sin(0.01 * k * np.arange(1, 7))
        segments.append(PolynomialSegment(0.01 * k, 0.01, np.array([q, qd]), 1 + k // 10))
        q = q + 0.01 * qd
    return Timeline(HOME, 0.0, segments)


def test_a_long_history_comes_in_parts_over_a_bad_link_while_the_arm_moves():
    joined = Joined(timeline=zigzag(5000))
    link = bad(0.3, 0.3)
    viewer = joined.add(Viewer(joined.remote(link, link, seed=2), rate=5))
    for k in range(10):
        joined.run(1.0)
        joined.engine.execute(to(k, insertion=Insertion.APPEND))
    joined.run(30.0)
    t = np.linspace(0, 80, 5000)
    assert len(viewer.timeline) == len(joined.engine.timeline) > 5000
    assert np.abs(viewer.timeline.sample(t) - joined.engine.joints(t)).max() < 1e-9


def test_after_a_long_outage_the_copy_is_fetched_anew():
    joined = Joined()
    port = joined.remote(constant(0.1), constant(0.1))
    viewer = joined.add(Viewer(port, rate=10))
    joined.run(2.0)
    _, transport, _ = joined.parts
    joined.parts.remove(transport)
    for k in range(300):
        joined.site.journal.execute(to(k, execute_at=joined.now + 0.3))
        joined.run(0.02)
    joined.parts.insert(1, transport)
    joined.run(3.0)
    t = np.linspace(0, 20, 2000)
    assert np.abs(viewer.timeline.sample(t) - joined.engine.joints(t)).max() < 1e-9


@pytest.mark.parametrize("index", [0, 50, 99])
def test_a_difference_of_one_segment_is_one_segment(index):
    base = zigzag(100)
    segments = list(base.segments)
    old = segments[index]
    bump = np.zeros((3, 6))
    bump[:2] = old.coefficients
    bump[1] += 0.01
    bump[2] -= 1.0
    segments[index] = PolynomialSegment(old.start, old.duration, bump, old.command_id)
    new = Timeline(HOME, 0.0, segments)
    message = difference(base, new, -np.inf, edit=1, command_id=None)
    assert (message.first, len(message.segments)) == (index, 1)
    assert list(changed(base, message).segments) == segments
    with pytest.raises(InvalidValueError):
        changed(zigzag(90), message)


@pytest.mark.parametrize("form", [ViewForm.FRAMES, ViewForm.COMPACT])
def test_on_a_slow_way_back_no_queue_grows(form):
    joined = Joined()
    joined.site.broadcast(50)
    rng = np.random.default_rng(0)
    back = Channel(Conditions(delay=constant(1.0)), rng)
    transport = MemoryTransport(joined.site, Channel(Conditions(delay=constant(0.1)), rng), back, most=5)
    joined.parts.append(transport)
    viewer = joined.add(Viewer(transport.port, form=form))
    for _ in range(100):
        joined.run(0.1)
        assert back.in_flight() <= 7
    assert len(viewer.history) >= 30
    assert viewer.history[-1].age < 2.3


def test_the_door_costs_little():
    probe = "import sys; import interfaces; print(sorted({'scipy', 'ruckig', 'pybullet'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", probe], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_memory_of_clients_is_bounded():
    joined = Joined()
    port = joined.local()
    viewer = joined.add(Viewer(port, rate=1000))
    supervisor = joined.add(Supervisor(port))
    for k in range(50):
        supervisor.issue(to(k), now=joined.now, execute_in=0.05)
        for _ in range(100):
            supervisor.ask(joined.now + 1.0, now=joined.now)
        joined.run(0.1)
    assert viewer.number > 4500
    assert len(viewer.history) == 4096
    assert len(port.servlet.timeline.answers) <= 1024
    assert len(port.servlet.outbox) <= 1024
    assert len(supervisor.observer.answers) <= 4096


def test_misuse():
    engine = Engine(MODEL, clock=ManualClock(0.0))
    for options in (
        {"rate": 0},
        {"lead": 1.0, "form": ViewForm.FRAMES},
        {"lead": np.nan},
        {"resend": 0.0},
        {"lead": 1.0, "form": ViewForm.COMPACT},
        {"delay": 0.11, "form": ViewForm.COMPACT},
    ):
        with pytest.raises(InvalidValueError):
            Viewer(engine, **options)
