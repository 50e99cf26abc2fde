"""Golden vectors of the protocol, for clients in any language.

`python -m tests.interfaces.stream.make_vectors` writes vectors.json anew.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from interfaces import messages as m
from interfaces.engine_server.site import Site
from interfaces.jobs import digest
from interfaces.link import ClockSync, RoundTrip
from interfaces.messages import control as c
from interfaces.messages import jobs as j
from interfaces.messages.compact import CompactDecoder, CompactEncoder, CompactFrame, packed
from interfaces.messages.control import LinkFigures, Ping, Pong, SensedPoints
from interfaces.messages.fields import Epoch
from interfaces.messages.jobs import (
    HALT,
    ArmJob,
    Doing,
    Errand,
    JobForecast,
    JobList,
    JobProgress,
    JobStage,
    ListCommand,
    MessageJob,
    MoveJob,
    OperatorLoss,
    Progress,
    RobotTask,
    TaskReport,
    VoiceJob,
    WaitJob,
)
from interfaces.messages.sites import ArchitectureReport as Followed
from interfaces.messages.sites import DriveOrders, DriveReport, LogEntry, Orders, PlanPart, Report, Sample, arc_rows
from interfaces.stream import Encoding, encode
from robots import puma560
from robots.onboard.driving import Drive, Posture
from robots.onboard.journey import Goal, JourneyState
from robots.onboard.lease import LeaseEnd, LeaseState
from robots.onboard.supervisor import CellChange
from vrs import Engine, Insertion, ManualClock, Motion, PolynomialSegment, Profile, commands
from vrs.ledger import Receipt, Status
from vrs.mobile import DriveLimits
from vrs.model import Limits, frozen_array
from vrs.segment import ArcSegment

PATH = Path(__file__).with_name("vectors.json")
Q = frozen_array([0.1, 0.2, -0.3])
Q2 = frozen_array([1 / 3, -0.5, 2.0])
COMPACT = bytes.fromhex("f14442005ce73025be7201")
POSE = np.array([[0.0, -1.0, 0.0, 0.4], [1.0, 0.0, 0.0, 0.1], [0.0, 0.0, 1.0, -0.2], [0.0, 0.0, 0.0, 1.0]])


LEASE = Epoch(7_730_941_132_801)
JOBS = JobList(
    (
        MoveJob(1, "B"),
        MoveJob(2, Goal(1.0, 2.0)),
        VoiceJob(3, "Hello!"),
        MessageJob(4, "Look"),
        WaitJob(5, 2.5),
        WaitJob(6),
        ArmJob(7, "pick", ".PROGRAM pick"),
    ),
    places={"B": Goal(4.0, 1.5, 0.25)},
)
PROGRESS = Progress(
    JobStage.PAUSED,
    (JobProgress(1, JobStage.DONE), JobProgress(5, JobStage.PAUSED, "somebody stopped it", 1.5)),
    "somebody",
)


def segments() -> tuple[PolynomialSegment, ...]:
    """A hold, a parabola, and one that rounding has moved."""
    return (
        PolynomialSegment(2.5, 0.75, [[0.1, 0.2, -0.3]]),
        PolynomialSegment(3.25, 0.1, [[0.1, 0.2, -0.3], [0.0, 0.0, 0.0], [1.0, -1 / 3, 0.7]], 7),
        PolynomialSegment(math.nextafter(3.35, 4), 0.2, [[0.11, 0.19, -0.29], [0.2, -0.1, 0.1]], 7),
    )


def ordered() -> dict[str, commands.Command | None]:
    """A command of each kind."""
    joints, pose = commands.JointTarget(Q2), commands.PoseTarget(POSE, "LEFTY")
    return {
        "move": commands.MotionCommand(joints, 1.5, 2.0, 0.5),
        "line": commands.MotionCommand(
            pose, None, None, 1.0, Motion.LINE, Profile.JERK_LIMITED, Insertion.APPEND, 0.01
        ),
        "steer by rates": commands.SteerCommand(rates=Q, issued_at=1.5),
        "steer by twist": commands.SteerCommand(twist=[0.1, 0, 0, 0, 0, -0.2], frame=commands.Frame.TOOL),
        "drive": commands.DriveCommand(0.3, -0.1, 2.0),
        "retime": commands.Retime(7, 4.0),
        "cancel": commands.Cancel(7, execute_at=3.0),
        "via": commands.InsertVia(7, joints, 0.05),
        "scale": commands.ScaleTime(0.5),
        "stop": commands.Stop(2.25),
        "resume the plan": commands.Resume(),
        "query": commands.PositionQuery(1.0),
        "parameter": commands.ParameterChange("lateness", "reject"),
        "undo": None,
        "continuous": commands.MotionCommand(
            joints, motion=Motion.LINE, deviation=np.inf, pace=0.25, acceleration=0.5, tool=POSE
        ),
        "alter": commands.Alter([0.0, 0.0, 0.005, 0.0, 0.0, 0.125], commands.Frame.TOOL, POSE, True, 1.5),
        "no more offset": commands.Alter(issued_at=1.75),
        "redo": commands.Redo(),
        "grip": commands.Grip(0.03125, 1.5),
        "open the hand": commands.Grip(np.inf, execute_at=2.5),
    }


def values() -> dict[str, Any]:
    """Messages by name."""
    frame = m.Frame(12, 2.75, 2.5, Q, m.FrameStatus.PREDICTED)
    false = m.Frame(9, 2.75, 2.5, Q, m.FrameStatus.FALSIFIED, 7)
    receipt = Receipt(7, Status.POSTPONED, 1.5, 2.0, 2.25, 3.5, Q2, "late", 4, 0.5, None, False, (5, 6), (4,))
    rejected = Receipt(8, Status.REJECTED, None, None, reason="out of limits")
    limits = Limits([-1.0] * 3, [1.0] * 3, [2.0] * 3, [4.0] * 3, [40.0] * 3)
    held = c.Lease(LeaseState.HELD, 2**64 - 1, "Ada", True, 3)
    plan = PlanPart(4, 2.5, Q, segments=segments())
    entries = LogEntry(1, 2.0, 6, ordered()["move"]), LogEntry(2, 2.0, 6, None)
    orders = {
        f"order: {name}": m.Order(number, order, 7_730_941_132_801)
        for number, (name, order) in enumerate(ordered().items(), 1)
    }
    return {
        "hello": c.Hello(c.PROTOCOL, c.Role.OPERATOR, "Ada"),
        "hello with a token and a session": c.Hello(c.PROTOCOL, c.Role.ADMIN, "Ada", "s3cret", "abc"),
        "welcome": c.Welcome(
            c.PROTOCOL, "abc", c.Role.OPERATOR, "puma560", 3, limits, {"ready": Q}, 2.5, held, 2.0,
            (60.0, 10.0), True,
            "xyz", "vrs 0.1.0",
        ),
        "attached": c.Attached(c.PROTOCOL, "puma560", Q, "halt", 0.5, None, "xyz", "vrs 0.1.0"),
        "attached, with an age": c.Attached(
            c.PROTOCOL, "puma560", Q, "halt", 0.5, -0.5, "xyz", "vrs 0.1.0", max_age=0.4
        ),
        "attached, of a mobile robot": c.Attached(
            c.PROTOCOL, "ipr", frozen_array([1.5, 3.0, 0.25]), "halt", 0.5, None, "xyz", "vrs 0.1.0", max_age=0.5,
            architecture="timeline", room="Empty room",
        ),
        "mobile welcome": c.MobileWelcome(
            c.PROTOCOL, "abc", c.Role.OPERATOR, "ipr", DriveLimits(0.5, 0.75, 0.52, 2.6), 0.1, 0.3, 2.5, held, 2.0,
            False, "xyz", "vrs 0.1.0", room="Empty room",
        ),
        "postures": c.Postures(
            31, 2.5, Posture(1.75, 3.0, 0.5), Drive(0.3, -0.1), Posture(1.76, 3.01, 0.5), 2.25,
            Posture(1.7, 3.0, 0.4), Drive(0.28, -0.05), -0.2, False, 0.002, 0.31, 7_730_941_132_801, True, "", 2,
            0.41, ((2.0, 2.25), (2.05, None)),
        ),
        "postures before the real robot is met": c.Postures(
            1, 0.5, Posture(1.5, 3.0, 0.0), Drive(0.0, 0.0), Posture(1.5, 3.0, 0.0), connected=False,
            halted="the robot hasn't been met yet",
        ),
        "drive orders": DriveOrders(
            Epoch(3), 5, 2.75, 2.5, 0.3, Posture(1.5, 3.0, 0.0),
            ((2, arc_rows([ArcSegment(0.2, 0.1, (1.5, 3.0, 0.0), 0.05, -0.01)])),),
            arc_rows([ArcSegment(0.3, 0.1, (1.505, 3.0, -0.001), 0.02, -0.004)]),
        ),
        "drive orders without a drive": DriveOrders(Epoch(1), 1, 0.5, 0.0, 0.0),
        "drive orders with errands": DriveOrders(
            Epoch(3), 6, 2.85, 2.5, 0.0,
            errands=(
                Errand(1, RobotTask(go=Goal(4.0, 1.5, 0.25))), Errand(2, HALT),
                Errand(3, RobotTask(jobs=JOBS, progress=PROGRESS)),
                Errand(4, RobotTask(do=ListCommand.RUN)),
            ),
        ),
        "drive report of a robot that drives by itself": DriveReport(
            Epoch(3), 15, 3.1, 3.09, Posture(1.5, 3.0, 0.0), Drive(0.3, 0.0), errand=4, doing=Doing.JOBS, left=2.5,
            tasks=TaskReport(
                JourneyState.DRIVING, "", Goal(4.0, 1.5, 0.25), ((1.5, 3.0), (4.0, 1.5)), digest(JOBS), PROGRESS,
                OperatorLoss.CARRY_ON, "Look", "Hello!",
            ),
            sight=SensedPoints(12.5, ((2.0, 3.0), (2.5, 3.25)), (0.0004, 0.0, 0.0009)),
        ),
        "task: a goal": j.TaskOrder(7, RobotTask(go=Goal(4.0, 1.5)), LEASE),
        "task: a list": j.TaskOrder(8, RobotTask(jobs=JOBS), LEASE),
        "task: run it": j.TaskOrder(9, RobotTask(do=ListCommand.RUN), LEASE),
        "task: try it": j.TaskOrder(10, RobotTask(do=ListCommand.DRY_RUN), LEASE),
        "tasks": j.Tasks(
            Doing.JOBS, JourneyState.DRIVING, "", Goal(4.0, 1.5, 0.25), ((1.5, 3.0), (4.0, 1.5)), 2.5, JOBS,
            PROGRESS,
            (JobForecast(1, 0.0, 8.25, ((1.5, 3.0), (4.0, 1.5))), JobForecast(2, 8.25, None)),
            OperatorLoss.STOP, "Look", "", answers=9,
        ),
        "tasks before the robot is met": j.Tasks(problem="jobs.json: is no list of jobs"),
        "seen": c.Seen(12.5, ((2.0, 3.0), (2.5, 3.25)), (0.0004, 0.0, 0.0009)),
        "plan": c.Plan(
            (6.0, 4.0), (((0.0, 0.0), (6.0, 0.0), (6.0, 0.1), (0.0, 0.1)),), ((3.0, 2.0),), (0.2, 0.32, 0.45),
        ),
        "drive report": DriveReport(
            Epoch(3), 12, 2.95, 2.94, Posture(1.5, 3.0, 0.0), Drive(0.04, -0.01), (5, 2.75, 2.9), "", "",
            Followed(4, 2, Posture(1.5, 3.0, 0.0), 3), 0.1, -0.2, False, 0.015, 12.25,
        ),
        "drive report of a robot that sees something new": DriveReport(
            Epoch(3), 13, 3.0, 2.99, Posture(1.5, 3.0, 0.0), Drive(0.0, 0.0),
            report=Followed(5, 3, Posture(1.5, 3.0, 0.0), 3, 0.45, (CellChange((7, 9), 0.4, True),)),
        ),
        "drive report of a halted robot": DriveReport(
            Epoch(3), 14, 3.05, 3.04, Posture(1.5, 3.0, 0.0), Drive(0.0, 0.0), halted="link loss",
            refused="too old",
        ),
        "ping": Ping(1, 123.456),
        "pong": Pong(1, 123.456, 2.5, 2.5001),
        "acquire": c.Acquire(3),
        "take over": c.TakeOver(4),
        "share": c.Share(5, "abc"),
        "release": c.Release(5, 2**64 - 1),
        "resume": c.Resume(6, 7_730_941_132_801),
        "beat": c.Beat(7_730_941_132_801),
        "lease held by the receiver": held,
        "lease held by another": c.Lease(LeaseState.HELD, None, "Ada"),
        "lease shared by the receiver": c.Lease(LeaseState.HELD, 7_730_941_132_801, "Ada", answers=5, shared=True),
        "lease ending": c.Lease(LeaseState.ENDING, answers=4, ended=LeaseEnd.TAKEN_OVER),
        "lease of one that waits": c.Lease(LeaseState.HELD, None, "Ada", answers=7, member=9, waiting=3),
        "lease that is offered": c.Lease(
            LeaseState.FREE, ended=LeaseEnd.RELEASED, member=7, waiting=1, offered_until=73.25
        ),
        "request control": c.RequestControl(7),
        "withdraw": c.Withdraw(8),
        "withdraw another one": c.Withdraw(9, 12),
        "give control": c.GiveControl(10, 12),
        "who": c.Who(11),
        "present": c.Present(
            (
                c.Member(3, "Bo", c.Role.OPERATOR), c.Member(7, "Ada", c.Role.OPERATOR, 1),
                c.Member(12, "Eve 2", c.Role.VIEWER),
            ),
            2, 3, 7, 73.25, 11,
        ),
        "present: nobody": c.Present(),
        "relays": c.Relays(("https://one.example:8701/", "http://127.0.0.1:8702/")),
        "problem": c.Problem(c.ProblemCode.STALE_EPOCH, "the lease has ended", 5),
        "state": c.State(31, 2.5, Q, 2.0, 1.0, -0.5, 0.001, 7_730_941_132_801, True, "", 2),
        "state of a halted robot": c.State(32, 2.5, Q, 2.0, 0.0, -0.5, 0.2, 0, False, "following error", 2),
        "state with a reference and what the link did": c.State(
            33, 2.5, Q, 2.0, 1.0, -0.5, 0.001, 7, True, "", 0, 1.001 * Q, 0.41, ((2.0, 2.25), (2.05, None))
        ),
        "state that tells late measurements": c.State(
            34, 2.5, Q, 2.0, 1.0, -0.5, 0.001, 7, late=((1.25, Q), (1.31, 1.001 * Q))
        ),
        "survey": c.Survey(7),
        "impair both ways": c.Impair(
            8, 7_730_941_132_801, c.DirectionConditions("mon", "0.05"), c.DirectionConditions("constant:0.3")
        ),
        "impair one way": c.Impair(9, 7_730_941_132_801, c.DirectionConditions("none", "burst:0.1,3", "in-order")),
        "correct": c.PathCorrection(10, 1, np.array([0.0, 0.0, 0.005, 0.0, 0.0, 0.125]), LEASE, 2.5),
        "correct now": c.PathCorrection(11, 0, np.zeros(6), LEASE),
        "corrected": c.Corrected(10),
        "corrected late": c.Corrected(11, "the limits don't let the offset be reached in time"),
        "network": c.Network(
            c.DirectionConditions("mon", "0.05"), c.DirectionConditions("none"),
            LinkFigures(412, 0.05, 0.139, 1.9), LinkFigures(300, 0.0, 0.0, 0.0),
            LinkFigures(290, None, 0.141, 1.91), 7, 31.5, "Ada", "ws://127.0.0.1:41000/site", "", 0.002,
            "halt", 0.5,
            0.5, -0.5, "messages will often be old", 7,
        ),
        "network without a robot": c.Network(
            c.DirectionConditions("none"), c.DirectionConditions("none"),
            LinkFigures(0, None, None, None), LinkFigures(0, None, None, None),
            LinkFigures(0, None, None, None), problem="not connected yet",
        ),
        **orders,
        "ask": m.Ask(9, 2.75),
        "ask for the present": m.Ask(10, None),
        "follow segments": m.Follow(11, m.ViewForm.SEGMENTS),
        "follow frames": m.Follow(11, m.ViewForm.FRAMES, 60.0),
        "follow compact frames": m.Follow(11, m.ViewForm.COMPACT, 50.0, 0.1),
        "compact frames": m.Compact(COMPACT),
        "compact frames with false ones": m.Compact(COMPACT, 3, ((9, 10, 7), (11, 11, None))),
        "want history": m.Want(3, 256),
        "want edits": m.Want(3, None),
        "outcome": m.Outcome(1, 2.5, receipt),
        "outcome rejected": m.Outcome(2, 2.5, rejected, "", 1),
        "outcome refused": m.Outcome(3, 2.5, None, "no lease: acquire it first"),
        "answer": m.Answer.showing(false, 2.5),
        "broadcast": m.Broadcast.showing(frame, m.Verdicts(1, 8)),
        "broadcast with false frames": m.Broadcast.showing(frame, m.Verdicts(1, 8, ((9, 10, 7), (11, 11, None)))),
        "scene": m.Scene(11, "puma560", Q, 0.0, 3.55, 3, 3, 2.5),
        "scene of frames": m.Scene(11, "puma560", Q, 0.0, 3.55, 3, 3, 2.5, 60.0),
        "history": m.History(3, 0, segments=segments()),
        "change": m.Change(4, 5, 9.0, 7, 3, 6, 3.75, segments=segments()),
        "change that drops the rest": m.Change(4, 5, 3.25, 7, 3, None, 3.25, segments=segments()[:1]),
        "pulse": m.Pulse(4, 2.5, 2.5),
        "pulse of a site with an offset": m.Pulse(4, 2.5, 2.25),
        "pulse offline": m.Pulse(4, 2.5, -math.inf),
        "orders": Orders(7_730_941_132_801, 5, 2.5, 1, 2.5, 1.0, 3, entries),
        "orders without entries": Orders(7_730_941_132_801, 6, 2.55, 2, 2.55, 1.0),
        "orders that ask for samples": Orders(
            7_730_941_132_801, 7, 2.6, 2, 2.6, 1.0, 3, wanted=((4, 9), (12, 12))
        ),
        "report": Report(
            7_730_941_132_801, 3, 2.75, 1, 2.0, 0.95, Q, 2.72, 2.0, (5, 2.5, 2.7), "", ((1, receipt),), plan
        ),
        "report of a robot that knows the time": Report(
            7_730_941_132_801, 5, 2.95, 1, 2.0, 1.0, Q, 2.92, 2.0, uncertainty=0.015
        ),
        "report with samples": Report(
            7_730_941_132_801, 5, 2.95, 1, 2.0, 1.0, Q, 2.92, 2.0,
            samples=(Sample(4, 2.1, 1.25, Q), Sample(146, 2.92, 2.0, 1.001 * Q)), oldest=3,
        ),
        "report with samples and references": Report(
            7_730_941_132_801, 5, 2.95, 1, 2.0, 1.0, Q, 2.92, 2.0,
            samples=(Sample(5, 2.2, 1.3, Q, 1.001 * Q),), oldest=3,
        ),
        "report of a halted robot": Report(
            7_730_941_132_801, 4, 2.85, 1, 2.0, 0.0, Q, 2.82, 2.0, None, "link lost"
        ),
        "report with a reference": Report(
            7_730_941_132_801, 5, 2.95, 1, 2.1, 1.0, Q, 2.92, 2.07, None, "", (), None, 1.001 * Q
        ),
        "hello of a client with programs": c.Hello(c.PROTOCOL, c.Role.OPERATOR, "console", alters=True),
        "correct another's program": c.PathCorrection(12, 1, np.zeros(6), None, 2.5),
    }  # fmt: skip


def messages() -> list[dict[str, str]]:
    """Messages in both encodings."""
    return [
        {
            "name": name,
            "json": encode(value, Encoding.JSON).decode(),
            "msgpack": encode(value, Encoding.MSGPACK).hex(),
        }
        for name, value in values().items()
    ]


def evaluations() -> list[dict[str, Any]]:
    """Segments, and what they are worth."""
    found = []
    rng = np.random.default_rng(5)
    for degree in range(8):
        segment = PolynomialSegment(2.5, 0.7, rng.normal(size=(degree + 1, 3)), 1)
        at = [
            {"u": u, "derivative": k, "value": segment.value(segment.start + u, derivative=k).tolist()}
            for u in (0.0, 0.25, 0.5, 0.6875)
            for k in range(4)
        ]
        found.append({"coefficients": segment.coefficients.tolist(), "at": at})
    return found


def stream() -> dict[str, Any]:
    """A reader's session: what the server sends in answer to `follow` 1 and each `want`, and joints at the end."""
    model = puma560.model()
    home = model.poses["nominal"]
    clock = ManualClock(0.0)
    engine = Engine(model, q=home, clock=clock)
    site, rng = Site(engine), np.random.default_rng(3)

    def move(**options: Any) -> commands.MotionCommand:
        return commands.MotionCommand(commands.JointTarget(home + rng.uniform(-0.4, 0.4, 6)), **options)

    for k in range(3):
        site.journal.execute(move(execute_at=0.5 + k, insertion=Insertion.APPEND))
    servlet = site.servlet()
    steps: list[dict[str, Any]] = []

    def step(now: float, *requests: m.Request) -> None:
        for request in requests:
            servlet.receive(request, now=site.time(now))
        sent = [encode(request, Encoding.JSON).decode() for request in requests]
        came = [encode(reply, Encoding.JSON).decode() for reply in servlet.advance(now=site.time(now))]
        steps.append({"now": now, "asked": sent, "messages": came})

    step(0.0, m.Follow(1, m.ViewForm.SEGMENTS))
    step(0.05, m.Want(3, 0))
    step(0.1, m.Want(3, None))
    orders = [
        move(execute_at=0.8),
        move(execute_at=1.1, insertion=Insertion.REPLACE),
        move(insertion=Insertion.APPEND, profile=Profile.JERK_LIMITED),
        commands.ScaleTime(0.5),
        move(insertion=Insertion.APPEND, execute_at=12.0),
        move(execute_at=2.0),
        commands.SteerCommand(rates=[0.2, 0.1, 0, 0, 0.1, 0], issued_at=0.9, execute_at=0.9),
        commands.Stop(),
    ]
    for k, command in enumerate(orders):
        now = 0.2 + 0.1 * k
        site.time(now)
        site.journal.execute(command)
        step(now)
    step(1.2)
    t = np.linspace(-1.0, engine.timeline.end + 1.0, 60)
    samples = [
        {"t": x, "derivative": k, "value": engine.timeline.sample(x, derivative=k).tolist()}
        for x in t.tolist()
        for k in (0, 1, 2)
    ]
    return {"steps": steps, "samples": samples}


