"""The hand and things, from the command to the recording: plans and programs on both twins, and what is between."""

from __future__ import annotations

import json
import select
from math import inf
from pathlib import Path

import numpy as np
import pytest

from interfaces.link import delay_profile
from interfaces.messages.sites import Orders
from interfaces.recording.playback import Playback
from interfaces.recording.recording import open_recording
from interfaces.recording.rerun import rerun
from interfaces.recording.run_recorders import RunRecorder
from interfaces.recording.stages import Stage
from interfaces.runtime.physics import PhysicsConfig, PhysicsProcess
from interfaces.runtime.physics_messages import Measurement, PhysicsReady, Rows
from interfaces.runtime.plan import RunPlan, parse_plan
from interfaces.runtime.session import run_twins
from interfaces.runtime.tick_loop import Moved, TickLoop
from interfaces.teleop import FollowingArm
from interfaces.teleop.predicted_grasp import PredictedGrasp
from interfaces.val2.playing import Listeners
from interfaces.val2.source import parse_file
from interfaces.val2.twins import play
from robots.bullet.grasping import HandState
from robots.robot import exact_arm
from robots.things import Scene, Thing, read_scene
from tests.interfaces.own_arm import ROBOT as CRANE
from tests.interfaces.ticks import LIMITS, MODEL, NOMINAL, ROBOT, TICK, standing
from vrs import Engine, Grip, JointTarget, ManualClock, MotionCommand, WallClock
from vrs.errors import FormatError, InvalidValueError
from vrs.model import Array
from vrs.scheduler import HandGoal

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
FLANGE, TIP = 0.05625, 0.055
TOP = -0.4
"""Height of the table [m]."""


def down(x: float, y: float, z: float) -> Array:
    """Joints with which the middle between the fingers is at a place, the hand pointing down."""
    X = np.diag((1.0, -1.0, -1.0, 1.0))
    X[:3, 3] = x, y, z + FLANGE + TIP
    return MODEL.inverse_near(X, NOMINAL)


def plan(mass: float) -> RunPlan:
    """A box is taken, carried 15 cm aside, and dropped from 4 cm above the table."""
    degrees = [
        np.degrees(down(0.45, y, TOP + z)).round(3).tolist() for y, z in ((0.1, 0.03), (0.1, 0.1), (0.25, 0.07))
    ]
    low, high, aside = degrees
    table = {"name": "table", "box": [0.5, 0.8, 0.04], "at": [0.5, 0.1, TOP - 0.02], "friction": 1.0}
    box = {"name": "box", "box": [0.05, 0.05, 0.06], "at": [0.45, 0.1, TOP + 0.03], "mass": mass, "friction": 0.6}
    lines = [
        {"schema": "vrs-plan/1", "start": low, "floor": -0.672},
        {"thing": table},
        {"thing": box},
        {"issue": 0.1, "grip_mm": 0},
        {"issue": 0.1, "execute": 0.8, "move": high, "speed": 0.4},
        {"issue": 0.2, "move": aside, "speed": 0.3, "insertion": "append"},
        {"issue": 0.3, "execute": 4.0, "grip_mm": "open"},
    ]
    return parse_plan("\n".join(map(json.dumps, lines)).encode(), "plan.jsonl", MODEL)


def run(path: Path, mass: float, **options: object) -> bytes:
    recorder = RunRecorder(path)
    run_twins(plan(mass), ROBOT, delay_profile("constant:0.3"), seed=1, keeper=recorder, **options)  # type: ignore[arg-type]
    recorder.finish()
    return path.read_bytes()


