"""A command is done or it isn't, whatever raises on its way: engine, log, journal and recording agree."""

from __future__ import annotations

import ast
import sys
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, partial
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np
import pytest

from interfaces.engine_server.site import Site
from interfaces.link import Conditions, LinkConditions, delay_profile
from interfaces.link.delivery import FAILED
from interfaces.messages import Order, Outcome
from interfaces.messages.recording import CommandRecord
from interfaces.messages.sites import Report, Sample
from interfaces.runtime.laboratory import Laboratory
from interfaces.teleop import Correction, FollowingArm, OperatorSite, VirtualArm
from robots import puma560
from vrs import (
    Cancel,
    Insertion,
    InsertVia,
    JointTarget,
    Motion,
    MotionCommand,
    ParameterChange,
    PoseTarget,
    Profile,
    Redo,
    Resume,
    Retime,
    ScaleTime,
    SteerCommand,
    Stop,
    Timeline,
)
from vrs.commands import Command
from vrs.errors import InvalidValueError, PlanningError, UnknownCommandError, UnreachablePoseError
from vrs.ledger import Receipt

HOME = Path(__file__).resolve().parents[2]
MODEL = puma560.model()
NOMINAL, READY = MODEL.poses["nominal"], MODEL.poses["ready"]
A = np.array([0.0, 0.8, -2.4, 0.0, 0.6, 0.0])
B = np.array([0.5, 0.6, -2.0, 0.3, 0.4, 0.6])
ERRORS = {kind.__name__: kind for kind in (PlanningError, UnknownCommandError, UnreachablePoseError)}
GUARD = {
    ("operator.py", "inform"),
    ("delivery.py", "settle"),
    ("receipt.py", "shifted"),
    ("receipt.py", "superseded"),
}
"""What catches for a command that is done, and what is done once it is."""
NOW = 0.8


class Notes:
    """Listens, as a recording does."""

    def __init__(self) -> None:
        self.deeds: list[CommandRecord] = []
        self.failure: Exception | None = None

    def commanded(self, deed: CommandRecord) -> None:
        self.deeds.append(deed)

    def corrected(self, correction: Correction, truth: Timeline) -> None:
        """Not of commands."""

    def answered(self, command_id: int, receipt: Receipt, *, now: float) -> None:
        """Not of commands."""

    def reported(self, report: Report, *, now: float) -> None:
        """Not of commands."""

    def measured(self, samples: Sequence[Sample], *, now: float) -> None:
        """Not of commands."""

    def failed(self, error: Exception) -> None:
        self.failure = error


class Sites:
    """Both sites of an arm in virtual time, and a client of the operator's; three moves are scheduled."""

    def __init__(self, *before: Command | None) -> None:
        self.operator = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
        self.robot = FollowingArm(MODEL, NOMINAL, now=0.0)
        link = LinkConditions.symmetric(Conditions(delay=delay_profile("constant:0.02")))
        self.lab = Laboratory(self.operator, self.robot, link, np.random.default_rng(0))
        self.site = Site(self.operator.robot.engine)
        self.servlet = self.site.servlet()
        self.notes = self.operator.listener = Notes()
        self.number = 0
        self.lab.run(0.5)
        for command in (
            MotionCommand(JointTarget(A), execute_at=0.5, profile=Profile.JERK_LIMITED),
            MotionCommand(JointTarget(B), execute_at=4.0),
            MotionCommand(JointTarget(READY), execute_at=8.0),
        ):
            assert self.order(command, 0.5).refusal == ""
        self.lab.run(NOW)
        for earlier in before:
            assert self.order(earlier).refusal == ""

    def order(self, command: Command | None, now: float = NOW, *, again: bool = False) -> Outcome:
        """Give an order, or the same again; its outcome."""
        self.number += not again
        self.operator.robot.engine.clock.set(now)  # type: ignore[union-attr]
        self.servlet.receive(Order(self.number, command), now=now)
        found = [reply for reply in self.servlet.advance(now=now) if isinstance(reply, Outcome)]
        return [outcome for outcome in found if outcome.number == self.number and not outcome.revision][-1]

    def state(self) -> Any:
        """All that a command may change, as values; without the answers to what was refused."""
        operator, robot, plan = self.operator, self.operator.robot, self.operator.robot.engine.scheduler
        rejected = {i for i, entry in plan.ledger.entries.items() if entry.receipt.status == "rejected"}
        self.site.journal.look()
        return values((
            plan.timeline, plan.limits, plan.lateness, plan.paused, plan.profiles, plan.session,
            [entry for i, entry in plan.ledger.entries.items() if i not in rejected],
            plan.ledger.changes, plan.ledger.versions, plan.ledger.stills, plan.ledger.undo_steps,
            plan.ledger.redo_steps, plan.ledger.redo_version,
            plan.ledger.settled,
            robot.log.count, robot.log.waiting, robot.newest_sent, robot.command_ids,
            operator.halted, operator.epoch, self.site.journal.number, list(self.site.journal.edits),
            [deed for deed in self.notes.deeds if deed.receipt is None or deed.receipt.status != "rejected"],
        ))  # fmt: skip

    def follows(self) -> None:
        """Check that the next command works, and that the robot has the very same plan in the end."""
        outcome = self.order(MotionCommand(JointTarget(NOMINAL), insertion=Insertion.APPEND))
        assert outcome.receipt is not None, outcome.refusal
        self.lab.run(NOW + 1.0)
        assert self.robot.engine.timeline == self.operator.robot.engine.timeline
        assert self.robot.engine.timeline.end == outcome.receipt.end
        assert self.operator.report is not None
        assert self.operator.report.executed == self.operator.robot.log.count
        assert not self.operator.halted


