"""With what is claimed switched off, no claim holds any more: the opposite is planted, and each verdict turns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pytest

import vrs.insertion
import vrs.scheduler
from interfaces.clients.playhead import PlayHead
from interfaces.clients.viewer import Viewer
from interfaces.engine_server.broadcast import Broadcaster
from interfaces.engine_server.site import Site
from interfaces.lab import PAPERS
from interfaces.lab.claims import Figure, Study
from interfaces.lab.doulgeri import (
    agreement,
    broadcasting,
    causality,
    delays,
    dragging,
    encoding,
    interactivity,
    jitter,
    rivals,
    segments,
)
from interfaces.lab.doulgeri.script import HOME, ScriptedSite
from interfaces.station.dragging import DragLaw
from interfaces.teleop import following_arm
from tests.interfaces.lab.test_doulgeri_claims import but
from vrs import Engine, JointTarget, Profile, Timeline
from vrs.commands import Retime
from vrs.errors import PlanningError
from vrs.insertion import insert, piece
from vrs.scheduler import BaseScheduler, Scheduler

Patch = pytest.MonkeyPatch
STUDY = Study(seed=3, runs=2, length=4.0)
PARTS = {part.title: part for part in PAPERS["doulgeri"].parts}


def from_rest(patch: Patch) -> None:
    """Moves don't ask how fast the arm goes."""

    def planted(timeline: Any, t: Any, how: Any, command: Any, plan_move: Any, plan_join: Any) -> Any:
        def at_rest(state: Any) -> Any:
            rest = np.zeros_like(state.q)
            return plan_move(state._replace(qd=rest, qdd=rest))

        return insert(timeline, t, how, command, at_rest, plan_join)

    patch.setattr(vrs.scheduler, "insert", planted)


def too_early(patch: Patch) -> None:
    """Moves begin before t_exec."""

    def planted(timeline: Any, t: float, *more: Any) -> Any:
        return insert(timeline, max(t - 0.05, timeline.start), *more)

    patch.setattr(vrs.scheduler, "insert", planted)


def other_profile(patch: Patch) -> None:
    """Blends aren't parabolic."""
    planner = Scheduler.planner
    smooth = {"profile": Profile.JERK_LIMITED}
    patch.setattr(Scheduler, "planner", lambda self, command, *a: planner(self, replace(command, **smooth), *a))


def old_target(patch: Patch) -> None:
    """The first command's target is kept."""
    planner = Scheduler.planner

    def planted(self: Scheduler, command: Any, *more: Any) -> Any:
        if np.array_equal(command.target.q, segments.GOAL):
            command = replace(command, target=JointTarget(HOME + segments.STEP))
        return planner(self, command, *more)

    patch.setattr(Scheduler, "planner", planted)


def stretched_tail(patch: Patch) -> None:
    """What follows a move is played slower."""
    slow = 1.1

    def planted(timeline: Any, t: float, how: Any, command: int, *more: Any) -> Any:
        edit = insert(timeline, t, how, command, *more)
        made, at = [], None
        for s in edit.timeline.segments:
            if edit.tail is None or s.end <= edit.arrival + 1e-9 or s.command_id == command:
                made.append(s)
                continue
            powers = slow ** -np.arange(len(s.coefficients))[:, None]
            at = s.start if at is None else at
            made.append(replace(s, start=at, duration=slow * s.duration, coefficients=s.coefficients * powers))
            at = made[-1].end
        old = edit.timeline
        return edit._replace(timeline=Timeline(old.initial, old.start, made, old.version))

    patch.setattr(vrs.scheduler, "insert", planted)


def rounded(patch: Patch) -> None:
    """Coefficients of what's inserted are a little wrong."""

    def planted(plan: Any, command: int) -> Any:
        made = piece(plan, command)
        rows = [np.vstack((row[:1] + 2e-9, row[1:])) for row in made.coefficients]
        return made._replace(coefficients=rows)

    patch.setattr(vrs.insertion, "packed", planted)