@pytest.mark.needs("pybullet")
def test_a_box_is_carried_and_dropped_recorded_and_played_back(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    run(path, 0.5)
    with open_recording(path) as recording:
        scene, hands = recording.hands.scene, recording.hands
        assert scene is not None
        assert [thing.name for thing in scene.things] == ["table", "box"]
        assert recording.grips == (HandGoal(0.1, 0.0), HandGoal(4.0, inf))
        assert rerun(recording).identical
        before, carried, dropped = (np.array(hands.poses(t)[0]) for t in (0.2, 4.0, recording.span[1]))
        assert before[:3] == pytest.approx((0.45, 0.1, TOP + 0.03), abs=1e-3)
        assert carried[:3] == pytest.approx((0.45, 0.25, TOP + 0.07), abs=5e-3)
        assert dropped[:3] == pytest.approx((0.45, 0.25, TOP + 0.03), abs=5e-3)
        assert hands.opening(2.0) == pytest.approx(0.05, abs=1e-3)
        # The real hand is behind by the link's delay and what the robot keeps.
        assert hands.opening(0.3) == pytest.approx(0.1, abs=1e-3)
        assert hands.opening(recording.span[1]) == pytest.approx(0.1, abs=1e-3)
        playback, stage = Playback([recording]), Stage(recording)
        for t in np.arange(0.0, 3.0, 0.1).tolist():
            moment = playback.moment(t)
            stage.show(moment.frames[0], None, now=t)
        shown = stage.scene.values
        # Its things, as they were measured; and the box once more, where the virtual hand has it.
        assert {"/vrs/fixed/0 object", "/vrs/things/0 object", "/vrs/virtual/body/6/hand/2 object"} <= shown.keys()
        assert b"\xc3" in shown["/vrs/predicted/0 visible"][1]


@pytest.mark.needs("pybullet")
def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    first, again = (run(tmp_path / "run.mcap", 0.5, arm=exact_arm) for _ in range(2))
    assert first == again


@pytest.mark.needs("pybullet")
def test_what_is_too_heavy_for_the_grip_stays_where_it_is(tmp_path: Path) -> None:
    # 2 μ F = 48 N bear 4.9 kg.
    run(tmp_path / "run.mcap", 5.5, arm=exact_arm)
    with open_recording(tmp_path / "run.mcap") as recording:
        assert recording.hands.poses(3.5)[0][2] < TOP + 0.035


@pytest.mark.needs("pybullet")
@pytest.mark.parametrize("there", [True, False])
def test_a_program_feels_whether_the_hand_closed_on_something(there: bool) -> None:
    scene = read_scene(EXAMPLES / "val2" / "13_grasp.toml")
    scene = scene if there else Scene(scene.floor, scene.things[:1])
    text = (EXAMPLES / "val2" / "13_grasp.v2").read_text(encoding="utf-8")
    said: list[str] = []
    listeners = Listeners(typed=said.append)
    source = parse_file(text, "grasp.v2")
    played = play(source, ROBOT, delay_profile("constant:0.2"), exact_arm, seed=0, scene=scene, listeners=listeners)
    assert played.error is None
    assert played.plan.scene == scene
    said_so = "50 mm of something are in the hand\r\n" if there else "There's nothing in the hand\r\n"
    assert "".join(said).replace("\r\n", "\n") == said_so.replace("\r\n", "\n")


def test_a_grip_has_its_time_and_leaves_the_timeline_alone() -> None:
    clock = ManualClock(0.0)
    engine = Engine(MODEL, q=NOMINAL, clock=clock)
    assert engine.opening() == inf
    engine.execute(MotionCommand(JointTarget(NOMINAL + 0.1)))
    timeline = engine.timeline
    later = engine.execute(Grip(0.02, execute_at=1.0))
    now = engine.execute(Grip(0.05))
    assert (later.execute_at, later.end, now.execute_at) == (1.0, 1.0, 0.0)
    assert engine.opening([-0.1, 0.0, 0.9, 1.0, 9.0]).tolist() == [inf, 0.05, 0.05, 0.02, 0.02]
    assert engine.timeline is timeline
    # An undo is of the motion; a stop drops what's still to come.
    assert engine.undo() == engine.receipt(1)
    engine.stop()
    assert engine.opening(2.0) == 0.05
    clock.set(3.0)
    late = engine.execute(Grip(0.01, issued_at=2.0, execute_at=2.5))
    assert (late.status, late.execute_at) == ("postponed", 3.0)
    other = Engine(MODEL, timeline=engine.timeline, clock=clock)
    other.take_up(engine.standing())
    assert other.opening(3.0) == 0.01
    with pytest.raises(InvalidValueError, match="opening"):
        Grip(-0.01)


def test_a_hand_keeps_what_it_holds_when_the_robot_halts() -> None:
    site = FollowingArm(MODEL, NOMINAL, now=0.0, opening=0.03)
    assert site.openings(site.play_at(np.array([0.5]))).tolist() == [0.03]
    site.receive(Orders(1, 1, 0.0, 0, 0.0, 0.0), now=0.1)
    site.engine.execute(Grip(0.01, execute_at=0.0))
    site.engine.execute(Grip(inf, execute_at=9.0))
    for now in (0.2, 0.3):
        site.receive(Orders(1, round(10 * now), now, 0, now, 0.0), now=now)
        site.advance(now=now)
    site.halt("a fault", now=0.5)
    assert site.openings(site.play_at(np.array([0.5, 20.0]))).tolist() == [0.01, 0.01]
    site.hand(HandState(0.02, 0.01, 0, ((0.0,) * 6 + (1.0,),)))
    reports = [site.advance(now=0.5 + 0.101 * k)[-1].hand for k in range(30)]
    assert all(report is not None and report.holds == 0 for report in reports)
    told = [len(report.things) for report in reports if report is not None]
    assert told[0] == 1
    # What lies still is told now and then.
    assert 3 <= sum(told[5:]) <= 4


class Hand:
    """Notes what it's told, and does nothing."""

    def __init__(self) -> None:
        self.told: list[float] = []

    def prepare(self, rows: Array) -> list[Array]:
        return list(rows)

    def step(self, prepared: Array) -> Moved:
        return Moved(prepared[0].tolist(), prepared[1].tolist(), ())

    def attach(self, mass: float) -> None:
        raise AssertionError(mass)

    def release(self) -> None:
        raise AssertionError

    def grip(self, opening: float) -> None:
        self.told.append(opening)

    def state(self) -> HandState:
        return HandState(0.1, 0.1, None, ())


def test_fingers_are_told_at_their_ticks_and_newer_orders_count() -> None:
    hand = Hand()
    loop = TickLoop(hand, LIMITS, tuple(NOMINAL), tick=TICK, every=1, now=0.0, hand=hand)
    data = np.stack(standing(NOMINAL), axis=1).tobytes()
    loop.receive(Rows(0, 1, placed=False, data=data, grips=((1, inf), (5, 0.02), (9, 0.03))))
    for tick in range(1, 8):
        loop.advance(now=TICK * tick)
    assert hand.told == [inf, 0.02]
    loop.receive(Rows(0, 8, placed=False, data=data, grips=((8, 0.02), (12, 0.01))))
    for tick in range(8, 14):
        loop.advance(now=TICK * tick)
    assert hand.told == [inf, 0.02, 0.02, 0.01]
    assert all(news.hand is not None for news in loop.take() if isinstance(news, Measurement))


@pytest.mark.needs("pybullet")
def test_a_process_of_its_own_has_the_hand_and_the_things() -> None:
    thing = Thing("can", (0.4, 0.3, -0.6), cylinder=(0.03, 0.1), mass=0.2)
    clock = WallClock(0.0)
    with pytest.raises(InvalidValueError, match="fingers"):
        PhysicsConfig(CRANE, np.array([0.0, 0.2, 1.0]), scene=Scene(0.0))
    config = PhysicsConfig(ROBOT, NOMINAL, "ideal", scene=Scene(-0.672, (thing,)))
    with PhysicsProcess(config, clock) as physics:
        hand, ready, end = None, None, clock.now() + 30.0
        while (hand is None or hand.opening > 0.001) and clock.now() < end:
            select.select([physics], [], [], 0.1)
            for event in physics.poll(now=clock.now()):
                if isinstance(event, PhysicsReady):
                    ready = event.tick
                    physics.feed(standing(NOMINAL), ready + 20, grips=((ready + 20, 0.0),))
                elif isinstance(event, Measurement):
                    hand = event.hand
        assert hand is not None
        assert hand.opening < 0.001
        # It was 22 mm above the floor.
        assert hand.poses[0][2] == pytest.approx(-0.622, abs=1e-3)


def test_a_virtual_hand_takes_along_what_it_closes_on() -> None:
    gripper = ROBOT.hand
    assert gripper is not None
    thing = Thing("box", (0.45, 0.1, 0.0), box=(0.04, 0.05, 0.06), mass=0.2)
    grasp, poses = PredictedGrasp(gripper, Scene(-0.6, (thing,))), {0: thing.pose}
    X = MODEL.forward(down(0.45, 0.1, 0.0))
    goals = [HandGoal(-inf, inf), HandGoal(1.0, 0.0)]
    assert grasp.advance(X, goals, poses, now=0.5) == (0.1, None)
    opening, taken = grasp.advance(X, goals, poses, now=1.05)
    assert opening == pytest.approx(0.075)
    assert taken is None
    lifted = X.copy()
    lifted[2, 3] += 0.2
    assert grasp.advance(X, goals, poses, now=2.0)[0] == pytest.approx(0.04)
    opening, taken = grasp.advance(lifted, goals, poses, now=2.1)
    assert opening == pytest.approx(0.04)
    assert taken is not None
    assert taken[0] == 0
    assert taken[1][:3, 3] == pytest.approx((0.45, 0.1, 0.2), abs=1e-9)
    goals.append(HandGoal(3.0, inf))
    assert grasp.advance(lifted, goals, poses, now=3.1)[1] is None
    # Elsewhere it closes on nothing.
    empty = PredictedGrasp(gripper, Scene(-0.6, (thing,)))
    assert empty.advance(lifted, [HandGoal(1.0, 0.0)], poses, now=2.0) == (0.0, None)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('{"issue": 0, "grip_mm": -1}', "opening"),
        ('{"issue": 0, "grip_mm": "wide"}', "wide"),
        ('{"grip_mm": 0}', "issue"),
        ('{"thing": {"name": "a", "at": [0, 0, 0], "box": [1, 1, 1]}}', "floor"),
        ('{"issue": 0, "grip_mm": 0, "speed": 0.5}', "speed"),
    ],
)
def test_plans_say_what_is_wrong_with_the_hand(line: str, said: str) -> None:
    with pytest.raises(FormatError, match=rf"plan.jsonl:1: .*{said}"):
        parse_plan(line.encode(), "plan.jsonl", MODEL)
