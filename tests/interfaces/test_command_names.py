"""What commands are called: the order says it, and everyone who follows the timeline is told."""

from __future__ import annotations

from interfaces.engine_server.site import Site
from interfaces.messages import Change, Follow, Order, Scene, ViewForm, Want
from interfaces.messages.requests import NAMED
from robots import puma560
from vrs import Engine, JointTarget, ManualClock, MotionCommand, Retime, SteerCommand
from vrs.commands import Cancel, Grip

MODEL = puma560.model()
RATES = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0]


class Lesson:
    """One who commands, and others who watch."""

    def __init__(self) -> None:
        self.clock = ManualClock(0.0)
        self.site = Site(Engine(MODEL, q=MODEL.poses["nominal"], clock=self.clock))
        self.hand = self.site.servlet()
        self.number = 0

    def order(self, command, label=""):
        self.number += 1
        self.hand.receive(Order(self.number, command, 1, label), now=self.clock.now())

    def watcher(self):
        """One who follows from now on; what it's told first."""
        watcher = self.site.servlet()
        watcher.receive(Follow(1, ViewForm.SEGMENTS), now=self.clock.now())
        (scene,) = (reply for reply in watcher.advance(now=self.clock.now()) if isinstance(reply, Scene))
        return watcher, scene

    def told(self, watcher):
        """Names of the changes that a watcher is told now."""
        replies = watcher.advance(now=self.clock.now())
        return [reply.name for reply in replies if isinstance(reply, Change)]


def test_a_name_comes_with_the_change_and_with_the_scene():
    lesson = Lesson()
    watcher, scene = lesson.watcher()
    assert scene.names == ()
    lesson.order(MotionCommand(JointTarget(MODEL.poses["ready"]), execute_at=5.0, speed=0.3), "ready")
    (name,) = lesson.told(watcher)
    assert (name.command_id, name.t, name.kind, name.label, name.speed) == (1, 0.0, "move", "ready", 0.3)
    lesson.order(Retime(1, 7.0), "not a name")
    assert lesson.told(watcher) == [None]
    # What got lost is asked for, and whoever comes later knows as much.
    watcher.receive(Want(0), now=0.0)
    assert lesson.told(watcher) == [name, None]
    assert lesson.watcher()[1].names == (name,)


def test_steering_is_called_anew_where_it_goes_another_way():
    lesson = Lesson()
    watcher, _ = lesson.watcher()
    for k in range(8):
        lesson.order(SteerCommand(rates=RATES if k < 4 else [-x for x in RATES]), "J1 +" if k < 4 else "J1 −")
        lesson.clock.advance(0.04)
    names = [name for name in lesson.told(watcher) if name is not None]
    assert [(name.command_id, name.kind, name.label) for name in names] == [
        (1, "steer", "J1 +"),
        (1, "steer", "J1 −"),
    ]
    assert names[1].t == 4 * 0.04


def test_what_is_rejected_has_no_name_and_the_oldest_are_forgotten():
    lesson = Lesson()
    lesson.order(MotionCommand(JointTarget([9.0] * 6)), "too far")
    assert lesson.watcher()[1].names == ()
    for k in range(NAMED + 5):
        lesson.order(MotionCommand(JointTarget(MODEL.poses["nominal"]), execute_at=1.0 + k), str(k))
    names = lesson.watcher()[1].names
    assert [name.label for name in names] == [str(k) for k in range(5, NAMED + 5)]


def test_a_grip_has_a_name_from_its_time_on_that_everybody_is_told():
    lesson = Lesson()
    watcher, _ = lesson.watcher()
    lesson.order(MotionCommand(JointTarget(MODEL.poses["ready"]), execute_at=5.0), "ready")
    before = lesson.site.engine.timeline
    lesson.order(Grip(0.0, execute_at=7.0), "Close the hand")
    first, grip = lesson.told(watcher)
    assert (grip.command_id, grip.kind, grip.label, grip.t) == (2, "grip", "Close the hand", 7.0)
    assert lesson.watcher()[1].names == (first, grip)
    # Nothing moves by it, and what comes after it is told as ever.
    assert lesson.site.engine.timeline is before
    lesson.order(Cancel(1), "")
    assert lesson.told(watcher) == [None]
