"""Plan files: what they mean, and that every mistake is named by file and line."""

from __future__ import annotations

import contextlib
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.runtime.plan import MAX_BYTES, MAX_COMMANDS, default_plan, parse_plan, read_plan, written_plan
from robots import puma560
from vrs import Engine, Insertion, JointTarget, ManualClock, Motion, MotionCommand, PoseTarget, Profile
from vrs.commands import Grip
from vrs.errors import FormatError, InvalidValueError

model = puma560.model()
MOVE = '{"issue": 1, "move": [10, 60, -170, 0, 30, 0]}'


def parse(*lines):
    return parse_plan("\n".join(lines).encode(), "plan.jsonl", model)


def test_every_field_reaches_its_command():
    plan = parse(
        '{"schema": "vrs-plan/1", "title": "T", "start": {"pose": "ready"}, "comment": "c"}',
        '{"issue": 3, "register": 4.5, "execute": 3.5, "move": [10, 60, -170, 0, 30, 0], "speed": 0.5, '
        '"profile": "jerk-limited", "insertion": "replace"}',
        "",
        '{"issue": 2, "move": {"pose": "nominal"}, "comment": "earlier"}',
        '{"issue": 5, "payload": {"mass_kg": 2.5}}',
        '{"issue": 6, "release": true}',
        '{"comment": "nothing"}',
    )
    assert plan.title == "T"
    assert np.array_equal(plan.start, model.poses["ready"])
    first, second = plan.motions
    assert first.where == "plan.jsonl:4"
    assert first.registered_at == first.command.issued_at == 2
    assert first.command.execute_at is None
    assert first.command.target == JointTarget(model.poses["nominal"])
    assert second.registered_at == 4.5
    assert (second.command.issued_at, second.command.execute_at, second.command.speed) == (3, 3.5, 0.5)
    assert second.command.target == JointTarget(np.radians([10, 60, -170, 0, 30, 0]))
    assert (second.command.profile, second.command.insertion) == (Profile.JERK_LIMITED, Insertion.REPLACE)
    assert [(item.t, item.mass) for item in plan.payloads] == [(5, 2.5), (6, None)]
    (passes,) = parse(
        '{"issue": 1, "move": {"pose": "ready"}, "deviation_mm": 30, "pace": 0.5, "acceleration": 0.25, '
        '"tool": {"xyz": [0, 0, 0.1], "zyz_deg": [90, 0, 0]}}'
    ).motions
    command = passes.command
    assert (command.deviation, command.pace, command.acceleration) == (0.03, 0.5, 0.25)
    assert command.tool == pytest.approx(np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0.1], [0, 0, 0, 1]]))
    assert parse(MOVE.replace("}", ', "deviation_mm": "inf"}')).motions[0].command.deviation == math.inf


def planned() -> tuple[Engine, np.ndarray]:
    """An engine with much to do from 5 s on, and the tool of its lines."""
    poses, engine = model.poses, Engine(model, q=model.poses["nominal"], clock=ManualClock(1.0))
    tool = model.forward(poses["nominal"] + 0.4)
    tool[:3, 3] = 0.0, 0.02, 0.1

    def move(q, **how):
        how.setdefault("insertion", Insertion.APPEND)
        return engine.execute(MotionCommand(JointTarget(q), **how))

    move(poses["ready"], execute_at=5.0, speed=0.5)
    # Rounded with less of the limits: it's planned anew from the beginning of the one before.
    move(poses["nominal"] + 0.2, deviation=0.1, speed=0.6)
    move(poses["stretch"] * 0.6)
    move(poses["nominal"] + 0.1, profile=Profile.JERK_LIMITED, deviation=math.inf)
    by = move(poses["ready"], execute_at=20.0, speed=0.5)
    engine.insert_via(by.command_id, JointTarget(poses["nominal"] + 0.3), deviation=0.05)
    # On its way it's led elsewhere.
    move(
        poses["nominal"], execute_at=engine.receipt(by.command_id).end - 0.7, speed=0.5, insertion=Insertion.SPLICE
    )
    stops = move(poses["stretch"] * 0.7, execute_at=30.0, pace=0.5)
    engine.insert_via(stops.command_id, JointTarget(poses["nominal"] + 0.15))
    move(poses["nominal"] + 0.1)
    X = model.forward(poses["nominal"] + 0.1)
    X[2, 3] += 0.05
    turn = np.eye(4)
    turn[:2, :2] = [[0.8, -0.6], [0.6, 0.8]]
    straight = engine.execute(MotionCommand(PoseTarget(X @ turn), execute_at=40.0, motion=Motion.LINE, tool=tool))
    X[2, 3] -= 0.1
    engine.insert_via(straight.command_id, PoseTarget(X), deviation=0.02)
    engine.execute(Grip(0.0, execute_at=9.0))
    engine.execute(Grip(math.inf, execute_at=12.0))
    assert all(receipt.status != "rejected" for receipt in engine.receipts)
    return engine, tool


