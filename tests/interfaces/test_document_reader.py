"""A reader by the document alone has the server's timeline after every edit, however late a correction is found."""

from __future__ import annotations

import json

import numpy as np
import pytest

from interfaces.engine_server.site import Site
from interfaces.link import BernoulliLoss, Conditions, LinkConditions, Service, delay_profile
from interfaces.messages import Order, Request
from interfaces.runtime.laboratory import Laboratory
from interfaces.stream.codec import Encoding, decode, encode
from interfaces.teleop import FollowingArm, OperatorSite, RobotSiteConfig, VirtualArm
from robots import puma560
from tests.interfaces.document_reader import DocumentReader, Row
from vrs import Insertion, JointTarget, MotionCommand, SteerCommand, Stop
from vrs.timeline import Timeline

MODEL = puma560.model()
NOMINAL = MODEL.poses["nominal"]
SEEN = 0.0137
"""The server looks at what else was done to its timeline so often [s]; reports come in between."""
ROUNDING = 1e-12
"""Of the starts of segments that were shifted [s]."""


class Session:
    """Both sites over a bad link, an operator at a servlet, and a reader of its segments."""

    def __init__(self, profile: str, D: float, loss: float, seed: int, length: float) -> None:
        self.rng = np.random.default_rng(seed)
        operator = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
        robot = FollowingArm(MODEL, NOMINAL, now=0.0, config=RobotSiteConfig(fixed_offset=D))
        conditions = Conditions(
            delay=delay_profile(profile), loss=BernoulliLoss(loss), duplicate=0.05, service=Service.DATAGRAM
        )
        self.lab = Laboratory(operator, robot, LinkConditions.symmetric(conditions), self.rng)
        self.site = Site(operator.robot.engine)
        self.servlet = self.site.servlet()
        self.reader = DocumentReader()
        self.reader.begin()
        self.orders = self.checked = 0
        self.wrong: list[tuple[int, float]] = []
        self.confirmed: dict[float, list[float]] = {}
        self.lab.schedule(SEEN, self.look)
        t = 0.3
        while t < length:
            t = self.steered(t) if self.rng.random() < 0.8 else self.moved(t)
        self.lab.run(length + 3.0)

    def steered(self, t: float) -> float:
        rates = self.rng.uniform(-0.3, 0.3, 6) * MODEL.limits.qd_max
        for k in range(60):
            self.lab.schedule(t, self.ordering(SteerCommand(rates=rates * np.sin(0.1 * k))))
            t += 0.02
        return t + 0.3

    def moved(self, t: float) -> float:
        if self.rng.random() < 0.2:
            self.lab.schedule(t, self.ordering(Stop()))
        else:
            q = np.clip(NOMINAL + self.rng.uniform(-0.5, 0.5, 6), MODEL.limits.q_min, MODEL.limits.q_max)
            how = self.rng.choice(list(Insertion))
            wait = float(self.rng.choice([0.0, 0.3]))
            self.lab.schedule(t, self.ordering(MotionCommand(JointTarget(q), None, t + wait, 0.6, insertion=how)))
        return t + 0.4

    def ordering(self, command):
        def order(now: float) -> None:
            self.orders += 1
            self.servlet.receive(Order(self.orders, command), now=self.site.time(now))
            self.exchange(now)

        return order

    def look(self, now: float) -> None:
        self.exchange(now)
        self.lab.schedule(now + SEEN, self.look)

    def exchange(self, now: float) -> None:
        """Let messages cross, and compare."""
        self.site.time(now)
        servlet, reader = self.servlet, self.reader
        for message in reader.outbox:
            asked = decode(json.dumps(message).encode(), Encoding.JSON, allowed=Request)
            servlet.receive(asked, now=now)
        reader.outbox.clear()
        for reply in servlet.advance(now=now):
            edit = reader.edit
            reader.receive(json.loads(encode(reply, Encoding.JSON)))
            if reader.rows is not None and reader.edit != edit and reader.edit == self.site.journal.number:
                self.compare(now)
        if reader.rows is not None and np.isfinite(reader.past):
            t = reader.past - 1e-6
            self.confirmed[t] = reader.joints(t)

    def compare(self, now: float) -> None:
        timeline, rows = self.site.engine.timeline, self.reader.rows
        self.checked += 1
        first = max(timeline.index_at(now - 0.4), 0)
        same = len(rows) == len(timeline) and is_same(timeline, rows, first)
        if not same:
            t = np.linspace(max(now - 0.4, 0.0), now + 1.0, 100)
            off = max(np.abs(self.reader.joints(x) - timeline.sample(float(x))).max() for x in t)
            self.wrong.append((self.reader.edit, off))


def is_same(timeline: Timeline, rows: list[Row], first: int) -> bool:
    """Whether segments from an index on are the same bits, but for the rounding of what was shifted."""
    return all(
        abs(segment.start - row[0]) <= ROUNDING
        and (segment.duration, segment.command_id, segment.coefficients.tolist()) == row[1:]
        for segment, row in zip(timeline.segments[first:], rows[first:], strict=True)
    )


def check(session: Session) -> None:
    timeline, reader = session.site.engine.timeline, session.reader
    assert session.wrong == []
    assert reader.misfits == 0
    assert reader.edit == session.site.journal.number
    assert is_same(timeline, reader.rows, 0)
    # What a pulse said is over was the same ever after.
    assert len(session.confirmed) > 100
    for t, q in session.confirmed.items():
        assert np.abs(reader.joints(t) - np.array(q)).max() <= 1e-11


@pytest.mark.parametrize(
    ("profile", "D", "loss", "seed"),
    [("constant:0.3", -0.1, 0.0, 1), ("wed", -0.12, 0.1, 2), ("mon", -0.1, 0.2, 3)],
)
def test_a_reader_by_the_document_has_the_servers_timeline_after_every_edit(profile, D, loss, seed):
    session = Session(profile, D, loss, seed, length=12.0)
    check(session)
    assert len(session.lab.operator.robot.corrections) > 8
    assert session.checked > 380
