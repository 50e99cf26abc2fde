"""Generated packages: the same bytes, formatted, typed, and enough to move a robot, whatever the model."""

from __future__ import annotations

import importlib
import subprocess
import sys
from functools import partial
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any

import pytest

from interfaces.rsp.creator import package, write_package
from interfaces.rsp.errors import DeadlineError
from interfaces.rsp.host import RspHost
from interfaces.rsp.local import LocalCore, LocalState
from interfaces.rsp.middleware import Middleware
from interfaces.rsp.model import (
    Effector,
    MemoryCommand,
    Module,
    RobotModel,
    Sensor,
    example,
    parse_model,
    read_model,
    write_model,
)
from interfaces.rsp.outbox import DeliveryOutcome
from interfaces.rsp.robot import RobotCore
from robots.cubo import parameters
from robots.cubo.body import MOVES, CuboBody
from vrs.clock import ManualClock
from vrs.errors import FormatError, InvalidValueError

HOME = Path(__file__).resolve().parents[3]
WHEEL = {"scale": 0.001, "low": -400.0, "high": 400.0, "on_loss": "rest"}
SOLO = RobotModel("solo", 1, (Effector("wheels", count=2, binding="wheels", **WHEEL),))
MANY = RobotModel(
    "many",
    200,
    (
        Effector("left_wheel", binding="wheel.left", **WHEEL),
        Effector("right_wheel", binding="wheel.right", **WHEEL),
        Sensor("position", type="i32", count=3, scale=1e-4, binding="position"),
        *(
            Effector(f"led_{k}", type="u8") if k % 2 else Sensor(f"line_{k}", type="f32", count=5)
            for k in range(196)
        ),
        Module("all_lines", tuple(f"line_{k}" for k in range(0, 196, 2))),
    ),
)
MODELS = {
    "cubo": read_model(parameters.MODEL_FILE),
    "rover": example(),
    "solo": SOLO,
    "many": MANY,
    "namesake": RobotModel("left_wheel_effector", 4, (Effector("left_wheel"),)),
    "memo": RobotModel("memo", 2, (MemoryCommand("a"), MemoryCommand("a_1"), MemoryCommand("a1"))),
    "middleware": RobotModel(
        "twice", 3, (Sensor("middleware"), Effector("speaker", stream=9), Effector("pass_on"))
    ),
}


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where all packages are."""
    directory = tmp_path_factory.mktemp("generated")
    for model in MODELS.values():
        # Through the file, as a user goes.
        write_package(parse_model(write_model(model)), directory)
    return directory


def imported(written: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(written))
    for module in [key for key in sys.modules if key == name or key.startswith(f"{name}.")]:
        monkeypatch.delitem(sys.modules, module)
    return importlib.import_module(name)


def test_the_same_model_gives_the_same_bytes(written: Path) -> None:
    for model in MODELS.values():
        files = package(model)
        assert files == package(parse_model(write_model(model)))
        for name, text in files.items():
            assert (written / model.name / name).read_text(encoding="utf-8") == text


def test_what_is_generated_is_formatted_and_has_no_faults(written: Path) -> None:
    ruff = Path(sys.executable).with_name("ruff")
    for words in (("format", "--check"), ("check",)):
        done = subprocess.run(
            [ruff, *words, "--config", HOME / "pyproject.toml", "--no-cache", written],
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout


def test_what_is_generated_is_typed(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MYPYPATH", f"{HOME}:{written}")
    words = [word for name in ("rover", "solo", "memo", "twice") for word in ("-p", name)]
    done = subprocess.run(
        [Path(sys.executable).with_name("mypy"), "--config-file", HOME / "pyproject.toml", *words],
        capture_output=True, text=True, check=False, cwd=HOME,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


def test_a_robot_named_as_one_of_its_devices_has_both(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = imported(written, "left_wheel_effector", monkeypatch)
    robot = module.LeftWheelEffector(Middleware(LocalCore(module.MODEL, bytes), ManualClock()))
    robot.left_wheel.write(0, 7)
    assert robot.left_wheel.read_all() == (7,)


def test_a_package_replaces_itself_and_nothing_else(tmp_path: Path) -> None:
    write_package(SOLO, tmp_path)
    assert write_package(SOLO, tmp_path) == tmp_path / "solo"
    (tmp_path / "solo" / "mine.py").touch()
    with pytest.raises(FormatError, match=r"mine\.py"):
        write_package(SOLO, tmp_path)
    (tmp_path / "rover").touch()
    with pytest.raises(FormatError, match="can't hold"):
        write_package(example(), tmp_path)


class Site:
    """A generated robot and CUBO's body, joined in memory, in virtual time."""

    def __init__(self, module: ModuleType, robot: str, body: CuboBody) -> None:
        random = Random(1)
        self.clock = ManualClock()
        core = LocalCore(module.MODEL, random.randbytes)
        self.middleware = Middleware(core, self.clock)
        self.robot: Any = getattr(module, robot)(self.middleware)
        self.host = RspHost(RobotCore(module.MODEL, random.randbytes), body, frozenset(MOVES))
        core.open(now=0.0)
        self.run(0.1)
        assert core.state is LocalState.OPEN

    def run(self, seconds: float) -> None:
        end = self.clock.now() + seconds
        answers: list[bytes] = []
        while self.clock.now() < end:
            self.clock.advance(0.005)
            now = self.clock.now()
            for data in self.middleware.advance(answers, now=now):
                self.host.core.receive(data, b"local", now=now)
            self.host.advance(now=now)
            answers = [data for data, _ in self.host.core.to_send(now=now)]


