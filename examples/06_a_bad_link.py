"""A bad link: losses in bursts, what repeating the last messages saves, what sending again costs."""

from __future__ import annotations

import numpy as np

from interfaces.link import Channel, Conditions, Link, LinkConditions, Service, delay_profile, loss_model

COUNT, PERIOD = 5000, 0.02
bad = {"delay": delay_profile("mon@2"), "loss": loss_model("burst:0.1,2"), "bandwidth": 1e6}


def repeated(repeat: int) -> float:
    """Share of messages that arrive when each packet carries the last `repeat` of them."""
    channel: Channel[range] = Channel(Conditions(**bad), np.random.default_rng(1))
    for i in range(COUNT):
        channel.send(range(max(i + 1 - repeat, 0), i + 1), PERIOD * i, size=40 * repeat)
    arrived: set[int] = set()
    while (t := channel.next_deadline()) is not None:
        for delivery in channel.receive(t):
            arrived.update(delivery.payload)
    return len(arrived) / COUNT


for repeat in (1, 2, 4):
    print(f"each packet carries {repeat}: {100 * repeated(repeat):6.2f} % of the messages arrive")

conditions = LinkConditions(Conditions(**bad), Conditions(**bad, service=Service.IN_ORDER))
link: Link = Link(conditions, np.random.default_rng(2))
for i in range(COUNT):
    link.forward.send(i, PERIOD * i, size=40)
    link.backward.send(i, PERIOD * i, size=40)
while (t := link.next_deadline()) is not None:
    link.forward.receive(t)
    link.backward.receive(t)
for name, way in (("datagrams", link.forward), ("in order", link.backward)):
    sums = way.log.totals()
    lost = sum(sums.lost.values())
    print(f"{name:9}: {sums.arrived} arrived, {lost} lost, {sums.resent} sent again, mean {sums.delay_mean:.3f} s")
