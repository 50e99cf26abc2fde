"""The scene as commands: once, then only what changes, the newest for each; the committed path and its ticks."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import msgspec
import numpy as np
import pytest

from interfaces.stream.meshcat import Committed, TwinScene
from interfaces.stream.meshcat.committed import PIECE, CommittedPath
from interfaces.stream.meshcat.meshes import bodies, shaded, tube
from interfaces.stream.meshcat.newest import MOST_READERS, ROOT, Newest, Nodes, set_transform
from interfaces.stream.meshcat.objects import module
from robots import load, puma560
from robots.puma560.parameters import FLANGE
from robots.robot import Robot
from robots.solids import LinkShape
from vrs import Engine, Insertion, JointTarget, ManualClock, MotionCommand, Timeline
from vrs.errors import InvalidValueError
from vrs.model import Array

MODEL = puma560.model()
NOMINAL = MODEL.poses["nominal"]
TOOL = np.array([0.0, 0.0, FLANGE])
ALL = 10**9


@dataclass(frozen=True)
class Shapeless:
    """The same arm under a name that no shapes are known for."""

    name: str = "other"

    def __getattr__(self, attribute: str) -> Any:
        return getattr(MODEL, attribute)


@pytest.fixture(scope="module")
def made() -> TwinScene:
    robot = load("puma560")
    return TwinScene(robot, looks=bodies(robot))


@pytest.fixture
def scene(made: TwinScene) -> TwinScene:
    """The one scene of this file, with both robots at the nominal pose and nothing planned."""
    made.path_due = -np.inf
    show(made, NOMINAL, now=0.0)
    return made


def show(scene: TwinScene, q: Array, real: Array | None = None, *, now: float, **named: Any) -> None:
    scene.show(virtual=q, real=q if real is None else real, now=now, **named)


def taken(slot: Any) -> list[dict[str, Any]]:
    out = []
    while slot:
        out += [msgspec.msgpack.decode(data) for data in slot.take(ALL)]
    return out


def seen(commands: list[dict[str, Any]], state: dict[Any, Any] | None = None) -> dict[Any, Any]:
    """What a viewer shows after commands."""
    state = {} if state is None else state
    for command in commands:
        if command["type"] == "delete":
            for key in [key for key in state if key[0].startswith(command["path"])]:
                del state[key]
        else:
            what = command["type"], command.get("property")
            value = command.get("object", command.get("matrix", command.get("value")))
            state[command["path"], *what] = value
    return state


def plan(*offsets: float, speed: float = 0.5) -> Timeline:
    engine = Engine(MODEL, q=NOMINAL, clock=ManualClock(0.0))
    for offset in offsets:
        goal = JointTarget(NOMINAL + offset * np.array([1.0, 0.3, -0.4, 0.2, 0.5, 1.0]))
        engine.execute(MotionCommand(target=goal, speed=speed, insertion=Insertion.APPEND))
    return engine.timeline


def tool_at(q: Array) -> Array:
    X = MODEL.forward(q)
    return X[:, :3, :3] @ TOOL + X[:, :3, 3]


def tool(timeline: Timeline, t: Any) -> Array:
    return tool_at(np.atleast_2d(timeline.sample(np.atleast_1d(t))))


def path_of(state: dict[Any, Any]) -> dict[str, Any]:
    """Objects of the committed path's nodes that show."""
    return {
        path: value
        for (path, kind, _), value in state.items()
        if path.startswith("/vrs/committed/") and kind == "set_object" and state[path, "set_property", "visible"]
    }


def test_transforms_are_meshcats_own_bytes() -> None:
    umsgpack = pytest.importorskip("umsgpack")
    X = MODEL.links(NOMINAL)[4]
    path = module("path").Path(("vrs", "real", "body", "4"))
    own = module("commands").SetTransform(X, path).lower()
    assert set_transform("/vrs/real/body/4", X) == umsgpack.packb(own)


def test_no_other_server_is_loaded() -> None:
    probe = (
        "import sys; import interfaces.stream.meshcat.objects as made; assert made.g.Sphere; "
        "print(*{'zmq', 'tornado', 'starlette', 'meshcat'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-W", "error", "-c", probe], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


