"""The watch sees every law that's broken: engines are spoiled in one way each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robots import puma560
from tests.vrs.laws import BOUNDS, Figures, LawBrokenError, check_run, columns, extremes
from tests.vrs.watch import Watch
from vrs import (
    Cancel,
    Engine,
    Insertion,
    JointTarget,
    Limits,
    ManualClock,
    MotionCommand,
    PolynomialSegment,
    Profile,
    Resume,
    Retime,
    ScaleTime,
    Stop,
    Timeline,
    scheduler,
)
from vrs.ledger import LedgerEntry, Receipt
from vrs.scheduler import Scheduler
from vrs.segment import Piece

MODEL = puma560.model()
A = np.array([0.0, 0.8, -2.4, 0.0, 0.6, 0.0])
B = np.array([0.9, 0.4, -1.8, 0.5, 0.2, 1.0])
C = np.array([-0.8, 1.1, -2.0, -0.4, 0.9, -1.0])
FAR = np.where(np.arange(6) == 0, MODEL.limits.q_max, A)
MINE = 4


def watched(profile: Profile = Profile.PARABOLIC, clock: ManualClock | None = None, speed: float = 1.0) -> Watch:
    watch = Watch(Engine(MODEL, q=A, clock=clock))
    for q, t in ((B, 0.5), (C, 3.0), (B, 5.0)):
        command = MotionCommand(JointTarget(q), None, t, speed, profile=profile, insertion=Insertion.APPEND)
        watch.execute(command)
    return watch


def splice(watch: Watch, q: np.ndarray = FAR, profile: Profile = Profile.PARABOLIC, t: float = 0.9) -> None:
    watch.execute(MotionCommand(JointTarget(q), execute_at=t, profile=profile))


def spoiled(timeline: Timeline, chosen: Callable[[list[PolynomialSegment]], int], bump: Any) -> Timeline:
    """A timeline with a polynomial added to one of its segments."""
    segments = list(timeline.segments)
    index = chosen(segments)
    segment = segments[index]
    more = np.asarray(bump(segment.duration) if callable(bump) else bump, float)
    a = np.zeros((max(len(segment.coefficients), len(more)), timeline.dof))
    a[: len(segment.coefficients)] = segment.coefficients
    a[: len(more), 0] += more
    segments[index] = replace(segment, coefficients=a)
    return Timeline(timeline.initial, timeline.start, segments, timeline.version)


def moving(segments: list[PolynomialSegment]) -> int:
    return 1


def second_of_mine(segments: list[PolynomialSegment]) -> int:
    return [i for i, segment in enumerate(segments) if segment.command_id == MINE][1]


def last(segments: list[PolynomialSegment]) -> int:
    return len(segments) - 1


def spoil_timelines(monkeypatch: pytest.MonkeyPatch, chosen: Any, bump: Any) -> None:
    accept = Scheduler.accept

    def spoiling(plan: Scheduler, entry: LedgerEntry, edit: Any, *args: Any, **kwargs: Any) -> Receipt:
        made = edit._replace(timeline=spoiled(edit.timeline, chosen, bump))
        return accept(plan, entry, made, *args, **kwargs)

    monkeypatch.setattr(Scheduler, "accept", spoiling)


def spoil_receipts(monkeypatch: pytest.MonkeyPatch, **changes: Callable[[Receipt], Any]) -> None:
    accept = Scheduler.accept

    def spoiling(plan: Scheduler, entry: LedgerEntry, *args: Any, **kwargs: Any) -> Receipt:
        wrong = {name: change(entry.receipt) for name, change in changes.items()}
        return accept(plan, entry._replace(receipt=replace(entry.receipt, **wrong)), *args, **kwargs)

    monkeypatch.setattr(Scheduler, "accept", spoiling)


def scale_limits(monkeypatch: pytest.MonkeyPatch, name: str, factor: float) -> None:
    """Let the watch judge by other limits than the engine plans with."""
    limits: Limits = MODEL.limits
    monkeypatch.setattr(
        Engine, "limits", property(lambda _: replace(limits, **{name: getattr(limits, name) * factor}))
    )


@pytest.mark.parametrize(
    ("law", "profile", "chosen", "bump"),
    [
        ("the past", Profile.PARABOLIC, moving, [0.0, 1e-13]),
        ("the tail", Profile.PARABOLIC, last, [0.0, 1e-13]),
        ("jump q [rad]", Profile.PARABOLIC, second_of_mine, [2e-9]),
        ("jump qd [rad/s]", Profile.PARABOLIC, second_of_mine, lambda h: [0.0, 2e-9, -2e-9 / h]),
        (
            "jump qdd [rad/s²]",
            Profile.JERK_LIMITED,
            second_of_mine,
            lambda h: [0.0, 0.0, 1e-7, -2e-7 / h, 1e-7 / h**2],
        ),
    ],
)
def test_a_spoiled_timeline_is_seen(
    law: str, profile: Profile, chosen: Any, bump: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    watch = watched(profile)
    spoil_timelines(monkeypatch, chosen, bump)
    with pytest.raises(LawBrokenError) as broken:
        splice(watch, profile=profile)
    assert broken.value.law == law


def test_a_move_that_a_retime_spoils_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    watch = watched()
    spoil_timelines(monkeypatch, last, [0.0, 1e-13])
    with pytest.raises(LawBrokenError, match="the tail"):
        watch.execute(Retime(1, 0.6))


def test_a_plan_that_ends_moving_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    watch = watched()
    scale_limits(monkeypatch, "qdd_max", 1.1)
    spoil_timelines(monkeypatch, last, lambda h: 1e-7 * np.array([0.0, 0.0, -1.0, 1.0 / h]))
    with pytest.raises(LawBrokenError, match="end's qd"):
        watch.execute(MotionCommand(JointTarget(A), speed=0.3, insertion=Insertion.APPEND))


@pytest.mark.parametrize(
    ("law", "name", "profile"),
    [
        ("position", "q_max", Profile.PARABOLIC),
        ("speed", "qd_max", Profile.PARABOLIC),
        ("acceleration", "qdd_max", Profile.PARABOLIC),
        ("jerk", "qddd_max", Profile.JERK_LIMITED),
    ],
)
def test_a_passed_limit_is_seen(law: str, name: str, profile: Profile, monkeypatch: pytest.MonkeyPatch) -> None:
    watch = Watch(Engine(MODEL, q=A))
    scale_limits(monkeypatch, name, 1.0 - 1e-8)
    with pytest.raises(LawBrokenError) as broken:
        splice(watch, profile=profile)
    assert broken.value.law == law


@pytest.mark.parametrize(
    ("law", "changes"),
    [
        ("receipt's q [rad]", {"q": lambda r: r.q + 2e-9}),
        ("tail's shift [s]", {"shift": lambda r: r.shift + 2e-9}),
        ("the past", {"execute_at": lambda r: r.execute_at + 1e-6}),
        ("receipts", {"shifted_names": lambda r: ()}),
        ("receipts", {"shifted_names": lambda r: (1, *r.shifted)}),
        ("receipts", {"superseded_names": lambda r: ()}),
        ("receipts", {"superseded_names": lambda r: (3, *r.superseded)}),
    ],
)
def test_an_untrue_receipt_is_seen(law: str, changes: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    watch = watched()
    spoil_receipts(monkeypatch, **changes)
    with pytest.raises(LawBrokenError) as broken:
        splice(watch, t=3.5)
    assert broken.value.law == law


def test_a_rejection_that_changes_something_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    watch, reject = watched(), Scheduler.reject

    def spoiling(plan: Scheduler, *args: Any) -> Receipt:
        plan.timeline = plan.timeline.with_version(plan.timeline.version + 1)
        return reject(plan, *args)

    monkeypatch.setattr(Scheduler, "reject", spoiling)
    with pytest.raises(LawBrokenError, match="nothing changed"):
        splice(watch, MODEL.limits.q_max + 1.0)


def test_an_undo_that_restores_something_else_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    watch, undo = watched(), Scheduler.undo
    splice(watch)

    def spoiling(plan: Scheduler, now: float | None) -> Receipt | None:
        answer = undo(plan, now)
        plan.timeline = spoiled(plan.timeline, last, [0.0, 0.0, 1e-12])
        return answer

    monkeypatch.setattr(Scheduler, "undo", spoiling)
    with pytest.raises(LawBrokenError, match="the timeline isn't what it was"):
        watch.undo()


def test_an_edit_of_the_past_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = ManualClock(0.0)
    watch, retimed = watched(clock=clock), watched()
    retimed.execute(Retime(3, 8.0))
    clock.advance(5.5)

    def spoil_past(scheduler: Scheduler, _command: Retime, _now: float | None) -> Receipt:
        receipt = retimed.engine.receipt(3)
        scheduler.timeline = retimed.engine.timeline
        scheduler.ledger.rewrite(replace(receipt, execute_at=8.0))
        return receipt

    monkeypatch.setattr(Scheduler, "execute", spoil_past)
    with pytest.raises(LawBrokenError, match="the past"):
        watch.execute(Retime(3, 8.0))


def cut_short(late: float = 0.0) -> tuple[Watch, float]:
    """A watch over a move whose receipt lies an ulp after its knot, and that time; with a clock."""
    watch = Watch(Engine(MODEL, q=A, clock=ManualClock()))
    watch.execute(MotionCommand(JointTarget(B), None, 0.5))
    watch.execute(MotionCommand(JointTarget(C), None, 0.788))
    watch.execute(Retime(2, 2.1))
    knot = next(s.start for s in watch.engine.timeline.segments if s.command_id == 2)
    assert 0.0 < 2.1 - knot <= 1e-12
    return watch, 2.1 + late


def test_a_move_taken_out_at_its_receipts_time_breaks_no_law() -> None:
    watch, t = cut_short()
    assert watch.execute(Cancel(2, execute_at=t)).undone


def test_a_move_under_way_that_is_taken_out_whole_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    watch, t = cut_short(late=1e-6)
    execute = Engine.execute
    monkeypatch.setattr(Engine, "execute", lambda engine, _: execute(engine, Cancel(2)))
    with pytest.raises(LawBrokenError, match="the past"):
        watch.execute(Cancel(2, execute_at=t))


def test_a_retime_of_the_rest_after_a_stop_breaks_no_law() -> None:
    watch = Watch(Engine(MODEL, q=A))
    end = watch.execute(MotionCommand(JointTarget(B), None, 0.5)).end
    watch.execute(Stop(execute_at=end - 1e-12))
    watch.execute(Resume())
    watch.execute(Retime(1, end - 0.1))
    assert watch.engine.receipt(1).execute_at == end - 0.1


@pytest.mark.parametrize("command", [ScaleTime(0.5, execute_at=0.9), Stop(execute_at=0.9)])
def test_leaving_the_way_is_seen(command: ScaleTime | Stop, monkeypatch: pytest.MonkeyPatch) -> None:
    watch, composed = watched(speed=0.3), scheduler.composed

    def spoiling(*args: Any) -> Iterator[Piece]:
        for piece in composed(*args):
            h = piece.durations[0]
            a = np.zeros((max(5, len(piece.coefficients[0])), 6))
            a[: len(piece.coefficients[0])] = piece.coefficients[0]
            a[2:5, 0] += 1e-7 * np.array([1.0 / h**2, -2.0 / h**3, 1.0 / h**4])
            yield Piece([h], [a], piece.command_id)

    scale_limits(monkeypatch, "qdd_max", 1.1)
    monkeypatch.setattr(scheduler, "composed", spoiling)
    monkeypatch.setattr(scheduler, "violation", lambda *_, **__: None)
    with pytest.raises(LawBrokenError, match="off the way"):
        watch.execute(command)


def test_a_wrong_pace_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    watch, rest = watched(), scheduler.remainder
    monkeypatch.setattr(scheduler, "remainder", lambda timeline, s, pace: rest(timeline, s, pace * (1.0 + 2e-9)))
    with pytest.raises(LawBrokenError, match="pace"):
        watch.execute(ScaleTime(0.5))


def test_a_gap_is_seen() -> None:
    run = columns(watched().engine.timeline)
    starts = run.starts.copy()
    starts[3:] += 2e-9
    with pytest.raises(LawBrokenError, match="gap"):
        check_run(replace(run, starts=starts), 0, len(run), MODEL.limits, set(), Figures())


def test_a_figure_that_is_nan_breaks_the_law() -> None:
    for law in BOUNDS:
        with pytest.raises(LawBrokenError):
            Figures().see(law, float("nan"))


@pytest.mark.parametrize("order", range(4))
@pytest.mark.parametrize("degree", [0, 1, 2, 3, 5, 9, 16])
def test_extremes_are_those_of_a_dense_grid(degree: int, order: int) -> None:
    rng = np.random.default_rng([degree, order])
    h = 10.0 ** rng.uniform(-3, 1, 40)
    a = rng.normal(size=(40, degree + 1, 3)) * (h[:, None] ** -np.arange(degree + 1))[:, :, None]
    a[:5, 1:] *= 1e-9
    low, high = extremes(a, h, order)
    for k in range(40):
        segment = PolynomialSegment(0.0, h[k], a[k])
        dense = segment.value(np.linspace(0.0, h[k], 4001), derivative=order)
        size = 1e-5 * np.abs(dense).max() + 1e-300
        assert (low[k] <= dense.min(0) + 1e-12 * size).all()
        assert (high[k] >= dense.max(0) - 1e-12 * size).all()
        assert (low[k] >= dense.min(0) - size).all()
        assert (high[k] <= dense.max(0) + size).all()


def test_columns_are_the_segments() -> None:
    watch = watched(Profile.JERK_LIMITED)
    splice(watch)
    run, segments = columns(watch.engine.timeline), watch.engine.timeline.segments
    assert len(run) == len(segments)
    assert run.starts.tolist() == [segment.start for segment in segments]
    assert run.durations.tolist() == [segment.duration for segment in segments]
    assert [owner or None for owner in run.owners] == [segment.command_id for segment in segments]
    for k, segment in enumerate(segments):
        assert np.array_equal(run.padded(k, k + 1)[0], segment.coefficients)
        assert run.index_at(segment.start) == k