def values(what: Any) -> Any:
    """Something in plain values that can be compared, bit by bit."""
    if isinstance(what, Timeline):
        segments = [(s.start, s.duration, s.command_id, s.coefficients.tobytes()) for s in what.segments]
        return what.version, what.start, what.initial.tobytes(), segments
    if isinstance(what, np.ndarray):
        return what.tobytes()
    if isinstance(what, dict):
        return [(key, values(value)) for key, value in what.items()]
    if isinstance(what, list | tuple | deque):
        return [values(part) for part in what]
    if isinstance(what, Receipt):
        return values(tuple(getattr(what, field.name) for field in fields(what)[:12]))
    if is_dataclass(what):
        return values(tuple(getattr(what, field.name) for field in fields(what)))
    if callable(what):
        return "callable"
    return what


@cache
def raised(path: str) -> dict[tuple[str, int], set[str]]:
    """The names of the errors that the functions of a file raise, by name and first line."""
    found: dict[tuple[str, int], set[str]] = {}
    for node in ast.walk(ast.parse(Path(path).read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            line = min([node.lineno, *(mark.lineno for mark in node.decorator_list)])
            calls = [
                one.exc for one in ast.walk(node) if isinstance(one, ast.Raise) and isinstance(one.exc, ast.Call)
            ]
            found[node.name, line] = {call.func.id for call in calls if isinstance(call.func, ast.Name)}
    return found


def ours(code: CodeType) -> bool:
    """Whether a function is one of ours on a command's way."""
    path = code.co_filename
    inside = path.startswith((f"{HOME}/vrs/", f"{HOME}/interfaces/"))
    return inside and (Path(path).name, code.co_name) not in GUARD


def called(action: Callable[[], object]) -> list[CodeType]:
    """Our functions that an action calls, in their order."""
    found: dict[CodeType, None] = {}

    def note(frame: FrameType, event: str, arg: object) -> None:
        if ours(frame.f_code):
            found.setdefault(frame.f_code)

    traced(action, note)
    return list(found)


def traced(action: Callable[[], object], trace: Callable[..., Any]) -> object:
    before = sys.gettrace()
    sys.settrace(trace)
    try:
        return action()
    finally:
        sys.settrace(before)


def failing(action: Callable[[], object], code: CodeType, error: Exception) -> object:
    """Do something of which the first call of a function raises."""
    left = [error]

    def fail(frame: FrameType, event: str, arg: object) -> None:
        if frame.f_code is code and left:
            raise left.pop()

    return traced(action, fail)


def errors_of(code: CodeType) -> list[Exception]:
    """What a function is made to raise: something that nobody expects, and of each kind that it raises itself."""
    names = raised(code.co_filename).get((code.co_name, code.co_firstlineno), set())
    known: list[Exception] = [
        ERRORS[name].__new__(ERRORS[name], "injected") for name in sorted(names & set(ERRORS))
    ]
    if "InvalidValueError" in names or "NonFiniteTimeError" in names:
        known.append(InvalidValueError("injected", 0, "something else"))
    return [RuntimeError("injected"), *known]


X = MODEL.forward(MODEL.poses["nominal"])
COMMANDS: dict[str, tuple[tuple[Command | None, ...], Command | None]] = {
    "move": ((), MotionCommand(JointTarget(READY), execute_at=1.5)),
    "move to a pose": ((), MotionCommand(PoseTarget(X), execute_at=1.5, insertion=Insertion.REPLACE)),
    "append": ((), MotionCommand(JointTarget(B), insertion=Insertion.APPEND)),
    "line": ((), MotionCommand(PoseTarget(X), execute_at=6.5, motion=Motion.LINE)),
    "steer": ((), SteerCommand(rates=np.full(6, 0.1))),
    "steer on": ((SteerCommand(rates=np.full(6, 0.1)),), SteerCommand(rates=np.full(6, -0.1))),
    "stop": ((), Stop()),
    "resume": ((Stop(),), Resume()),
    "retime": ((), Retime(2, 5.0)),
    "retime past another": ((), Retime(2, 12.0)),
    "cancel": ((), Cancel(2)),
    "via": ((), InsertVia(2, JointTarget(NOMINAL))),
    "scale": ((), ScaleTime(0.5)),
    "undo": ((), None),
    "undo what is under way": ((Stop(),), None),
    "redo": ((None,), Redo()),
    "parameter": ((), ParameterChange("lateness", "reject")),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_whatever_raises_it_is_done_or_it_isnt(name: str) -> None:
    before, command = COMMANDS[name]
    reference = Sites(*before)
    functions = called(lambda: reference.order(command))
    done = reference.state()
    sites = Sites(*before)
    state, newest = sites.state(), sites.operator.robot.engine.newest
    assert state != done
    assert len(functions) > 20
    tried = 0
    for code in functions:
        for error in errors_of(code):
            where = f"{code.co_filename}:{code.co_firstlineno} {code.co_name}: {error!r}"
            tried += 1
            try:
                outcome = failing(partial(sites.order, command), code, error)
                found = sites.state()
            except type(error):
                # The hub closes the client's connection; on the next one it gives the order again.
                found = sites.state()
                assert found in (state, done), where
                outcome = sites.order(command, again=True)
                assert outcome.refusal == "", where
                assert sites.state() == done, where
                sites = Sites(*before)
                continue
            assert isinstance(outcome, Outcome), where
            refused = bool(outcome.refusal) or (
                outcome.receipt is not None and outcome.receipt.status == "rejected"
            )
            if refused:
                assert found == state, where
            elif sites.notes.failure is not None:
                assert found[:-1] == done[:-1], where
            else:
                # Where a plan can't be, some commands go another way, and say so.
                assert found == done or (outcome.receipt is not None and outcome.receipt.reason), where
            if sites.operator.robot.engine.newest != newest or not refused:
                sites = Sites(*before)
    assert tried > 20
    sites.follows()


def test_a_command_that_cant_be_sent_isnt_taken() -> None:
    sites = Sites()
    state = sites.state()
    far = sites.order(MotionCommand(JointTarget(READY), execute_at=1e9))
    assert far.receipt is None
    assert "end of the plan" in far.refusal
    assert sites.state() == state
    late = sites.order(MotionCommand(JointTarget(READY), execute_at=8.9e8))
    assert late.receipt is not None
    assert sites.order(MotionCommand(JointTarget(A), insertion=Insertion.APPEND)).receipt is not None
    state = sites.state()
    assert FAILED not in sites.order(ParameterChange("lateness", object())).refusal
    assert "can't" not in sites.order(MotionCommand(JointTarget(A), execute_at=8.99e8)).refusal
    assert sites.order(Stop()).receipt is not None
    sites.follows()


def test_a_command_that_no_robot_would_read_isnt_taken() -> None:
    operator = OperatorSite(VirtualArm(MODEL, NOMINAL, now=0.0))
    limits = operator.robot.engine.limits
    for value in (1e-320, [1.0, 1.0, 1.0, 1.0, 1.0, 1e-320]):
        with pytest.raises(InvalidValueError, match=r"at least 2\.23e-308"):
            operator.robot.engine.execute(ParameterChange("qd_max", value))
    assert operator.robot.engine.limits is limits
    assert operator.robot.log.count == 0


@pytest.mark.parametrize("told", ["commanded", "answered", "reported", "measured"])
def test_a_recording_that_fails_stops_no_command(told: str) -> None:
    sites = Sites()
    setattr(sites.notes, told, lambda *_, **__: 1 / 0)
    assert sites.order(MotionCommand(JointTarget(READY), execute_at=1.5)).receipt is not None
    sites.robot.measured(NOMINAL, now=NOW)
    sites.follows()
    assert isinstance(sites.notes.failure, ZeroDivisionError)
    assert sites.operator.listener is None
