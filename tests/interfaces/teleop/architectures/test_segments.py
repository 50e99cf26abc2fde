"""Arcs arrive in their order, each once, whatever the network does to their packets."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces.messages.fields import Epoch
from interfaces.messages.sites import MOST_REPEATED, ArchitectureReport, ArcPacket, DriveOrders, arc_rows
from interfaces.teleop.architectures import ArchitectureOperatorSite, ArchitectureRobotSite, Transport
from robots import ipr
from robots.onboard.driving import IPR_LIMITS, STAND, Posture
from vrs.segment import ArcSegment

START = Posture(0.0, 0.0, 0.0)
T = 0.1


def arc(k: int) -> ArcSegment:
    return ArcSegment(0.1 * k, 0.1, (0.01 * k, 0.0, 0.0), 0.1, 0.0, k)


class Taking:
    """A controller that stands, and writes down whose arcs it got, from 1; a robot that stays where it is."""

    def __init__(self):
        self.taken = []
        self.executed = 0

    def receive(self, arcs, packet, *, now):
        self.taken += [round(arc.start / T) + 1 for arc in arcs]

    def control(self, posture, *, now, v_before):
        return STAND

    def posture(self):
        return START


class Both:
    """Both sites, and how far the operator has driven."""

    def __init__(self, transport: Transport = Transport.DATAGRAMS) -> None:
        self.operator = ArchitectureOperatorSite(ipr.model("ipr", period=T), START, transport)
        self.controller = Taking()
        self.robot = ArchitectureRobotSite(self.controller, self.controller, IPR_LIMITS, period=T)
        self.driven = 0

    def drive(self) -> ArcPacket:
        self.driven += 1
        return self.operator.drive(0.1, 0.0, now=T * (self.driven - 1))

    def arrive(self, packet: ArcPacket) -> None:
        self.robot.receive(packet, now=0.0)

    def acknowledge(self, count: int) -> None:
        report = ArchitectureReport(1, 0, START, max(count, 0))
        self.operator.receive(report, now=T * self.driven)

    @property
    def count(self) -> int:
        return self.robot.report(now=0.0).received

    @property
    def all_taken(self) -> bool:
        return self.controller.taken == list(range(1, self.driven + 1)) and self.count == self.driven


@pytest.mark.parametrize("seed", range(20))
def test_any_packet_makes_up_for_those_that_were_lost_or_overtaken(seed: int) -> None:
    rng = np.random.default_rng(seed)
    both = Both()
    underway: list[tuple[float, ArcPacket]] = []
    for k in range(300):
        packet = both.drive() if k < 280 else both.operator.repeat()
        if k >= 295 or rng.random() < 0.6:
            underway.append((k + float(rng.exponential(8.0)), packet))
        for entry in sorted((found for found in underway if found[0] <= k), key=lambda found: found[0]):
            underway.remove(entry)
            both.arrive(entry[1])
        if rng.random() < 0.3:
            both.acknowledge(both.count - int(rng.integers(0, 20)))
    for _, packet in underway:
        both.arrive(packet)
    assert both.driven == 280
    assert both.all_taken


def test_a_stream_carries_each_arc_once() -> None:
    both = Both(Transport.STREAM)
    for k in range(5):
        packet = both.drive()
        assert [(first, len(arcs)) for first, arcs in packet.runs] == [(k, 1)]
        both.arrive(packet)
        assert both.all_taken
    assert both.operator.repeat().runs == ()


def test_a_long_silence_is_made_up_for_from_both_ends() -> None:
    both = Both()
    for _ in range(3 * MOST_REPEATED):
        both.drive()
    for _ in range(8):
        packet = both.operator.repeat()
        assert sum(len(arcs) for _, arcs in packet.runs) <= MOST_REPEATED
        both.arrive(packet)
        both.acknowledge(both.count)
    assert both.all_taken


def test_what_is_acknowledged_isn_t_sent_again_and_old_acknowledgements_change_nothing() -> None:
    both = Both()
    for _ in range(10):
        both.drive()
    for count in (7, 3, 99):
        both.acknowledge(count)
    assert both.operator.repeat().runs == ()
    assert [first for first, _ in both.drive().runs] == [10]


def test_orders_say_what_their_arcs_take_on_the_wire() -> None:
    orders = DriveOrders(Epoch(1), 1, 0.0, 0.0, 0.0)
    assert orders.size == 8
    rows = arc_rows((arc(0), arc(1), arc(2)))
    orders = DriveOrders(Epoch(1), 1, 0.0, 0.0, 0.2, runs=((0, rows[:2]),), tail=rows[2:])
    assert orders.size == 8 + 44 + 3 * 24