def no_causality(patch: Patch) -> None:
    """The past may be rewritten."""
    timing = BaseScheduler.timing

    def planted(self: Any, command: Any, now: float | None, soonest: float) -> Any:
        return timing(self, command, None, soonest if now is None else now)

    patch.setattr(BaseScheduler, "timing", planted)


def no_offset(patch: Patch) -> None:
    """The robot's clock isn't shifted."""
    init = following_arm.EvenPlay.__init__

    def planted(self: Any, D: float, *more: Any) -> None:
        init(self, max(D, 0.0), *more)

    patch.setattr(following_arm.EvenPlay, "__init__", planted)


def wrong_offset(patch: Patch) -> None:
    """The engine's clock is 0.1 s ahead of what D makes it."""
    time = Site.time
    patch.setattr(Site, "time", lambda self, now: time(self, now + 0.1))


def no_prediction(patch: Patch) -> None:
    """Frames are of the time at which they're made."""
    broadcast = Site.broadcast
    patch.setattr(Site, "broadcast", lambda self, rate, **_: broadcast(self, rate))


def stale_frames(patch: Patch) -> None:
    """Frames show where the robot was before."""
    sample, advance = Timeline.sample, Broadcaster.advance

    def planted(self: Broadcaster, *, now: float) -> Any:
        with pytest.MonkeyPatch.context() as within:
            within.setattr(Timeline, "sample", lambda line, t, **how: sample(line, np.asarray(t) - 0.05, **how))
            return advance(self, now=now)

    patch.setattr(Broadcaster, "advance", planted)


def one_loop(patch: Patch) -> None:
    """All broadcasters are served by one loop."""
    patch.setattr(Site, "kind", broadcasting.TickedBroadcaster, raising=False)
    patch.setattr(Site, "broadcast", broadcasting.TickedSite.broadcast)


def robot(module: Any, made: rivals.RobotMaker, patch: Patch) -> None:
    """Another robot in the place of ours."""
    patch.setattr(module, "adaptive", made)


def as_rivals(patch: Patch) -> None:
    """The encodings are their rivals: no prediction, no segments, frames joined by lines."""
    measure = encoding.measure

    def planted(*given: Any) -> Any:
        found = measure(*given)
        return but(
            found,
            segments=found.frames_single,
            compact=found.frames_single,
            commands=found.segments,
            rebuilt=found.joined,
            compact_error=found.joined_few,
        )

    patch.setattr(encoding, "measure", planted)


def feedback_alone(patch: Patch) -> None:
    """The law doesn't ask for the hand's speed."""
    speed = DragLaw.speed
    patch.setattr(DragLaw, "speed", lambda _, *given: speed(DragLaw(), *given))


def queue(patch: Patch) -> None:
    """Inputs wait for each other."""
    patch.setattr(dragging, "steering", lambda _: dragging.queueing())


def slow_link(patch: Patch) -> None:
    """What's known comes later than the link makes it."""
    connect = ScriptedSite.connect
    patch.setattr(ScriptedSite, "connect", lambda self, there, back: connect(self, there, back + 0.2))


def no_edits(patch: Patch) -> None:
    """The engine can't let a move begin at another time."""

    carry_out = Scheduler.carry_out

    def planted(self: Scheduler, command: Any, now: float | None) -> Any:
        if isinstance(command, Retime):
            raise PlanningError("moves stay as they are")
        return carry_out(self, command, now)

    patch.setattr(Scheduler, "carry_out", planted)


def no_seeking(patch: Patch) -> None:
    """Viewers stay where they are."""
    patch.setattr(Viewer, "seek", lambda *_, **__: None)
    patch.setattr(Viewer, "pause", lambda *_, **__: None)


def jump_to_live(patch: Patch) -> None:
    """Going live is a jump."""

    go_live = PlayHead.go_live
    patch.setattr(PlayHead, "go_live", lambda self, *, now, wait=0.0: go_live(self, now=now - 60.0, wait=wait))