def test_a_viewer_gets_the_scene_once_and_then_transforms_alone(scene: TwinScene) -> None:
    slot = scene.join()
    first = taken(slot)
    assert first[0] == {"type": "delete", "path": "/vrs"}
    objects = [command["path"] for command in first if command["type"] == "set_object"]
    assert len(objects) == len(set(objects))
    assert {f"/vrs/{twin}/body/{i}" for twin in ("virtual", "real") for i in range(7)} <= set(objects)
    for k in range(1, 20):
        show(scene, NOMINAL + 0.01 * k, NOMINAL + 0.005 * k, now=k / 60)
        later = taken(slot)
        assert {command["type"] for command in later} == {"set_transform"}
        assert len(later) == 12  # The bases stand still.
    scene.leave(slot)


def test_a_robot_at_rest_sends_nothing_and_one_joint_only_what_it_carries(scene: TwinScene) -> None:
    slot = scene.join()
    taken(slot)
    for k in range(200):
        show(scene, NOMINAL, now=k / 60)
        assert not slot
        assert slot.take(ALL) == ()
    show(scene, NOMINAL + np.array([0, 0, 0, 0, 0.1, 0]), NOMINAL, now=4.0)
    assert [command["path"] for command in taken(slot)] == ["/vrs/virtual/body/5", "/vrs/virtual/body/6"]
    scene.leave(slot)


def test_a_slow_drift_is_seldom_sent_and_never_off_by_more_than_is_said(scene: TwinScene) -> None:
    slot = scene.join()
    state = seen(taken(slot))
    sent = 0
    for k in range(100):
        q = NOMINAL + 3e-8 * k
        show(scene, q, now=k / 60)
        commands = taken(slot)
        sent += len(commands)
        seen(commands, state)
        for i, X in enumerate(MODEL.links(q)):
            shown = state[f"/vrs/real/body/{i}", "set_transform", None]
            np.testing.assert_allclose(shown, X.T.ravel(), rtol=0, atol=2.1e-7)
    assert 12 < sent < 0.5 * 12 * 100
    scene.leave(slot)


def test_one_who_joins_late_or_reads_slowly_sees_the_same(scene: TwinScene) -> None:
    quick, slow = scene.join(), scene.join()
    timeline = plan(0.5, -0.4, 0.3)
    state, sluggish = seen(taken(quick)), {}
    rng = np.random.default_rng(1)
    for k in range(150):
        t = k / 30
        show(scene, timeline.sample(t + 0.5), timeline.sample(t), path=Committed(timeline, t), now=t)
        seen(taken(quick), state)
        if rng.random() < 0.1:
            seen([msgspec.msgpack.decode(data) for data in slow.take(20_000)], sluggish)
    late = scene.join()
    assert seen(taken(late)) == state
    seen(taken(slow), sluggish)
    assert sluggish == state
    for slot in (quick, slow, late):
        scene.leave(slot)


def test_bytes_are_made_once_for_all(scene: TwinScene) -> None:
    slots = [scene.join() for _ in range(3)]
    for slot in slots:
        taken(slot)
    show(scene, NOMINAL + 0.2, now=1.0)
    one, *others = [slot.take(ALL) for slot in slots]
    assert len(one) == 12
    assert all(other is one for other in others)
    for slot in slots:
        scene.leave(slot)
    assert scene.readers == 0


def test_a_reader_gets_no_more_than_it_asks_for_and_nothing_overtaken() -> None:
    newest = Newest(b"hello")
    slot = newest.join()
    assert slot.take(ALL) == (b"hello",)
    rng = np.random.default_rng(2)
    values: dict[str, bytes] = {}
    got: dict[bytes, bytes] = {}
    for k in range(3000):
        key = f"k{rng.integers(20)}"
        values[key] = b"%s=%d" % (key.encode(), k if rng.random() < 0.8 else 0)
        newest.put(key, values[key])
        if rng.random() < 0.1:
            most = int(rng.integers(1, 60))
            batch = slot.take(most)
            assert len(batch) == 1 or sum(map(len, batch)) <= most
            assert all(data in values.values() for data in batch)
            got.update({data.split(b"=")[0]: data for data in batch})
    while slot:
        got.update({data.split(b"=")[0]: data for data in slot.take(10)})
    assert got == {key.encode(): data for key, data in values.items()}
    assert slot.take(ALL) == ()


