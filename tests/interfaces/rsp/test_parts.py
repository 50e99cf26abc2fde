"""Motion filter, streams under flow control, and the period that's fitted."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from random import Random
from threading import Thread

import pytest

from interfaces.rsp.devices import EffectorDevice
from interfaces.rsp.errors import FullError
from interfaces.rsp.local import LocalCore, PeriodConfig, PeriodControl
from interfaces.rsp.middleware import Middleware
from interfaces.rsp.model import Effector, Filling, RobotModel, example
from interfaces.rsp.motion_filter import Fastest, MotionFilter, MotionFilterConfig
from interfaces.rsp.outbox import CommandOutbox, DeliveryOutcome, MemoryOutbox, Settled, StreamInbox, StreamOutbox
from interfaces.rsp.outputs import Occurred
from tests.interfaces.rsp.joined import Network, Pair
from tests.memory import values_held
from vrs.clock import ManualClock
from vrs.errors import InvalidValueError

HELD, LINE, FLOAT = 0, 1, 2
MODEL = RobotModel(
    "filtered",
    1,
    (
        Effector("held"),
        Effector("line", filling=Filling.LINEAR),
        Effector("floating", type="f32", filling=Filling.LINEAR),
        Effector("speaker", stream=100),
    ),
    buffers=8,
)
T = 0.02


def frames(filter_: MotionFilter, arrivals: dict[int, float]) -> None:
    """Values k of frame k, made at kT, each at its time of arrival."""
    for k, at in arrivals.items():
        told = {HELD: (float(k),), LINE: (float(10 * k),), FLOAT: (float(k),)}
        filter_.receive(k * T, told, now=at)


def test_what_comes_in_time_keeps_its_spacing_whatever_the_jitter() -> None:
    played = MotionFilter(MODEL, MotionFilterConfig(playout=0.05))
    random = Random(1)
    told, jitter = 0, 0.0
    seen: dict[float, float] = {}
    for step in range(1000):
        now = step * 0.002
        while told < 80 and (told == 0 or told * T + 0.1 + jitter <= now):
            frames(played, {told: now if told else 0.1})
            told += 1
            jitter = 0.04 * random.random()
        for index, values in played.play(now).items():
            if index == HELD:
                seen[values[0]] = now
    times = [seen[float(k)] for k in range(2, 70)]
    spacing = [b - a for a, b in pairwise(times)]
    assert all(abs(gap - T) <= 0.0021 for gap in spacing)
    assert played.skipped == 0


def test_cumulative_commands_are_corrected() -> None:
    played = MotionFilter(MODEL, MotionFilterConfig(playout=0.0))
    frames(played, {0: 0.1})
    played.play(0.1)
    # Ten come together, 0.2 s late: the robot does the newest, not all of them in turn.
    frames(played, dict.fromkeys(range(1, 11), 0.5))
    assert played.play(0.5)[HELD] == (10.0,)
    assert played.skipped > 0
    assert played.play(0.52) == {}


def test_losses_are_held_and_interpolated() -> None:
    played = MotionFilter(MODEL, MotionFilterConfig(playout=0.05))
    frames(played, {0: 0.1, 1: 0.12, 3: 0.16})
    # The offset is 0.1 + 0.05: frame 2, which is missing, is due at 0.19.
    values = played.play(0.190001)
    assert values[HELD] == (1.0,)
    assert values[LINE] == (20.0,)
    assert values[FLOAT][0] == pytest.approx(2.0, abs=1e-3)
    played.play(0.3)
    # Nothing comes any more: the posture is held.
    assert played.play(9.0) == {}
    assert played.given(HELD) == (3.0,)


def test_a_line_begins_where_the_value_last_was_unchanged() -> None:
    played = MotionFilter(MODEL, MotionFilterConfig(playout=0.05))
    played.receive(0.0, {LINE: (0.0,)}, now=0.1)
    for k in range(1, 50):
        played.receive(k * T, {}, now=0.1 + k * T)
    played.receive(50 * T, {LINE: (100.0,)}, now=0.1 + 50 * T)
    # Half way between the frame before and this one.
    assert played.play(0.15 + 49.5 * T)[LINE] == (50.0,)


def test_what_waits_is_bounded() -> None:
    played = MotionFilter(MODEL, MotionFilterConfig(playout=1.0))
    frames(played, dict.fromkeys(range(5000), 0.1))
    assert values_held(played) < 1000


@pytest.mark.parametrize("bad", [{"playout": -1.0}, {"playout": 2.0}, {"window": 0.0}])
def test_the_filters_config_is_checked(bad: dict[str, float]) -> None:
    with pytest.raises(InvalidValueError):
        MotionFilterConfig(**bad)


@pytest.mark.parametrize("seed", range(4))
def test_no_buffer_is_promised_twice(seed: int) -> None:
    random = Random(seed)
    pair = Pair(MODEL, Network(random, loss=0.3, duplicate=0.2, delay=0.05, jitter=0.03)).opened()
    played: list[bytes] = []
    pieces = [bytes([k]) * 100 for k in range(100)]
    pair.local.play(3, b"".join(pieces))
    for _ in range(3000):
        pair.step()
        if random.random() < 0.1 and (piece := pair.robot.streams.take(3)) is not None:
            played.append(piece)
    assert pair.robot.streams.overflowed == 0
    assert len(pair.local.streams) == 0
    # Lost ones are gaps; what comes is in order.
    assert [pieces.index(piece) for piece in played] == sorted({pieces.index(piece) for piece in played})
    assert len(played) + pair.robot.streams.missing >= 90


def test_clearing_drops_what_waits_on_both_sides() -> None:
    pair = Pair(MODEL, Network(Random(1))).opened()
    pair.local.play(3, bytes(100 * 50))
    pair.run(1.0)
    assert pair.robot.streams.free == 0
    assert len(pair.local.streams) == 42
    pair.local.clear()
    pair.run(0.2)
    assert pair.robot.streams.free == 8
    assert len(pair.local.streams) == 0


def test_the_count_of_clearings_goes_round() -> None:
    pair = Pair(MODEL, Network(Random(1))).opened()
    for _ in range(255):
        pair.local.clear()
    pair.run(0.1)
    pair.local.play(3, bytes(100))
    pair.run(0.2)
    assert pair.robot.streams.free == 7
    pair.local.clear()
    pair.run(0.1)
    assert pair.robot.streams.free == 8


def test_the_queue_of_fragments_is_bounded() -> None:
    outbox = StreamOutbox(8)
    with pytest.raises(FullError):
        outbox.put(3, bytes(70_000), 1)
    assert len(outbox) == 0
    inbox = StreamInbox(1)
    for number in range(3):
        inbox.receive(3, number.to_bytes(4, "big") + b"\0\1" + b"x" * 100)
    assert inbox.overflowed == 2
    assert inbox.take(3) == b"x"


def test_missing_fragments_are_counted_and_numbers_that_go_back_arent() -> None:
    inbox = StreamInbox(9)
    missing = []
    for number in (0, 1, 4, 2, 3, 4_294_967_295, 1):
        inbox.receive(3, number.to_bytes(4, "big") + b"\0\1" + b"x" * 100)
        missing.append(inbox.missing)
    assert missing == [0, 0, 2, 2, 2, 2, 3]


def queueing(rate: float, control: PeriodControl, *, own: float = 0.0, seconds: float = 120.0) -> list[float]:
    """Round trips of packets through a queue that takes so many a second; the periods, over time."""
    now = queue = 0.0
    periods, waiting = [], []
    while now < seconds:
        queue = max(0.0, queue - control.T) + 1.0 / rate
        waiting.append((now + queue, queue + own))
        while waiting and waiting[0][0] <= now:
            control.round_trip(waiting.pop(0)[1], now=now)
        periods.append(control.T)
        now += control.T
    return periods


def test_a_wide_link_keeps_the_least_period() -> None:
    assert set(queueing(1000.0, PeriodControl(), own=0.3)) == {0.02}


def test_a_narrow_link_is_fitted_and_its_queue_drains() -> None:
    periods = queueing(25.0, PeriodControl())
    late = periods[len(periods) // 2 :]
    assert 0.03 <= sum(late) / len(late) <= 0.08
    assert max(periods) <= 0.2


def test_a_link_that_is_slow_by_itself_is_left_alone_after_a_try() -> None:
    control, now = PeriodControl(), 0.0
    periods: list[tuple[float, float]] = []
    while now < 60.0:
        control.round_trip(0.1 if now < 5.0 else 1.0, now=now)
        periods.append((now, control.T))
        now += control.T
    assert max(T for _, T in periods) == pytest.approx(0.2)
    tried = next(t for t, T in periods if T > 0.19)
    left = next(t for t, T in periods if t > tried and T == 0.02)
    # For 20 s after that it isn't tried again, but then it is.
    again = next(t for t, T in periods if t > left and T > 0.02)
    assert 20.0 <= again - left <= 21.0


def test_a_queue_that_falls_by_a_fifth_lets_the_period_be() -> None:
    control, now, periods = PeriodControl(), 0.0, []
    for seconds in (0.1, 0.9, 0.5, 0.3, 0.3, 0.11):
        for _ in range(5):
            control.round_trip(seconds, now=now)
            now += 0.1 + 1e-6
        # The last of a window is the first that its end is noticed at.
        control.round_trip(seconds, now=now)
        periods.append(control.T)
    assert periods == pytest.approx([0.02, 0.03, 0.03, 0.03, 0.045, 0.0405])


def test_the_fastest_of_the_last_window_or_two_is_known() -> None:
    fastest = Fastest(10.0)
    found = []
    for now, value in ((0.0, 1.0), (5.0, 3.0), (10.0, 4.0), (19.9, 5.0), (20.0, 6.0), (50.0, 9.0)):
        fastest.add(value, now)
        found.append(fastest.value)
    assert found == [1.0, 1.0, 1.0, 1.0, 4.0, 9.0]


def test_it_can_be_switched_off_and_is_checked() -> None:
    control = PeriodControl(PeriodConfig(least=0.04, adaptive=False))
    for k in range(1000):
        control.round_trip(float(k), now=0.04 * k)
    assert control.T == 0.04
    for bad in ({"least": 0.0}, {"least": 0.3}, {"longer": 9.0}, {"steps": 0}):
        with pytest.raises(InvalidValueError):
            PeriodConfig(**bad)


def test_the_robot_keeps_to_the_local_systems_period() -> None:
    from interfaces.rsp.local import LocalConfig

    pair = Pair(
        MODEL, Network(Random(1), loss=0.2), local=LocalConfig(period=PeriodConfig(least=0.1, adaptive=False))
    )
    pair.opened()
    pair.run(3.0)
    before = pair.robot.claim.session.number
    pair.run(5.0)
    assert 45 <= pair.robot.claim.session.number - before <= 55


def test_what_no_acknowledgement_comes_for_is_sent_more_and_more_seldom() -> None:
    outbox = MemoryOutbox()
    outbox.put(3, b"map", deadline=100.0)
    sent = []
    for k in range(4000):
        payloads: dict[int, bytes] = {}
        outbox.fill(payloads, now=0.001 * k, timeout=0.1)
        if payloads:
            sent.append(0.001 * k)
    gaps = [b - a for a, b in pairwise(sent)]
    assert gaps[:5] == pytest.approx([0.1, 0.2, 0.4, 0.8, 0.8], abs=0.002)


def test_a_command_goes_until_the_number_of_its_first_packet_is_acknowledged() -> None:
    outbox = CommandOutbox()
    number = outbox.put(3, b"go")
    for packet in (5, 6, 7):
        payloads: dict[int, bytes] = {}
        outbox.fill(payloads, packet)
        assert payloads == {3: b"\0\0go"}
        assert outbox.acknowledge(4) == []
    assert outbox.acknowledge(5) == [Settled(3, number, DeliveryOutcome.DONE)]
    payloads = {}
    outbox.fill(payloads, 8)
    assert payloads == {}


def test_an_acknowledgement_is_of_its_own_element() -> None:
    outbox = MemoryOutbox()
    first, second = outbox.put(3, b"map", deadline=9.0), outbox.put(4, b"route", deadline=9.0)
    outbox.fill({}, now=0.0, timeout=0.1)
    assert outbox.acknowledge(4, second.to_bytes(2, "big")) == [Settled(4, second, DeliveryOutcome.DONE)]
    assert outbox.expire(9.0) == [Settled(3, first, DeliveryOutcome.FAILED)]


def test_two_threads_that_write_two_values_of_one_effector_lose_none() -> None:
    model = RobotModel("pair", 2, (Effector("wheels", count=2),))
    other: list[Thread] = []

    class Slow(EffectorDevice[int]):
        def write_all(self, values: Sequence[int]) -> None:
            if not other:
                # In the midst of the first write somebody else begins another one.
                other.append(Thread(target=self.write, args=(1, 7)))
                other[0].start()
                other[0].join(0.1)
            super().write_all(values)

    wheels = Slow(Middleware(LocalCore(model, bytes), ManualClock(0.0)), "wheels")
    wheels.write(0, 5)
    other[0].join(5.0)
    assert wheels.read_all() == (5, 7)


def test_what_nobody_fetches_goes_oldest_first() -> None:
    core = LocalCore(example(), bytes)
    middleware = Middleware(core, ManualClock())
    bumper, fire = core.model.index("bumper"), core.model.index("ir_fire")
    core.waiting_outputs += [Occurred(bumper, k, k.to_bytes(2, "big")) for k in range(300)]
    core.waiting_outputs += [Settled(fire, k, DeliveryOutcome.DONE) for k in range(9000)]
    middleware.advance((), now=0.0)
    fetched = []
    while (payload := middleware.came(bumper)) is not None:
        fetched.append(int.from_bytes(payload, "big"))
    assert fetched == list(range(44, 300))
    known = [k for k in range(9000) if middleware.outcome(fire, k) is not None]
    assert known == list(range(9000 - 8192, 9000))
