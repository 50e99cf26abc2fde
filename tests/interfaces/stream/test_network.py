"""The emulated way to a robot over the wire: who is told, who may change it, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces.link import Conditions, LinkConditions, delay_profile, loss_model
from interfaces.messages import control
from interfaces.messages.control import (
    PROTOCOL,
    Attached,
    DirectionConditions,
    Impair,
    Ping,
    ProblemCode,
    Role,
    Survey,
)
from interfaces.recording.marks import OF_EVENTS, MarkKind
from interfaces.runtime.live.emulation import LiveEmulation, late_often
from interfaces.teleop import OperatorSite, RobotLine, VirtualArm
from tests.interfaces.stream.served import HOME, MODEL, make_hub
from tests.interfaces.stream.test_session import Peer, holder

BEGUN = Conditions(delay=delay_profile("constant:0.1"), loss=loss_model("burst:0.2,4"))


class Robot:
    """What a connection knows of a robot."""

    url, problem = "ws://there/site", ""

    def __init__(self, link_loss: str = "halt") -> None:
        self.attached = Attached(PROTOCOL, "puma560", HOME, link_loss, 0.5, -0.3, max_age=0.5)


def emulated(**options):
    """A hub with a way to a robot, and what was told of its changes."""
    line = RobotLine(
        OperatorSite(VirtualArm(MODEL, HOME, now=0.0)), LinkConditions.symmetric(BEGUN), np.random.default_rng(3)
    )
    told: list[tuple[float, str]] = []
    emulation = LiveEmulation(line, Robot(**options), 3, lambda now, text: told.append((now, text)))  # type: ignore[arg-type]
    return make_hub(emulation=emulation), line, told


def test_who_asks_is_told_and_of_every_change_from_then_on():
    hub, line, told = emulated()
    mine, epoch = holder(hub)
    watcher, silent = Peer(hub, role=Role.VIEWER), Peer(hub)
    (found,) = watcher.tell(Survey(4), now=0.2)
    assert (found.forward, found.answers, found.changed_at) == (
        DirectionConditions("constant:0.1", "burst:0.2,4"),
        4,
        None,
    )
    assert (found.seed, found.robot, found.link_loss, found.offset) == (3, "ws://there/site", "halt", -0.3)
    assert found.there.packets == 0
    assert found.there.median is None
    (answer,) = mine.tell(Impair(5, epoch, DirectionConditions("mon", "0.05", "in-order")), now=0.3)
    assert (answer.forward, answer.backward) == (DirectionConditions("mon", "0.05", "in-order"), found.backward)
    assert (answer.answers, answer.changed_at, answer.changed_by) == (5, 0.3, "peer")
    (seen,) = [message for message in watcher.got(now=0.3) if message.kind == "network"]
    assert (seen.forward, seen.answers) == (answer.forward, None)
    assert "network" not in [message.kind for message in silent.got(now=0.3)]
    assert line.link.conditions.forward.delay.name == "mon"
    assert told == [
        (0.3, "peer changed the way to the robot: delay mon, loss 0.05, in-order; "
              "back delay constant:0.1, loss burst:0.2,4, datagram")
    ]  # fmt: skip
    assert OF_EVENTS["rerouted"] is MarkKind.LINK
    assert mine.tell(Impair(6, epoch), now=0.4)[0].changed_at == 0.3, "what stays as it is isn't a change"


@pytest.mark.parametrize(
    ("way", "words", "field"),
    [
        (DirectionConditions("tomorrow"), "constant:S", "delay"),
        (DirectionConditions("constant:-1"), "[0, 3600]", "delay"),
        (DirectionConditions("trace:/etc/passwd"), "only if the server was started with it", "delay"),
        (DirectionConditions("none", "1.5"), "burst:P,N", "loss"),
        (DirectionConditions("none", "nan"), "burst:P,N", "loss"),
        (DirectionConditions("none", "0", "sometimes"), "datagram", "service"),
    ],
)
def test_what_is_wrong_is_said_once_and_changes_nothing(way, words, field):
    hub, line, told = emulated()
    mine, epoch = holder(hub)
    before = line.link.conditions
    for wish in (Impair(5, epoch, way), Impair(6, epoch, DirectionConditions("mon"), way)):
        (problem,) = mine.tell(wish, now=0.3)
        assert (problem.code, problem.number, problem.fatal) == (ProblemCode.OUT_OF_RANGE, wish.number, False)
        assert problem.field == field
        assert words in problem.text
        assert "root:" not in problem.text
    assert (line.link.conditions, told) == (before, [])


def test_only_who_has_control_changes_it():
    hub, line, _ = emulated()
    mine, epoch = holder(hub)
    before = line.link.conditions
    wish = DirectionConditions("mon")
    for peer, given, code in (
        (Peer(hub, role=Role.VIEWER), epoch, ProblemCode.NOT_ALLOWED),
        (Peer(hub), epoch, ProblemCode.STALE_EPOCH),
        (mine, epoch + 1, ProblemCode.STALE_EPOCH),
    ):
        (problem,) = peer.tell(Impair(5, given, wish), now=0.3)
        assert (problem.code, problem.number) == (code, 5)
    assert line.link.conditions == before
    mine.tell(control.Release(1, epoch), now=0.4)
    assert mine.tell(Impair(6, epoch, wish), now=0.5)[-1].code is ProblemCode.STALE_EPOCH
    (nowhere,) = Peer(make_hub()).tell(Survey(1), now=0.1)
    assert (nowhere.code, nowhere.number) == (ProblemCode.NOT_ALLOWED, 1)


def test_it_does_not_change_too_often():
    hub, _, told = emulated()
    mine, epoch = holder(hub)
    answers = [
        mine.tell(Impair(k, epoch, DirectionConditions(f"constant:{k / 100}")), now=0.3)[-1] for k in range(1, 30)
    ]
    refused = [answer for answer in answers if answer.kind == "problem"]
    assert {answer.code for answer in refused} == {ProblemCode.TOO_FAST}
    assert len(told) == 29 - len(refused) == 10
    assert mine.tell(Impair(31, epoch, DirectionConditions("mon")), now=1.0)[-1].kind == "network"


def test_messages_that_will_often_be_too_old_are_spoken_of():
    hub, _, _ = emulated()
    mine, epoch = holder(hub)
    assert mine.tell(Survey(1), now=0.2)[0].advice == ""
    assert (
        "will often be"
        in mine.tell(Impair(2, epoch, DirectionConditions("lunar"), DirectionConditions("none")), now=0.3)[0].advice
    )
    hub, _, _ = emulated(link_loss="hold")
    mine, epoch = holder(hub)
    assert (
        mine.tell(Impair(2, epoch, DirectionConditions("lunar"), DirectionConditions("none")), now=0.3)[0].advice
        == ""
    )
    slow = LinkConditions.symmetric(Conditions(delay=delay_profile("constant:0.3")))
    assert "0.6 s old" in late_often(slow, "halt", 0.5)
    assert late_often(slow, "halt", 0.7) == ""


def test_the_way_is_measured_since_it_changed():
    hub, line, _ = emulated()
    mine, epoch = holder(hub)
    for k in range(200):
        line.link.backward.send(Ping(k + 1, 0.0), 0.01 * k)
        line.advance(now=0.01 * k)
    mine.tell(control.Beat(epoch), now=1.5)
    found = mine.tell(Survey(1), now=2.0)[-1]
    assert found.back.packets > 100
    assert (found.back.median, found.back.p95) == (pytest.approx(0.1), pytest.approx(0.1))
    assert 0.02 < found.back.lost < 0.5
    changed = mine.tell(Impair(2, epoch, None, DirectionConditions("constant:0.02")), now=2.0)[-1]
    assert changed.back.packets == 0
    for k in range(200, 220):
        line.link.backward.send(Ping(k + 1, 0.0), 0.01 * k)
        line.advance(now=0.01 * k)
    found = mine.tell(Survey(3), now=2.2)[-1]
    assert (found.back.median, found.back.lost) == (pytest.approx(0.02), 0.0)


def test_packets_under_way_are_not_lost():
    hub, line, _ = emulated()
    mine, epoch = holder(hub)
    mine.tell(Impair(2, epoch, None, DirectionConditions("constant:1.5", "0.2")), now=0.0)
    found, shown = {}, []
    for k in range(1200):
        now = 0.02 * k
        line.link.backward.send(Ping(k + 1, 0.0), now)
        line.advance(now=now)
        measured = line.back.measured(now=now)
        assert measured.packets <= k + 1
        if measured.packets >= 100:
            shown.append(measured.lost)
        found[k] = measured
    assert found[60].median is None, "nothing has arrived yet"
    assert found[60].lost < 0.5
    # Three standard deviations of a hundred.
    assert all(abs(lost - 0.2) < 0.12 for lost in shown)
    assert (found[600].packets, found[600].span) == (pytest.approx(601, abs=30), pytest.approx(12.0))
    late = line.back.measured(now=40.0)
    assert (late.span, late.packets) == (30.0, pytest.approx(700, abs=30))
