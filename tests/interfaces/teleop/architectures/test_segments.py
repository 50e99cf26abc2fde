"""Arcs arrive in their order, each once, whatever the network does to their packets."""

from __future__ import annotations

import numpy as np
import pytest

from interfaces.messages.drive_sites import MOST_REPEATED, ArcPacket
from interfaces.teleop.architectures.sites import Receiver, Sender, Transport
from vrs.segment import ArcSegment


def arc(k: int) -> ArcSegment:
    return ArcSegment(0.1 * k, 0.1, (0.01 * k, 0.0, 0.0), 0.1, 0.0, k)


@pytest.mark.parametrize("seed", range(20))
def test_any_packet_makes_up_for_those_that_were_lost_or_overtaken(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sender, receiver = Sender(Transport.DATAGRAMS), Receiver()
    underway: list[tuple[float, ArcPacket]] = []
    taken: list[ArcSegment] = []
    for k in range(300):
        if k < 280:
            sender.add(arc(k))
        if k >= 295 or rng.random() < 0.6:
            underway.append((k + float(rng.exponential(8.0)), sender.packet(0.1 * k)))
        for entry in sorted((found for found in underway if found[0] <= k), key=lambda found: found[0]):
            underway.remove(entry)
            taken += receiver.receive(entry[1])
        if rng.random() < 0.3:
            sender.acknowledge(receiver.count - int(rng.integers(0, 20)))
    for _, packet in underway:
        taken += receiver.receive(packet)
    assert [found.command_id for found in taken] == list(range(280))
    assert receiver.count == 280


def test_a_stream_carries_each_arc_once() -> None:
    sender, receiver = Sender(Transport.STREAM), Receiver()
    for k in range(5):
        sender.add(arc(k))
        packet = sender.packet(0.1 * (k + 1))
        assert [len(arcs) for _, arcs in packet.runs] == [1]
        assert [found.command_id for found in receiver.receive(packet)] == [k]
    assert sender.packet(0.5).runs == ()


def test_a_long_silence_is_made_up_for_from_both_ends() -> None:
    sender, receiver = Sender(Transport.DATAGRAMS), Receiver()
    for k in range(3 * MOST_REPEATED):
        sender.add(arc(k))
    taken: list[ArcSegment] = []
    for _ in range(8):
        packet = sender.packet(0.0)
        assert sum(len(arcs) for _, arcs in packet.runs) <= MOST_REPEATED
        taken += receiver.receive(packet)
        sender.acknowledge(receiver.count)
    assert [found.command_id for found in taken] == list(range(3 * MOST_REPEATED))


def test_what_is_acknowledged_isn_t_sent_again_and_old_acknowledgements_change_nothing() -> None:
    sender = Sender(Transport.DATAGRAMS)
    for k in range(10):
        sender.add(arc(k))
    sender.acknowledge(7)
    sender.acknowledge(3)
    sender.acknowledge(99)
    assert sender.packet(1.0).runs == ()
    sender.add(arc(10))
    assert [first for first, _ in sender.packet(1.1).runs] == [10]


def test_a_packet_says_what_it_takes_on_the_wire() -> None:
    assert ArcPacket((), 0.0).size == 8
    assert ArcPacket(((0, (arc(0), arc(1))),), 0.2, (arc(2),)).size == 8 + 44 + 3 * 24