def test_what_is_planned_takes_the_same_path_from_a_file() -> None:
    engine, tool = planned()
    data = written_plan(engine, "Vias", {1: "up", 2: ""})
    plan = parse_plan(data, "plan.jsonl", model)
    again = Engine(model, q=plan.start, clock=ManualClock(0.0))
    for motion in plan.motions:
        assert again.execute(motion.command).status != "rejected"
    shift = 5.0 - next(part.start for part in again.timeline.segments if part.command_id is not None)
    assert again.timeline.end + shift == pytest.approx(engine.timeline.end, abs=1e-9)
    t = np.arange(5.0, engine.timeline.end, 0.01)
    assert again.joints(t - shift) == pytest.approx(engine.joints(t), abs=1e-9)
    tools = [motion.command.tool for motion in plan.motions if isinstance(motion.command, MotionCommand)]
    assert [found for found in tools if found is not None] == [pytest.approx(tool)] * 2
    hand = np.array([8.999, 9.001, 11.999, 12.001])
    assert again.opening(hand - shift).tolist() == engine.opening(hand).tolist() == [math.inf, 0, 0, math.inf]
    assert data.splitlines()[1].endswith(b'"comment": "up"}')
    # What has begun isn't to come any more, and after the end nothing is.
    engine.clock.advance(20.0)
    assert len(parse_plan(written_plan(engine, "Later", {}), "plan.jsonl", model).motions) < len(plan.motions)
    engine.clock.advance(engine.timeline.end)
    with pytest.raises(InvalidValueError, match="still to come"):
        written_plan(engine, "Over", {})


def test_a_pose_is_zyz_about_the_base():
    target = parse('{"issue": 0, "move": {"xyz": [0.45, -0.15, 0.1], "zyz_deg": [30, 180, 0]}}').motions[0]
    X = target.command.target.X
    assert isinstance(target.command.target, PoseTarget)
    assert X[:3, 3] == pytest.approx([0.45, -0.15, 0.1])
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    assert X[:3, :3] == pytest.approx(np.array([[-c, -s, 0], [-s, c, 0], [0, 0, -1]]))


def test_the_middle_angle_turns_about_y():
    target = parse('{"issue": 0, "move": {"xyz": [0.45, -0.15, 0.1], "zyz_deg": [0, 90, 0]}}').motions[0]
    assert target.command.target.X[:3, :3] == pytest.approx(np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]))


def test_what_happens_is_in_the_order_of_its_times():
    late = '{"issue": 1, "register": 9, "move": {"pose": "nominal"}}'
    plan = parse(
        late,
        MOVE.replace("1,", "2,", 1),
        '{"issue": 6, "release": true}',
        '{"issue": 5, "payload": {"mass_kg": 1}}',
    )
    assert [motion.registered_at for motion in plan.motions] == [2, 9]
    assert [(item.t, item.mass) for item in plan.payloads] == [(5, 1), (6, None)]


def test_a_plan_has_an_end():
    load = '{"issue": %d, "payload": {"mass_kg": 20}}'
    assert parse(MOVE, load % 1).payloads[0].mass == 20
    with pytest.raises(FormatError, match=r"\(0, 20\] kg"):
        parse(MOVE, '{"issue": 1, "payload": {"mass_kg": 20.1}}')
    moves = [MOVE] * MAX_COMMANDS
    assert len(parse(*moves).motions) == MAX_COMMANDS
    with pytest.raises(FormatError, match=f"^plan.jsonl:{MAX_COMMANDS + 1}: more than the {MAX_COMMANDS} commands"):
        parse(*moves, MOVE)
    with pytest.raises(FormatError, match="bytes allowed"):
        parse_plan(MOVE.encode() + b" " * MAX_BYTES, "plan.jsonl", model)