def test_viewers_are_bounded_and_a_place_is_given_back_once(scene: TwinScene) -> None:
    slots = [scene.join() for _ in range(MOST_READERS)]
    with pytest.raises(InvalidValueError, match="at most"):
        scene.join()
    scene.leave(slots[0])
    scene.leave(slots[0])
    slots[0] = scene.join()
    for slot in slots:
        scene.leave(slot)
    assert scene.readers == 0


def test_waiting_viewers_are_woken_when_something_changed_and_only_then(scene: TwinScene) -> None:
    woken: list[int] = []
    slot = scene.join(lambda: woken.append(1))
    show(scene, NOMINAL, now=1.0)
    assert woken == []
    show(scene, NOMINAL + 0.1, now=2.0)
    assert woken == [1]
    scene.leave(slot)
    show(scene, NOMINAL, now=3.0)
    assert woken == [1]


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_no_pose_changes_nothing(scene: TwinScene, bad: float) -> None:
    slot = scene.join()
    taken(slot)
    q = NOMINAL + 0.3
    broken = q.copy()
    broken[3] = bad
    for wrong in (broken, q[:5], np.tile(q, (2, 1))):
        for named in ({"virtual": q, "real": wrong}, {"virtual": wrong, "real": q}):
            with pytest.raises(InvalidValueError):
                scene.show(**named, now=5.0)
    with pytest.raises(InvalidValueError):
        Committed(plan(0.1), bad)
    with pytest.raises(InvalidValueError):
        scene.show(virtual=q, now=bad)
    assert taken(slot) == []
    scene.leave(slot)


def test_a_robot_that_is_away_is_hidden_and_comes_back(scene: TwinScene) -> None:
    slot = scene.join()
    state = seen(taken(slot))
    assert state["/vrs/real", "set_property", "visible"] is True
    scene.show(virtual=NOMINAL, now=1.0)
    assert [command["value"] for command in taken(slot)] == [False]
    show(scene, NOMINAL, now=2.0)
    assert [command["value"] for command in taken(slot)] == [True]
    scene.leave(slot)


@pytest.mark.parametrize("play", [0.0, 0.3, 1.0, 1.26])
def test_the_path_goes_from_the_real_tool_to_where_it_rests(play: float) -> None:
    timeline = plan(0.5, -0.4)
    pieces = CommittedPath(tool_at, timeline, play).pieces(play)
    line = np.vstack([piece.points for piece in pieces])
    np.testing.assert_allclose(line[0], tool(timeline, play)[0], atol=1e-9)
    np.testing.assert_allclose(line[-1], tool(timeline, timeline.end)[0], atol=1e-4)
    for before, after in pairwise(pieces):
        np.testing.assert_allclose(before.points[-1], after.points[0], atol=1e-9)
    # Every point of the plan is on the line, and every corner of the line on the plan.
    fine = tool(timeline, np.linspace(play, timeline.end, 4000))
    assert max(np.linalg.norm(fine - corner, axis=1).min() for corner in line) < 1e-3
    a, b = line[:-1], line[1:]
    for point in fine[::40]:
        along = np.clip(np.einsum("ij,ij->i", point - a, b - a) / ((b - a) ** 2).sum(axis=1).clip(1e-12), 0, 1)
        assert np.linalg.norm(a + along[:, None] * (b - a) - point, axis=1).min() < 1.5e-3


def test_ticks_stand_where_the_tool_will_be_at_halves_of_a_second() -> None:
    timeline = plan(0.5, -0.4)
    pieces = CommittedPath(tool_at, timeline, 0.3).pieces(0.3)
    ticks = {piece.index * PIECE: piece.marks[0] for piece in pieces if piece.marks and piece.marks[0][1] > 0}
    assert set(ticks) == set(np.arange(0.5, timeline.end, 0.5))
    for t, (X, radius) in ticks.items():
        np.testing.assert_allclose(X[:3, 3], tool(timeline, t)[0], atol=1e-9)
        np.testing.assert_allclose(X[:3, :3].T @ X[:3, :3], np.eye(3), atol=1e-9)
        around = tool(timeline, [t - 0.02, t + 0.02])
        way = around[1] - around[0]
        if np.linalg.norm(way) > 2e-3:
            assert X[:3, 2] @ way / np.linalg.norm(way) > 0.95
        assert (radius > 0.015) == (t == round(t))
    assert [piece.t for piece in pieces if piece.t is not None and not piece.ends] == [
        t for t in ticks if t == round(t) and t + PIECE < timeline.end
    ]
    assert [piece.ends for piece in pieces] == [False] * (len(pieces) - 1) + [True]
    end, size = pieces[-1].marks[-1]
    assert size < 0
    np.testing.assert_allclose(end[:3, 3], tool(timeline, timeline.end)[0], atol=1e-4)
    assert pieces[-1].t == pytest.approx(timeline.end, abs=0.026)


