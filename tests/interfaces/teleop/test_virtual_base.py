"""What a virtual base tells who listens, and where it's drawn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import msgspec
import numpy as np
import pytest

from interfaces.messages.fields import Epoch
from interfaces.messages.recording import CommandRecord
from interfaces.messages.sites import ArchitectureReport, DriveReport, Sample
from interfaces.teleop import Correction, SiteObserver
from interfaces.teleop.architectures.compositions import operator_surroundings
from interfaces.teleop.operator import OperatorSite
from interfaces.teleop.virtual_base import VirtualBase
from robots.onboard.driving import STAND, Posture
from robots.onboard.supervisor import CellChange
from robots.rooms import EMPTY
from tests.interfaces.teleop.rig import MODEL, Rig
from vrs import Engine, ManualClock
from vrs.ledger import Receipt
from vrs.mobile import ArcTimeline


class Notes(SiteObserver[DriveReport, ArcTimeline]):
    """Writes down what it's told."""

    def __init__(self) -> None:
        self.drives: list[tuple[Correction, ArcTimeline, list[CommandRecord]]] = []
        self.reports: list[DriveReport] = []
        self.samples: list[Sample] = []

    def commanded(self, deed: CommandRecord) -> None:
        self.drives[-1][2].append(deed)

    def corrected(self, correction: Correction, truth: ArcTimeline) -> None:
        self.drives.append((correction, truth, []))

    def answered(self, command_id: int, receipt: Receipt, *, now: float) -> None:
        raise AssertionError

    def reported(self, report: DriveReport, *, now: float) -> None:
        self.reports.append(report)

    def measured(self, samples: Sequence[Sample], *, now: float) -> None:
        self.samples += samples

    def failed(self, error: Exception) -> None:
        raise error


def test_a_listener_hears_all_that_makes_the_timeline_in_session_time() -> None:
    rig, notes = Rig("constant:0.2"), Notes()
    rig.operator.listener = notes
    rig.begin()
    rig.run(2.0, rig.wish(0.4, 0.3))
    first, until = rig.operator.robot.engine.timeline, rig.now
    rig.operator.robot.stop(now=rig.now)
    rig.run(4.0)
    assert rig.operator.resume(now=rig.now) == ""
    rig.run(1.0, rig.wish(0.2, 0.0))
    met, one, two = notes.drives
    assert met[0].error == pytest.approx((-1.0, -2.0, -0.5), abs=0.02)
    assert (met[2], len(two[0].error)) == ([], 3)
    assert [drive[1].start for drive in notes.drives] == [drive[0].t for drive in notes.drives]
    for correction, truth, deeds in (one, two):
        again = Engine(MODEL, timeline=truth, clock=ManualClock(correction.t))
        # Ids of commands are the session's, not a drive's.
        again.count_from(deeds[0].receipt.command_id - 1 if deeds[0].receipt else 0)
        for deed in deeds:
            assert deed.at >= correction.t
            again.clock.set(deed.at)
            made = again.execute(deed.command)
            assert deed.receipt is not None
            assert (made.command_id, made.execute_at, made.end) == (
                deed.receipt.command_id, deed.receipt.execute_at, deed.receipt.end,
            )  # fmt: skip
        if truth is two[1]:
            assert again.timeline == rig.operator.robot.engine.timeline
        else:
            t = np.linspace(one[0].t, until - MODEL.period, 100)
            assert np.array_equal(again.timeline.sample(t), first.sample(t))
    assert rig.operator.robot.engine.timeline.end == pytest.approx(rig.now, abs=MODEL.period)


def test_a_listener_hears_each_report_and_where_the_robot_was_measured() -> None:
    rig, notes = Rig(), Notes()
    rig.operator.listener = notes
    rig.begin()
    rig.run(3.0, rig.wish(0.3, 0.1))
    assert rig.operator.report is notes.reports[-1]
    times = [sample.t for sample in notes.samples]
    assert times == sorted(set(times))
    assert set(times) == {report.measured_at for report in notes.reports}
    newest, report = notes.samples[-1], notes.reports[-1]
    assert tuple(newest.q) == report.posture
    assert report.play is not None
    assert newest.play == rig.operator.robot.began + report.play


@pytest.mark.parametrize("architecture", ["II", "III", "III-capped"])
def test_it_is_drawn_where_the_posture_estimator_has_it_in_an_architecture_that_has_one(architecture: str) -> None:
    rig = Rig("mon", hold=True, architecture=architecture)
    robot = rig.operator.robot
    rig.begin()
    rig.run(1.0, rig.wish(0.4, 0.3))
    assert np.array_equal(robot.shown(now=rig.now), robot.virtual(rig.now))
    robot.estimating = True
    # It moves on between two commands, too.
    places = []
    for _ in range(20):
        rig.run(0.02, rig.wish(0.4, 0.3))
        places.append(robot.shown(now=rig.now))
    assert all(np.linalg.norm(b[:2] - a[:2]) > 0 for a, b in pairwise(places))
    rig.run(4.0, rig.wish(0.4, 0.3))
    rig.run(4.0)
    assert robot.stands
    drawn = math.dist(robot.shown(now=rig.now)[:2], rig.truth[:2])
    assert drawn < 0.03
    assert drawn <= rig.apart() + 0.02
    assert robot.shown(now=rig.now) == pytest.approx(robot.architecture.estimator.posture)


def test_what_a_report_tells_of_the_surroundings_counts_though_a_later_one_has_overtaken_it() -> None:
    start = Posture(0.0, 0.0, 0.0)
    around = operator_surroundings(EMPTY, start, MODEL)
    operator = OperatorSite(VirtualBase(MODEL, start, now=0.0, around=lambda _: around))
    for t in (0.0, 0.1, 0.2):
        operator.robot.wish(0.2, 0.0, issued_at=t, now=t)
        operator.advance(now=t)
    block = tuple((m, n) for m in (70, 71, 72) for n in (30, 31, 32))
    seen = ArchitectureReport(1, 0, start, 0, 0.05, tuple(CellChange(cell, 0.05, True) for cell in block))
    later = DriveReport(
        Epoch(1), 2, 0.1, 0.1, start, STAND, report=msgspec.structs.replace(seen, number=2, cells=())
    )
    operator.receive(later, now=0.2)
    assert around.environment.obstacles(0.2) == ()
    operator.receive(DriveReport(Epoch(1), 1, 0.05, 0.05, start, STAND, report=seen), now=0.2)
    assert around.environment.obstacles(0.2) == block
    assert operator.report is later


def test_who_commands_no_more_only_sends_what_the_real_robot_lacks() -> None:
    operator = OperatorSite(VirtualBase(MODEL, Posture(0.0, 0.0, 0.0), now=0.0))
    robot = operator.robot
    for t in (0.0, 0.1, 0.2):
        robot.wish(0.2, 0.0, issued_at=t, now=t)
        operator.advance(now=t)
    robot.ended = True
    (orders,) = operator.advance(now=0.3)
    assert [(first, len(arcs)) for first, arcs in orders.packet.runs] == [(0, 3)]
    assert (orders.tail, orders.complete_until) == ((), robot.engine.timeline.end)
    operator.receive(
        DriveReport(
            Epoch(1),
            1,
            0.3,
            0.3,
            Posture(0.0, 0.0, 0.0),
            STAND,
            report=ArchitectureReport(1, 2, Posture(0.0, 0.0, 0.0), 2),
        ),
        now=0.3,
    )
    (orders,) = operator.advance(now=0.4)
    assert [(first, len(arcs)) for first, arcs in orders.packet.runs] == [(2, 1)]