def test_a_model_with_one_device_moves_a_robot(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = imported(written, "solo", monkeypatch)
    with CuboBody((0.0, 0.0, 0.0), exact=True) as body:
        site = Site(module, "Solo", body)
        site.robot.wheels.write_all((200, 200))
        site.run(2.0)
        assert body.truth[0] == pytest.approx(0.2 * 1.85, abs=0.03)
        site.robot.wheels.write(0, -200)
        site.robot.wheels.write(1, 200)
        site.run(1.5)
        site.robot.wheels.write_all([0, 0])
        site.run(1.0)
        assert abs(body.truth[2]) > 2.0
        assert body.resting


def test_a_model_with_200_devices_moves_a_robot(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(MANY.elements) == 200
    module = imported(written, "many", monkeypatch)
    with CuboBody((0.0, 0.0, 0.0), exact=True) as body:
        site = Site(module, "Many", body)
        robot = site.robot
        robot.position.set_active(True)
        robot.all_lines.set_active(True)
        robot.left_wheel.write(0, 150)
        robot.right_wheel.write(0, 150)
        for k in range(1, 196, 2):
            getattr(robot, f"led_{k}").write(0, k)
        site.run(2.0)
        assert robot.position.read(0) * 1e-4 == pytest.approx(body.truth[0], abs=0.01)
        assert body.truth[0] > 0.2
        assert robot.line_8.read_all() == (0.0,) * 5
        assert site.host.core.motion.given(4) == (1.0,)


def test_cubo_is_driven_by_its_own_package(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = imported(written, "cubo", monkeypatch)
    with CuboBody((0.0, 0.0, 0.0)) as body:
        site = Site(module, "Cubo", body)
        robot, heard, pressed = site.robot, [], []
        robot.moving.set_active(True)
        robot.left_arm_state.set_active(True)
        robot.service_button.set_active(True)
        with pytest.raises(DeadlineError):
            robot.position.read_all()
        end = robot.position.add_listener(heard.append)
        robot.service_button.add_listener(pressed.append)
        robot.left_arm.write_all((1200, 3000))
        robot.right_arm.write(0, -500)
        robot.tilt.write(0, 200)
        robot.lip.write_all((9, 8, 7))
        given = robot.ir_fire.send(42)
        kept = robot.album.send(b"song" * 500, timeout=5.0)
        assert given.outcome is None
        robot.speaker.play(bytes(range(256)) * 200)
        site.run(1.5)
        body.press("service")
        site.run(0.5)
        assert given.wait(0.0) is DeliveryOutcome.DONE
        assert kept.outcome is DeliveryOutcome.DONE
        assert site.host.stored["album"] == b"song" * 500
        assert [(name, values) for _, name, values in body.done] == [("ir", (42.0,)), ("album", (2000.0,))]
        assert body.angles() == pytest.approx((-0.5, 1.2, 0.2), abs=0.03)
        assert body.shown["lip"] == (9.0, 8.0, 7.0)
        assert robot.left_arm_state.read_all() == (1200, 3000)
        assert pressed == [(1,)]
        assert robot.service_button.wait(0.0) == (1,)
        assert body.played == 256 * 200
        assert len(heard) > 3
        end()
        count = len(heard)
        robot.left_wheel.write(0, 100)
        site.run(0.5)
        assert len(heard) == count


def test_the_api_checks_what_it_is_given(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = imported(written, "rover", monkeypatch)
    middleware = Middleware(LocalCore(module.MODEL, bytes), ManualClock())
    robot = module.Rover(middleware)
    for call in (
        lambda: robot.left_wheel.write(1, 0),
        lambda: robot.left_wheel.write(0, 501),
        lambda: robot.left_wheel.write(0, 0.5),
        lambda: robot.left_wheel.write(0, float("nan")),
        partial(robot.left_wheel.write_all, ()),
        lambda: robot.ir_fire.send(256),
        robot.ir_fire.send,
        lambda: robot.program.send(bytes(257), timeout=1.0),
        lambda: robot.program.send(b"", timeout=float("inf")),
    ):
        with pytest.raises(InvalidValueError):
            call()
    assert robot.left_wheel.read_all() == (0,)
    assert [robot.ir_fire.send(value).id for value in (0, 255)] == [0, 1]
    for value in (-500, 500):
        robot.left_wheel.write(0, value)
    robot.left_wheel.write(0, 0)
    robot.program.send(bytes(256), timeout=1.0)
    for call in (lambda: robot.position.wait(0.01), lambda: robot.bumper.wait(0.0), lambda: robot.log.wait(0.0)):
        with pytest.raises(DeadlineError):
            call()
    into = [9, 9]
    robot.left_wheel.read_into(into)
    assert into == [0, 9]


def test_what_isnt_active_stays_in_the_simulacrum(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = imported(written, "solo", monkeypatch)
    with CuboBody((0.0, 0.0, 0.0)) as body:
        site = Site(module, "Solo", body)
        site.robot.wheels.set_active(False)
        site.robot.wheels.write_all((200, 200))
        site.run(0.5)
        assert body.resting
        site.robot.wheels.set_active(True)
        site.run(0.5)
        assert not body.resting


def test_a_generated_handler_is_a_robots_side(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = imported(written, "rover", monkeypatch)
    did: list[Any] = []

    class Mine(module.RoverHandler):  # type: ignore[misc, name-defined]
        def on_left_wheel(self, values: tuple[int]) -> None:
            did.append(("wheel", values))

        def on_ir_fire(self, values: tuple[int]) -> None:
            did.append(("ir", values))

        def on_program(self, data: bytes) -> None:
            did.append(("program", data))

    random, clock = Random(1), ManualClock()
    local, core = LocalCore(module.MODEL, random.randbytes), RobotCore(module.MODEL, random.randbytes)
    mine, robot = Mine(core), module.Rover(Middleware(local, clock))
    local.open(now=0.0)
    robot.sensing.set_active(True)
    sent: list[bytes] = []
    for step in range(60):
        now = clock.advance(0.01)
        if step == 10:
            robot.left_wheel.write(0, 7)
            robot.ir_fire.send(3)
            robot.program.send(b"data", timeout=2.0)
            mine.measure_position((1, 2, 3))
            mine.tell_log(b"log", deadline=9.0)
            assert mine.occur_bumper((1,))
        for data in robot.middleware.advance(sent, now=now):
            core.receive(data, b"local", now=now)
        mine.advance(now=now)
        sent = [data for data, _ in core.to_send(now=now)]
    assert sorted(did) == [("ir", (3,)), ("program", b"data"), ("wheel", (7,))]
    assert robot.position.read_all() == (1, 2, 3)
    assert robot.log.wait(0.0) == b"log"
    assert robot.bumper.wait(0.0) == (1,)


def test_a_lost_link_stops_the_body_in_time(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = imported(written, "solo", monkeypatch)
    with CuboBody((0.0, 0.0, 0.0)) as body:
        site = Site(module, "Solo", body)
        site.robot.wheels.write_all((300, 300))
        site.run(1.0)
        before, lost = body.motion[0], site.clock.now()
        assert before > 0.25
        while body.rims != [0.0, 0.0]:
            now = site.clock.advance(0.001)
            site.host.advance(now=now)
            assert now - lost < 0.6
        # T_loss, a packet's period before it, and 20 ms at most.
        assert 0.48 <= site.clock.now() - lost <= 0.52 + 1e-9
        for _ in range(1000):
            site.host.advance(now=site.clock.advance(0.001))
        assert body.resting