def test_a_turn_of_the_flange_alone_has_an_end_and_no_line() -> None:
    engine = Engine(MODEL, q=NOMINAL, clock=ManualClock(0.0))
    engine.execute(MotionCommand(target=JointTarget(NOMINAL + np.array([0, 0, 0, 0, 0, 1.0])), speed=0.3))
    pieces = CommittedPath(tool_at, engine.timeline, 0.0).pieces(0.0)
    assert sum(len(piece.points) for piece in pieces) == 0
    assert [piece.ends for piece in pieces if piece] == [True]


def test_a_plan_that_is_over_or_empty_draws_nothing() -> None:
    for timeline in (plan(), plan(0.3)):
        end = timeline.end + 1e-9
        assert CommittedPath(tool_at, timeline, end).pieces(end) == ()
        assert CommittedPath(tool_at, timeline, 1e6).pieces(1e6) == ()


def test_a_long_plan_is_drawn_as_far_as_the_horizon_and_renewed(scene: TwinScene) -> None:
    timeline = plan(*[0.5, -0.5] * 15)
    assert timeline.end > 30
    slot = scene.join()
    state = seen(taken(slot))
    for k in range(300):
        play = 0.5 * k
        if play >= timeline.end:
            break
        show(scene, timeline.sample(play), path=Committed(timeline, play), now=1.0 + play)
        seen(taken(slot), state)
        shown = path_of(state)
        assert len(shown) <= 42
        if play < timeline.end - 25:
            assert len(shown) >= 34
            assert not any(value["object"]["userData"].get("end") for value in shown.values())
    show(scene, NOMINAL, path=Committed(timeline, timeline.end), now=1000.0)
    seen(taken(slot), state)
    assert path_of(state) == {}
    scene.leave(slot)


def test_only_what_changed_of_the_path_is_sent_again_and_not_often(scene: TwinScene) -> None:
    slot = scene.join()
    taken(slot)
    short, long = plan(0.5, -0.4), plan(0.5, -0.4, 0.6)
    show(scene, NOMINAL, path=Committed(short, 0.1), now=1.0)
    drawn = [command for command in taken(slot) if command["type"] == "set_object"]
    assert len(drawn) == np.ceil(short.end / PIECE)
    show(scene, NOMINAL, path=Committed(long, 0.1), now=1.05)
    assert taken(slot) == []
    show(scene, NOMINAL, path=Committed(long, 0.1), now=1.11)
    again = [command["path"] for command in taken(slot) if command["type"] == "set_object"]
    same = int(short.end / PIECE)
    assert [path for path in again if int(path.rsplit("/", 1)[1]) < same - 1] == []
    assert len(again) >= (long.end - short.end) / PIECE
    show(scene, NOMINAL, path=Committed(long, 0.2), now=1.3)
    trimmed = taken(slot)
    assert [command["path"] for command in trimmed if command["type"] == "set_object"] == ["/vrs/committed/0"]
    assert sum(len(msgspec.msgpack.encode(str(command))) for command in trimmed) < 30_000
    show(scene, NOMINAL, path=Committed(long, 0.7), now=1.5)
    passed = taken(slot)
    assert {
        command["path"]: command.get("value") for command in passed if command.get("property") == "visible"
    } == {"/vrs/committed/0": False}
    show(scene, NOMINAL, now=2.0)
    seen(taken(slot), state := {})
    assert path_of(state) == {}
    scene.leave(slot)


