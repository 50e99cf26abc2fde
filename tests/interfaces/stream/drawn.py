"""Messages of every kind, drawn by hypothesis."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from hypothesis import strategies as st

from interfaces import messages as m
from interfaces.jobs import (
    Forecast,
    JobForecast,
    JobList,
    JobProgress,
    JobStage,
    ListCommand,
    Load,
    MessageJob,
    MoveJob,
    OperatorLoss,
    Progress,
    VoiceJob,
    WaitJob,
)
from interfaces.messages import control as c
from interfaces.messages.control import LinkFigures, Ping, Pong
from interfaces.messages.sites import LogEntry, Orders, PlanPart, Report
from interfaces.stream import mobile as b
from interfaces.teleop.architectures import ArchitectureReport as Followed
from interfaces.teleop.architectures import ArcPacket, CellChanges
from interfaces.teleop.driving.messages import (
    Doing,
    DriveOrders,
    DriveReport,
    Errand,
    Go,
    Halt,
    SensedPoints,
    TaskReport,
)
from robots.onboard.driving import Drive, Posture
from robots.onboard.journey import Goal, JourneyState
from robots.onboard.lease import LeaseEnd, LeaseState
from robots.onboard.supervisor import CellChange
from vrs import commands as v
from vrs.ledger import Receipt, Status
from vrs.mobile import DriveLimits
from vrs.model import Limits
from vrs.segment import ArcSegment, PolynomialSegment

floats = partial(st.floats, allow_subnormal=False)
numbers = st.integers(1, 2**63 - 1)
counts = st.integers(0, 2**63 - 1)
epochs = st.integers(1, 2**64 - 1)
ids = st.none() | st.integers(-(2**63), 2**63 - 1)
times = floats(-1e9, 1e9)
stamps = st.none() | times
finite = floats(-1e9, 1e9)
coefficients = st.floats(allow_nan=False, allow_infinity=False)
words = st.text(max_size=40)
names = st.text(min_size=1, max_size=40)
small = st.integers(1, 8)


def array_of(n):
    return st.lists(finite, min_size=n, max_size=n).map(frozen)


def frozen(values):
    """A read-only array."""
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


arrays = small.flatmap(array_of)


@st.composite
def runs(draw):
    """Segments one after the other, or with starts that rounding has moved."""
    n, found, start = draw(small), [], draw(times)
    for _ in range(draw(st.integers(0, 4))):
        rows = draw(st.integers(1, 6))
        a = frozen(draw(st.lists(coefficients, min_size=n * rows, max_size=n * rows))).reshape(rows, n)
        duration = draw(floats(1e-12, 1e3))
        found.append(PolynomialSegment(start, duration, a, draw(ids)))
        start = found[-1].end if draw(st.booleans()) else draw(times)
    return tuple(found)


@st.composite
def poses(draw):
    """A pose target with a proper rotation."""
    X = np.eye(4)
    X[:3, :3] = np.linalg.qr(np.random.default_rng(draw(st.integers(0, 999))).normal(size=(3, 3)))[0]
    X[:3, :3] *= np.sign(np.linalg.det(X[:3, :3]))
    X[:3, 3] = draw(st.lists(floats(-10, 10), min_size=3, max_size=3))
    return v.PoseTarget(X, draw(st.none() | words))


targets = arrays.map(v.JointTarget) | poses()
deviations = floats(0, 1e6)
shares = floats(1e-3, 1)
one = st.integers(1, 2**63 - 1)
commands = st.one_of(
    st.builds(
        v.MotionCommand, targets, stamps, stamps, shares, st.sampled_from(v.Motion), st.sampled_from(v.Profile),
        st.sampled_from(v.Insertion), deviations | st.just(math.inf), shares, floats(1e-2, 1),
        st.none() | poses().map(lambda pose: pose.X),
    ),
    st.builds(v.SteerCommand, arrays, st.none(), st.sampled_from(v.Frame), stamps, stamps),
    st.builds(v.SteerCommand, st.none(), array_of(6), st.sampled_from(v.Frame), stamps, stamps),
    st.builds(v.DriveCommand, finite, finite, floats(1e-6, 1e9), stamps, stamps),
    st.builds(v.Retime, one, times, stamps),
    st.builds(v.Cancel, one, stamps, stamps),
    st.builds(v.InsertVia, one, targets, deviations, stamps, stamps),
    st.builds(v.ScaleTime, floats(1e-3, 1e3), stamps, stamps),
    st.builds(v.Stop, stamps, stamps),
    st.builds(v.Resume, stamps, stamps),
    st.builds(v.PositionQuery, stamps),
    st.builds(v.ParameterChange, words, st.none() | st.booleans() | st.integers(1, 10**9) | finite | words),
)  # fmt: skip
several = st.lists(one, max_size=5).map(tuple)
receipts = st.builds(
    Receipt, counts, st.sampled_from(Status), stamps, stamps, stamps, stamps, st.none() | arrays, words, counts,
    finite, st.none() | one, st.booleans(), several, several,
)  # fmt: skip
rates = st.sampled_from([None, 60.0])
statuses = st.sampled_from(m.FrameStatus)
frames = st.builds(m.Frame, counts, times, times, arrays, statuses, ids)
falsified = st.lists(st.tuples(counts, counts, ids), max_size=4).map(tuple)
verdicts = st.builds(m.Verdicts, counts, counts, falsified)
leases = st.builds(
    c.Lease, st.sampled_from(LeaseState), st.none() | epochs, st.none() | names, st.booleans(), st.none() | one,
    st.none() | st.sampled_from(LeaseEnd), st.booleans(),
)  # fmt: skip


@st.composite
def welcomes(draw):
    """What a server has, of one width."""
    n = draw(small)
    low = draw(floats(-10, 0))
    limits = Limits(*[np.full(n, x) for x in (low, low + 1, 2.0, 3.0, 4.0)])
    named = draw(st.dictionaries(names, array_of(n), max_size=3))
    role, rates = draw(st.sampled_from(c.Role)), draw(st.lists(floats(0.1, 1e3), max_size=3))
    known = (
        draw(times),
        draw(leases),
        draw(floats(0.1, 60)),
        tuple(rates),
        draw(st.booleans()),
        draw(words),
        draw(words),
    )
    return c.Welcome(c.PROTOCOL, draw(words), role, draw(words), n, limits, named, *known)


ways = st.builds(c.DirectionConditions, words, words, words)
spans = st.none() | floats(0, 1e9)
measured = st.builds(LinkFigures, counts, st.none() | floats(0, 1), spans, spans)
plans = st.builds(PlanPart, counts, times, arrays, runs())
entries = st.builds(LogEntry, numbers, times, st.none() | commands, counts)
echoes = st.none() | st.tuples(numbers, times, times)
postures = st.builds(Posture, times, times, times)
drives = st.builds(Drive, floats(-1e6, 1e6), floats(-1e6, 1e6))
positive = floats(1e-3, 1e6)
arcs = st.lists(
    st.builds(
        ArcSegment,
        times,
        floats(1e-6, 1e3),
        st.tuples(times, times, times),
        floats(-1e6, 1e6),
        floats(-9, 9),
    ),
    max_size=3,
).map(tuple)
packets = st.builds(ArcPacket, st.lists(st.tuples(counts, arcs), max_size=2).map(tuple), times, arcs)
cells = st.lists(st.builds(CellChange, st.tuples(counts, counts), times, st.booleans()), max_size=2).map(tuple)
followed = st.builds(Followed, numbers, counts, postures, counts, st.none() | st.builds(CellChanges, times, cells))


metres = floats(-1e6, 1e6)
points = st.tuples(metres, metres)
rows = st.lists(points, max_size=4).map(tuple)
doubts = st.tuples(metres, metres, metres)
near = floats(-1000, 1000)
goals = st.builds(Goal, near, near, st.none() | near)
texts = words.filter(str.strip)
jobs = st.one_of(
    st.builds(MoveJob, goals), st.builds(VoiceJob, texts), st.builds(MessageJob, texts),
    st.builds(WaitJob, st.none() | floats(0, 1e4)),
)  # fmt: skip
job_lists = st.builds(lambda some, goal: JobList.of(*some, places={"A": goal}), st.lists(jobs, max_size=4), goals)
job_numbers = st.integers(1, 2**31 - 1)
stages = st.sampled_from(JobStage)
progress = st.builds(
    Progress, stages,
    st.lists(
        st.builds(JobProgress, job_numbers, stages, words, st.none() | floats(0, 1e4)), max_size=3
    ).map(tuple),
    words,
)  # fmt: skip
forecasts = st.builds(
    Forecast,
    st.lists(
        st.builds(JobForecast, job_numbers, positive, st.none() | positive, rows, words), max_size=3
    ).map(tuple),
)  # fmt: skip
wanted = st.one_of(
    st.builds(Go, goals),
    st.builds(Load, job_lists, st.none() | progress),
    st.sampled_from([*ListCommand, *b.Trial]),
)
tasks = st.one_of(
    st.builds(Go, goals), st.builds(Halt, words), st.builds(Load, job_lists, st.none() | progress),
    st.sampled_from(ListCommand),
)  # fmt: skip
task_reports = st.builds(
    TaskReport, st.sampled_from(JourneyState), words, st.none() | goals, rows, words, progress,
    st.sampled_from(OperatorLoss), words, words,
)  # fmt: skip

messages = {
    m.Order: st.builds(m.Order, numbers, st.none() | commands, st.integers(0, 2**64 - 1)),
    m.Ask: st.builds(m.Ask, numbers, stamps),
    m.Follow: st.builds(
        m.Follow, numbers, st.sampled_from(m.ViewForm), st.none() | floats(0.1, 1e3), floats(0.0, 0.1)
    ),
    m.Want: st.builds(m.Want, counts, st.none() | counts),
    m.Outcome: st.builds(m.Outcome, numbers, st.none() | receipts, words, counts, times),
    m.Answer: st.builds(m.Answer, frames, times),
    m.Broadcast: st.builds(m.Broadcast, frames, verdicts),
    m.Compact: st.builds(m.Compact, st.binary(min_size=2), st.none() | counts, falsified),
    m.Scene: st.builds(m.Scene, numbers, words, arrays, times, times, counts, counts, times, rates),
    m.History: st.builds(m.History, counts, counts, runs()),
    m.Change: st.builds(m.Change, counts, numbers, ids, counts, runs(), st.none() | counts, times, times),
    m.Pulse: st.builds(m.Pulse, counts, times, times | st.just(-math.inf)),
    c.Hello: st.builds(c.Hello, numbers, st.sampled_from(c.Role), names, st.none() | words, st.none() | words),
    c.Welcome: welcomes(),
    c.Attached: st.builds(
        c.Attached, numbers, words, arrays, words, floats(0.1, 60), stamps, words, words,
        st.none() | floats(0.01, 2), words, words,
    ),
    Ping: st.builds(Ping, numbers, times),
    Pong: st.builds(Pong, numbers, times, times, times),
    c.Acquire: st.builds(c.Acquire, numbers),
    c.TakeOver: st.builds(c.TakeOver, numbers),
    c.Share: st.builds(c.Share, numbers, words),
    c.Release: st.builds(c.Release, numbers, epochs),
    c.Resume: st.builds(c.Resume, numbers, epochs),
    c.Beat: st.builds(c.Beat, epochs),
    c.Lease: leases,
    c.Problem: st.builds(c.Problem, st.sampled_from(c.ProblemCode), words, st.none() | numbers, st.booleans()),
    c.State: st.builds(
        c.State, numbers, times, arrays, times, finite, times, finite, st.none() | epochs, st.booleans(),
        words, counts, st.none() | arrays, st.none() | finite,
        st.lists(st.tuples(times, st.none() | times), max_size=3).map(tuple),
    ),
    Orders: st.builds(
        Orders, epochs, numbers, times, counts, times, times, counts, st.lists(entries, max_size=3).map(tuple)
    ),
    Report: st.builds(
        Report, epochs, numbers, times, echoes, counts, times, finite, arrays, times, times, words,
        st.lists(st.tuples(numbers, receipts), max_size=2).map(tuple), st.none() | plans, st.none() | arrays,
        st.none() | floats(0, 1e3),
    ),
    b.MobileWelcome: st.builds(
        b.MobileWelcome, numbers, words, st.sampled_from(c.Role), words, st.builds(DriveLimits, *[positive] * 4),
        positive, positive, times, leases, floats(0.1, 60), st.booleans(), words, words, words,
    ),
    b.Postures: st.builds(
        b.Postures, numbers, times, postures, drives, postures, stamps, st.none() | postures, st.none() | drives,
        stamps, st.booleans(), st.none() | positive, st.none() | positive, st.integers(0, 2**64 - 1), st.booleans(),
        words, counts, st.none() | finite, st.lists(st.tuples(times, st.none() | times), max_size=3).map(tuple),
    ),
    b.TaskOrder: st.builds(b.TaskOrder, numbers, st.integers(0, 2**64 - 1), wanted),
    b.Tasks: st.builds(
        b.Tasks, st.sampled_from(Doing), st.sampled_from(JourneyState), words, st.none() | goals, rows, positive,
        job_lists, progress, st.none() | forecasts, st.none() | st.sampled_from(OperatorLoss), words, words, words,
        st.none() | numbers,
    ),
    b.Seen: st.builds(b.Seen, times, rows, st.none() | doubts),
    b.Plan: st.builds(
        b.Plan, points, st.lists(rows, max_size=3).map(tuple), rows, st.tuples(positive, positive, positive)
    ),
    DriveOrders: st.builds(
        DriveOrders, epochs, numbers, times, times, st.none() | postures, packets,
        st.lists(st.builds(Errand, numbers, tasks), max_size=4).map(tuple),
    ),
    DriveReport: st.builds(
        DriveReport, st.integers(0, 2**64 - 1), numbers, times, times, postures, drives, echoes, words, words,
        st.none() | followed, stamps, stamps, st.booleans(), st.none() | positive, stamps, counts,
        st.sampled_from(Doing), positive, st.none() | task_reports,
        st.none() | st.builds(SensedPoints, times, rows, st.none() | doubts),
    ),
    c.Survey: st.builds(c.Survey, numbers),
    c.Impair: st.builds(c.Impair, numbers, epochs, st.none() | ways, st.none() | ways),
    c.Network: st.builds(
        c.Network, ways, ways, measured, measured, measured, counts, stamps, words, words, words,
        spans, words, spans, spans, stamps, words, st.none() | numbers,
    ),
}  # fmt: skip
"""What draws each message."""