@pytest.mark.parametrize(
    ("line", "allowed"),
    [
        ("{", "a line is a JSON object"),
        ("[]", "a line is a JSON object"),
        ("\x00\x01", "a line is a JSON object"),
        ('{"issue": 1, "mvoe": [0,0,0,0,0,0]}', "mvoe"),
        ('{"issue": "1", "move": [0,0,0,0,0,0]}', "issue"),
        ('{"issue": 1e999, "move": [0,0,0,0,0,0]}', "issue"),
        ('{"issue": NaN, "move": [0,0,0,0,0,0]}', "a line is a JSON object"),
        ('{"issue": -1, "move": [0,0,0,0,0,0]}', "issue must be seconds in"),
        ('{"move": [0,0,0,0,0,0]}', "issue must be seconds in"),
        ('{"issue": 1}', "one of move, payload, release"),
        ('{"speed": 1}', "one of move, payload, release"),
        ('{"issue": 1, "move": [0,0,0,0,0]}', "6 finite joint values"),
        ('{"issue": 1, "move": [0,0,0,0,0,"a"]}', "float"),
        ('{"issue": 1, "move": [170,0,0,0,0,0]}', r"joint 1 must be within \[-160, 160\] deg; given: 170"),
        ('{"issue": 1, "move": {"pose": "nowhere"}}', "one of nominal, ready, stretch, zero"),
        ('{"issue": 1, "move": {"pose": "ready", "xyz": [0,0,0]}}', "pose alone"),
        ('{"issue": 1, "move": {"xyz": [0.4,0,0]}}', "zyz_deg must be three finite numbers"),
        ('{"issue": 1, "move": {"xyz": [9,0,0], "zyz_deg": [0,0,0]}}', "unreachable pose"),
        ('{"issue": 1, "move": {"xyz": [0.45,0,0], "zyz_deg": [0,180,0], "configuration": "UP"}}', "UP"),
        ('{"issue": 1, "move": [0,0,0,0,0,0], "speed": 0}', "speed must be a number in"),
        ('{"issue": 1, "move": [0,0,0,0,0,0], "speed": 1.1}', "speed must be a number in"),
        ('{"issue": 1, "move": [0,0,0,0,0,0], "profile": "fast"}', "profile"),
        ('{"issue": 1, "move": [0,0,0,0,0,0], "insertion": "push"}', "insertion"),
        ('{"issue": 1, "move": [0,0,0,0,0,0], "execute": 1e9}', "execute must be seconds in"),
        ('{"issue": 2, "register": 1, "move": [0,0,0,0,0,0]}', r"register must be seconds in \[2"),
        ('{"issue": 1, "move": [0,0,0,0,0,0], "release": true}', "it may hold issue, move"),
        ('{"issue": 1, "payload": {"mass_kg": 0}}', "mass_kg must be in"),
        ('{"issue": 1, "payload": {"mass_kg": 1}, "speed": 1}', "it may hold issue, payload"),
        ('{"issue": 1, "release": false}', "release must be true"),
        ('{"issue": 1, "release": true}', "allowed is a payload"),
        ('{"schema": "vrs-plan/1"}', "below the first line"),
        ('{"title": "late"}', "below the first line"),
    ],
)
def test_each_mistake_is_named_by_file_and_line(line, allowed):
    with pytest.raises(FormatError, match=r"^plan\.jsonl:2: ") as caught:
        parse(MOVE, line)
    assert caught.match(allowed)


@pytest.mark.parametrize("header", ['{"schema": "vrs-plan/2"}', '{"title": 3}', '{"title": "x", "issue": 1}'])
def test_a_bad_header_is_refused(header):
    with pytest.raises(FormatError, match=r"^plan\.jsonl:1: "):
        parse(header, MOVE)


def test_two_payloads_at_once_are_refused():
    load = '{"issue": 1, "payload": {"mass_kg": 1}}'
    with pytest.raises(FormatError, match=r"plan\.jsonl:3: .*allowed is a release"):
        parse(MOVE, load, load)


@pytest.mark.parametrize("data", [b"", b"\n\n", b'{"comment": "x"}', b'{"title": "x"}'])
def test_a_plan_without_moves_is_refused(data):
    with pytest.raises(FormatError, match="holds no move"):
        parse_plan(data, "plan.jsonl", model)


def test_unreadable_and_binary_files_are_one_typed_error(tmp_path):
    binary = tmp_path / "binary"
    binary.write_bytes(bytes(range(256)))
    for path in (tmp_path / "missing", tmp_path, binary):
        with pytest.raises(FormatError, match=str(path)):
            read_plan(path, model)


@settings(max_examples=300, deadline=None)
@given(
    st.one_of(
        st.binary(max_size=200), st.text(alphabet='{}[]":,0123456789.-eissuemov \n', max_size=120).map(str.encode)
    )
)
def test_any_bytes_give_a_plan_or_a_typed_error(data):
    with contextlib.suppress(FormatError):
        assert parse_plan(data, "plan.jsonl", model).motions


def test_deep_nesting_is_one_typed_error():
    with pytest.raises(FormatError, match=r"^plan\.jsonl:1: "):
        parse_plan(b'{"move":' + b"[" * 100_000, "plan.jsonl", model)


def test_the_default_plan_is_one():
    plan = default_plan(model)
    assert len(plan.motions) > 15
    assert {item.mass for item in plan.payloads} == {2.5, None}