def test_shading_is_smooth_on_a_ball_and_sharp_on_a_box() -> None:
    import trimesh

    def shape(mesh: Any) -> LinkShape:
        return LinkShape("it", mesh.vertices, mesh.faces, np.ones(3), np.full((len(mesh.faces), 3), 0.5))

    ball = shaded(shape(trimesh.creation.icosphere(subdivisions=3)))
    assert len(ball.vertices) == 642
    np.testing.assert_allclose(ball.normals, ball.vertices, atol=0.02)
    box = shaded(shape(trimesh.creation.box((1, 2, 3))))
    assert len(box.vertices) == 24
    np.testing.assert_allclose(np.sort(np.abs(box.normals)), np.tile([0.0, 0, 1], (24, 1)), atol=1e-12)
    assert np.einsum("ij,ij->i", box.normals, box.vertices).min() > 0
    assert set(box.colours.ravel()) == {128}


@pytest.mark.parametrize("turn_back", [False, True])
def test_a_tube_lies_round_its_line_with_its_outside_out(turn_back: bool) -> None:
    angle = np.linspace(0, 4, 30)
    line = np.column_stack([np.cos(angle), np.sin(angle), 0.2 * angle])
    if turn_back:
        line = np.array([[0.0, 0, 0], [1, 0, 0], [0.2, 0, 0]])
    vertices, faces = tube(line, 0.01)
    rings = vertices.reshape(len(line), 6, 3)
    np.testing.assert_allclose(np.linalg.norm(rings - line[:, None], axis=2), 0.01, atol=1e-12)
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    centre = line[faces.max(axis=1) // 6 - 1] * 0.5 + line[faces.max(axis=1) // 6] * 0.5
    if not turn_back:
        assert np.einsum("ij,ij->i", normals, corners.mean(axis=1) - centre).min() > 0


def test_a_robot_without_shapes_shows_frames_and_traces() -> None:
    robot = Robot("shapeless", Shapeless())
    scene = TwinScene(robot, looks=bodies(robot))
    slot = scene.join()
    state = seen(taken(slot))
    for i in range(7):
        lowered = state[f"/vrs/virtual/body/{i}", "set_object", None]
        assert lowered["object"]["children"][0]["type"] == "LineSegments"
    # The rod of a link ends where the link before it is.
    links = MODEL.links(NOMINAL)
    lowered = state["/vrs/virtual/body/2", "set_object", None]
    packed = lowered["geometries"][1]["data"]["attributes"]["position"]["array"]
    corners = np.frombuffer(packed.data, "<f4").reshape(2, 6, 3).mean(axis=1)
    np.testing.assert_allclose((links[2] @ [*corners[0], 1])[:3], links[1][:3, 3], atol=1e-6)
    timeline = plan(0.4)
    for k in range(60):
        t = k / 30
        show(scene, timeline.sample(t), now=t)
    seen(taken(slot), state)
    trace = state["/vrs/real/trace", "set_object", None]["geometries"][0]["data"]["attributes"]["position"]
    points = np.frombuffer(trace["array"].data, "<f4").reshape(-1, 3)
    # Without a known flange the trace is that of the last frame.
    way = np.asarray(MODEL.forward(timeline.sample(np.linspace(0, 2, 2000))))[:, :3, 3]
    assert len(points) > 5
    assert max(np.linalg.norm(way - point, axis=1).min() for point in points) < 1e-3
    for k in range(40):
        show(scene, timeline.sample(9.0), now=6.0 + 0.1 * k)
    seen(taken(slot), state)
    assert state["/vrs/real/trace", "set_property", "visible"] is False
    show(scene, timeline.sample(9.0), now=20.0)
    assert not slot


def test_what_stands_in_one_scene_is_seen_in_another_where_it_is_there() -> None:
    one, other = Nodes(), Nodes()
    X = np.eye(4)
    X[:3, 3] = 1.0, 2.0, -0.5
    one.show_in(other, "arm", X)
    assert other.values["/beside/arm"][1] == set_transform("/beside/arm", X)
    one.put_transform(f"{ROOT}/real/body/0", X)
    one.put_property(f"{ROOT}/real", "visible", False)
    one.put_property(ROOT, "box", [[0, 0, 0], [1, 1, 1]])
    assert other.values["/beside/arm/real/body/0"][1] == set_transform("/beside/arm/real/body/0", X)
    assert "/beside/arm/real visible" in other.values
    # What is said of the scene as a whole is its own.
    assert "/beside/arm box" not in other.values
    assert one.readers == 0
    woken: list[bool] = []
    reader = other.join(lambda: woken.append(True))
    assert (one.readers, other.readers) == (1, 1)
    one.wake()
    assert woken == [True]
    other.leave(reader)
    assert one.readers == 0