def one_head(patch: Patch) -> None:
    """Viewers share a place in time."""
    init = interactivity.InteractiveSession.__init__

    def planted(self: interactivity.InteractiveSession) -> None:
        init(self)
        self.other.head = self.viewers[interactivity.ViewForm.SEGMENTS].head

    patch.setattr(interactivity.InteractiveSession, "__init__", planted)


def late_and_no_link(patch: Patch) -> None:
    """A fixed offset, and what comes back puts nothing right."""

    def planted(*_: Any) -> Any:
        raise PlanningError("nothing is known of the real robot")

    robot(agreement, rivals.postponing(agreement.SHORT), patch)
    patch.setattr(Engine, "anchor", planted)


def both(*switches: Callable[[Patch], None]) -> Callable[[Patch], None]:
    """Several at once."""

    def planted(patch: Patch) -> None:
        for switch in switches:
            switch(patch)

    return planted


class Planted(NamedTuple):
    """What is switched off, one after the other, in a part."""

    switches: tuple[Callable[[Patch], None], ...]
    cases: tuple[str, ...] | None = None


PLANTED = {
    "Fig. 1: segments": Planted((from_rest, too_early, other_profile, old_target, stretched_tail, rounded)),
    "Section II-C: causality": Planted((no_causality, no_offset, wrong_offset)),
    "Figs 4 to 6: delays": Planted((wrong_offset, no_prediction, stale_frames)),
    "Section VI-B: broadcasters": Planted((one_loop,)),
    "(a) jitter": Planted(
        (
            partial(robot, jitter, rivals.postponing(-0.5)),
            partial(robot, jitter, rivals.jumping),
            partial(robot, jitter, rivals.halting),
            partial(robot, jitter, rivals.waiting(-jitter.delay_profile("thu").quantile(0.95))),
        ),
        jitter.WAITED,
    ),
    "(b) compact encoding": Planted((as_rivals,)),
    "(c) dragging the tool": Planted(
        (
            both(feedback_alone, partial(robot, dragging, rivals.jumping)),
            both(queue, partial(robot, dragging, rivals.postponing(0.0))),
        ),
        ("0",),
    ),
    "(d) interactivity": Planted((both(slow_link, no_edits), no_seeking, both(jump_to_live, one_head))),
    "(e) virtual and real": Planted(
        (partial(robot, agreement, rivals.postponing(agreement.SHORT)), late_and_no_link)
    ),
}


def test_every_part_is_planted_in() -> None:
    assert set(PLANTED) == set(PARTS)


@pytest.mark.slow
@pytest.mark.parametrize("title", PLANTED)
def test_what_is_switched_off_turns_its_claims(title: str, monkeypatch: pytest.MonkeyPatch) -> None:
    part, (switches, cases) = PARTS[title], PLANTED[title]
    module = next(
        m
        for m in (segments, causality, delays, broadcasting, jitter, encoding, dragging, interactivity, agreement)
        if m.work is part.work
    )
    if hasattr(module, "draw"):
        monkeypatch.setattr(module, "draw", lambda *_, **__: Figure("", "", ""))
    monkeypatch.setattr(broadcasting, "over_sockets", lambda _: ())
    monkeypatch.setattr(broadcasting, "TIMED", 100)
    monkeypatch.setattr(dragging, "LENGTH", 5.0)
    monkeypatch.setattr(agreement, "PATIENCE", 12.0)
    if module is jitter:
        monkeypatch.setattr(jitter, "CASES", cases)
    cases = part.cases if cases is None else cases
    left: dict[int, str] = {}
    for k, switch in enumerate(switches):
        with pytest.MonkeyPatch.context() as patch:
            switch(patch)
            found = part.conclude(STUDY, tuple(part.work(STUDY, case) for case in cases))
        holding = {i: claim.claim for i, claim in enumerate(found.claims) if claim.holds}
        left = holding if not k else {i: text for i, text in left.items() if i in holding}
    assert found.claims
    assert left == {}
