"""Real sockets: a robot in its own process, driven by generated code; keys, refusals, and bad input to the
command."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from interfaces.cli.main import exit_status
from interfaces.rsp.creator import write_package
from interfaces.rsp.errors import DeadlineError, NoSessionError
from interfaces.rsp.live import opened
from interfaces.rsp.local import LocalConfig
from interfaces.rsp.model import example, read_model, write_model
from interfaces.rsp.outbox import DeliveryOutcome
from interfaces.rsp.outputs import EndReason
from robots.cubo import parameters
from vrs.errors import FormatError, InvalidValueError

CUBO = parameters.MODEL_FILE


@contextmanager
def robot(*words: str) -> Iterator[str]:
    """A thin client in a process of its own; where it listens."""
    process = subprocess.Popen(
        [sys.executable, "-m", "interfaces.cli", "robot", "--rsp", "127.0.0.1:0", "--until-eof", *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        line = process.stdout.readline()
        assert "listens on rsp://" in line
        yield line.split("rsp://")[1].split()[0]
    finally:
        process.stdin.close()
        assert process.wait(20.0) == 0
        process.stdout.close()


@pytest.mark.needs("mujoco")
def test_cubo_over_sockets_with_keys(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_package(read_model(CUBO), tmp_path / "code")
    monkeypatch.syspath_prepend(str(tmp_path / "code"))
    monkeypatch.delitem(sys.modules, "cubo", raising=False)
    import cubo  # type: ignore[import-not-found]

    keys = tmp_path / "keys"
    with robot("--token-file", str(keys), "--body", "mujoco") as address:
        assert keys.stat().st_mode & 0o777 == 0o600
        with cubo.connect(address, key_file=keys, timeout=20.0) as mine:
            mine.moving.set_active(True)
            mine.position.wait(5.0)
            mine.left_wheel.write(0, 250)
            mine.right_wheel.write(0, 250)
            assert mine.ir_fire.send(1).wait(5.0) is DeliveryOutcome.DONE
            assert mine.album.send(b"x" * 4000, timeout=5.0).wait(6.0) is DeliveryOutcome.DONE
            start, end = mine.position.read(0), time.monotonic() + 10.0
            while mine.position.read(0) < start + 5000 and time.monotonic() < end:
                mine.position.wait(5.0)
            assert mine.position.read(0) >= start + 5000
            with pytest.raises(NoSessionError, match="busy"), cubo.connect(address, key_file=keys):
                pass
            with cubo.connect(address, key_file=keys, takeover=True) as other:
                other.position.set_active(True)
                other.position.wait(5.0)
                assert mine.middleware.wait_for(lambda: mine.middleware.ended is EndReason.TAKEN, 5.0)
        with pytest.raises(DeadlineError), cubo.connect(address, timeout=0.5):
            pass


def test_it_asks_as_long_as_it_may() -> None:
    begin, config = time.monotonic(), LocalConfig(patience=0.1)
    with pytest.raises(DeadlineError), opened(example(), "127.0.0.1:9", timeout=0.5, config=config):
        pass
    assert time.monotonic() - begin >= 0.5
    with pytest.raises(InvalidValueError, match="timeout"), opened(example(), "127.0.0.1:9", timeout=math.inf):
        pass


def test_whom_nobody_answers(tmp_path: Path) -> None:
    with pytest.raises(DeadlineError, match="session"), opened(example(), "127.0.0.1:9", timeout=0.4):
        pass
    with pytest.raises(FormatError), opened(example(), "no.such.host.invalid:9"):
        pass
    with (
        pytest.raises(FormatError, match="token file"),
        opened(example(), "127.0.0.1:9", key_file=tmp_path / "none"),
    ):
        pass


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["robot", "--rsp", "0.0.0.0:8700"], "--token-file"),
        (["robot", "--rsp", "nowhere"], "--rsp"),
        (["robot", "--rsp", "127.0.0.1:0", "--body", "jelly"], "body of cubo must be one of"),
        (["robot", "--model", "{tmp}/good.xmi"], "given with --rsp only"),
        (["rsp"], "Missing command"),
        (["robot", "--rsp", "127.0.0.1:0", "--room", "zoo"], "furnished"),
        (["robot", "--rsp", "127.0.0.1:0", "--model", "{tmp}/none"], "can't be read"),
        (["robot", "--rsp", "127.0.0.1:0", "--model", "{tmp}/bad"], "isn't XML"),
        (["rsp", "model", "show", "{tmp}/bad"], "isn't XML"),
        (["rsp", "model", "check", "{tmp}/none"], "can't be read"),
        (["rsp", "model", "new", "{tmp}/bad"], "can't be written"),
        (["rsp", "model", "new", "{tmp}/x.xmi", "--name", "My Robot"], "a to z"),
        (["rsp", "model", "new", "{tmp}/x.xmi", "--id", "99999"], "65535"),
        (["rsp", "generate", "{tmp}/good.xmi", "--out", "{tmp}/bad"], "can't hold"),
        (["rsp", "model", "fly"], "fly"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    (tmp_path / "bad").write_text("bad")
    (tmp_path / "good.xmi").write_bytes(write_model(example()))
    assert exit_status([word.format(tmp=tmp_path) for word in words]) == 2
    error = capsys.readouterr().err
    assert error.startswith("vrs: ")
    assert error.count("\n") == 1
    assert said in error


def test_models_are_made_shown_checked_and_generated(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "tank.xmi"
    assert exit_status(["rsp", "model", "new", str(path), "--name", "tank", "--id", "77"]) == 0
    assert read_model(path) == example("tank", 77)
    assert exit_status(["rsp", "model", "show", str(path)]) == 0
    assert exit_status(["rsp", "model", "check", str(path)]) == 0
    assert "9 elements, fine" in capsys.readouterr().out
    assert exit_status(["rsp", "model", "show", str(path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["id"], facts["map_bytes"], facts["header_bytes"]) == (77, 2, 20)
    assert [row["kind"] for row in facts["elements"]][:3] == ["Effector", "Effector", "Sensor"]
    assert exit_status(["rsp", "generate", str(path), "--out", str(tmp_path / "code"), "--json"]) == 0
    assert "local.py" in json.loads(capsys.readouterr().out)["files"]
    assert (tmp_path / "code" / "tank" / "py.typed").exists()
    monkeypatch.chdir(tmp_path)
    assert exit_status(["rsp", "generate", "tank.xmi"]) == 0
    assert (tmp_path / "tank" / "robot.py").exists()