def clock() -> list[dict[str, Any]]:
    """Round trips, and what is known of the other clock after each; maxDrift 200e-6, resolution 1e-6, slew 0.05."""
    rng, sync, found = np.random.default_rng(9), ClockSync(), []
    t = 100.0
    for _ in range(40):
        there, back = (rng.exponential(0.02, 2) + 0.005).tolist()
        received = (t + there) * (1 + 50e-6) - 97.5
        trip = t, received, received + 0.0005, t + there + 0.0005 + back
        sync.receive(RoundTrip(*trip))
        estimate = sync.estimate(trip[3])
        assert estimate is not None
        later = trip[3] + 0.2
        found.append(
            {
                "trip": list(trip),
                "offset": estimate.offset,
                "uncertainty": estimate.uncertainty,
                "later": later,
                "time": sync.to_remote(later),
                "mapped_uncertainty": sync.uncertainty(later),
            }
        )
        t += 0.5
    return found


def compact() -> list[dict[str, Any]]:
    """Messages of compact frames in their order, and what a reader has of each: nothing where it lacks a frame.

    The first is the worked example of docs/protocol.md. A message is lost before the fourth, and with the fifth a
    reader goes on.
    """
    encoder, reader, found = CompactEncoder(50.0), CompactDecoder(), []

    def made(number: int) -> CompactFrame:
        k = max(number - 12, 0)
        late = 250e-6 if number == 16 else 0.0
        q = frozen_array([0.1 + 0.01 * k, 0.2, -0.3 + 0.005 * k * k])
        t = 2.75 + 0.02 * k + late
        return encoder.add(m.Frame(number, t, t - 0.25, q, m.FrameStatus.PREDICTED))

    messages = (
        ((12, 13), True, {"falsified": ((9, 10, 7),)}), ((14,), False, {}), ((15, 16, 17), False, {"since": 2}),
        ((18,), None, {}), ((19, 20), False, {}), ((21, 22), True, {"falsified": ((9, 10, 7), (20, 22, None))}),
        ((23, 24), False, {}),
    )  # fmt: skip
    for numbers, key, more in messages:
        frames = [made(number) for number in numbers]
        if key is None:
            continue
        message = m.Compact(packed(frames, 4, key=key), **more)
        frames_read = [
            {
                "number": b.frame.number,
                "t": b.frame.t,
                "made_at": b.frame.made_at,
                "q": b.frame.q.tolist(),
                "status": b.frame.status,
                "since": b.verdicts.since,
                "through": b.verdicts.through,
            }
            for b in reader.receive(message)
        ]
        text = encode(message, Encoding.JSON).decode()
        found.append({"json": text, "hex": message.q.hex(), "frames": frames_read, "lacking": reader.lacking})
    return found


def made() -> dict[str, Any]:
    """All vectors."""
    return {
        "protocol": c.PROTOCOL,
        "messages": messages(),
        "evaluations": evaluations(),
        "stream": stream(),
        "clock": clock(),
        "compact": compact(),
    }


def main() -> None:
    """Write the file."""
    PATH.write_text(json.dumps(made(), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
