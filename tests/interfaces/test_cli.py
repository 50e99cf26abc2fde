"""The command line: outputs, one clear line and exit code 2 on bad input, speed of the door."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures.process import BrokenProcessPool

import pytest

from interfaces.cli.main import exit_status
from robots.simulated import WORLDS

SHORT = '{"issue": 0, "move": [20, 50, -160, 0, 30, 0], "speed": 0.8}\n'


@pytest.fixture
def plan(tmp_path):
    path = tmp_path / "plan.jsonl"
    path.write_text(SHORT)
    return path


def run(*arguments, timeout=120.0):
    return subprocess.run(
        [sys.executable, "-c", "from interfaces.cli import main; main()", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
        env={**os.environ, "PYTHONHASHSEED": "random"},
    )


def test_demo_writes_the_same_summary_twice(plan, tmp_path):
    files = []
    for name in ("a", "b"):
        done = run("demo", "--commands", plan, "--delay", "thu", "--seed", 3, "--out", tmp_path / name, "--json")
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout)["seed"] == 3
        assert done.stdout == (tmp_path / name / "summary.json").read_text()
        assert (tmp_path / name / "report.html").stat().st_size > 10_000
        bars = [line for line in done.stderr.splitlines() if "━" in line]
        assert len(bars) == 6
        assert all("100%" in bar for bar in bars)
        files.append((tmp_path / name / "summary.json").read_bytes())
    assert files[0] == files[1]
    summary = json.loads(files[0])
    assert (summary["offset"], summary["link_loss"], summary["service"]) == ("adaptive", "hold", "datagram")
    assert [row["offset"].split(":")[0] for row in summary["offsets"]] == ["adaptive", "fixed"]
    assert summary["commands"]["late"] == 0
    for item in summary["attribution"]:
        assert sum(item["parts"].values()) + item["residual"] == pytest.approx(item["total"], abs=1e-8)


def test_demo_takes_a_fixed_offset_on_an_in_order_link(plan, tmp_path):
    arguments = ("--delay", "constant:0.4", "--offset", "fixed:0.3", "--service", "in-order", "--json")
    done = run("demo", "--commands", plan, *arguments, "--out", tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["offset"], summary["service"], summary["clock_offset_s"]) == ("fixed:0.3", "in-order", -0.3)
    assert summary["commands"]["late"] == 1
    assert summary["offsets"][1]["offset"] == "fixed:0.3"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["demo", "--delay", "soon"], "constant:S"),
        (["demo", "--offset", "soon"], "'adaptive', 'fixed', or 'fixed:S'"),
        (["demo", "--offset", "fixed:-1"], "'adaptive', 'fixed', or 'fixed:S'"),
        (["demo", "--service", "pigeon"], "'in-order' or 'datagram'"),
        (["demo", "--seed", "-1"], "--seed"),
        (["demo", "--seed", "x"], "--seed"),
        (["demo", "--nonsense"], "--nonsense"),
        (["demo", "--commands", "{tmp}/missing"], "missing: can't be read"),
        (["demo", "--commands", "{tmp}"], "can't be read"),
        (["demo", "--commands", "{tmp}/empty"], "holds no move"),
        (["demo", "--commands", "{tmp}/binary"], "binary:1: "),
        (["demo", "--commands", "{tmp}/plan.jsonl", "--out", "{tmp}/binary"], "can't hold the results"),
        (["demo", "--commands", "{tmp}/plan.jsonl", "--out", "{tmp}/binary/sub"], "can't hold the results"),
        (["demo", "--delay", "trace:{tmp}/missing"], "missing: can't be read"),
        (["demo", "--commands", "{tmp}/plan.jsonl", "--out", "{tmp}/full"], "run.mcap: can't hold the results"),
        (["lab", "--out", "{tmp}/full", "--robot", "bare"], "runs.csv: can't hold the results"),
        (["lab", "--out", "{tmp}/file", "--robot", "bare", "--record"], "runs: can't hold the results"),
        (["lab", "goals", "--out", "{tmp}/full"], "runs.csv: can't hold the results"),
        (["reproduce", "tipsuwan", "--out", "{tmp}/full"], "tipsuwan.json: can't hold the results"),
        (["fly"], "fly"),
        (["demo", "--seed", "x"], "vrs demo --help"),
        (["rsp", "model", "draw"], "vrs rsp model --help"),
        (["lab", "--out", "{tmp}/lab", "--architecture", "III", "--architecture", "III"], "once"),
        (["lab", "--out", "{tmp}/lab", "--starts", "4"], "--starts"),
        (["lab", "goals", "--out", "{tmp}/lab", "--starts", "4"], "--starts"),
        (["lab", "localization", "--out", "{tmp}/lab", "--position", "truth"], "--position"),
        (["console", "--alone", "--delay", "wed"], "--alone"),
        (["console", "--connect", "ws://127.0.0.1:1"], "no server listens there"),
        (["console", "--connect", "ws://127.0.0.1:1", "--delay", "wed"], "--connect"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(plan, tmp_path, capsys, arguments, said):
    (tmp_path / "empty").touch()
    (tmp_path / "binary").write_bytes(bytes(range(256)))
    for name in ("run.mcap", "runs.csv", "tipsuwan.json"):
        (tmp_path / "full" / name).mkdir(parents=True)
    (tmp_path / "file").mkdir()
    (tmp_path / "file" / "runs").touch()
    assert exit_status([argument.format(tmp=tmp_path) for argument in arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("vrs: ")
    assert said in captured.err


def test_a_list_of_commands_is_cut_nowhere(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    for arguments in ([], ["rsp", "--help"], ["rsp", "model", "--help"], ["middleware", "--help"]):
        assert exit_status(arguments) == 0
    assert not any(line.endswith("...") for line in capsys.readouterr().out.splitlines() if "Usage" not in line)


def test_checks_of_a_driver_are_json_where_that_is_asked_for(capsys):
    assert exit_status(["check", "--driver", "tests.robots.test_driver:Servos", "--json"]) == 2
    (check,) = json.loads(capsys.readouterr().out)["checks"]
    assert check == {"name": "works", "holds": False, "said": "the driver has 2 joints (one, two), the robot 6"}


def test_a_worker_that_is_killed_is_a_line_and_no_bad_input(capsys, monkeypatch):
    def broken(**_):
        raise BrokenProcessPool

    monkeypatch.setattr(sys.modules[exit_status.__module__], "app", broken)
    assert exit_status(["lab"]) == 1
    assert capsys.readouterr().err.startswith("vrs: a worker was ended")


def test_help_and_version(capsys):
    for arguments in ([], ["--help"], ["demo", "--help"], ["doctor", "--help"]):
        assert exit_status(arguments) == 0
    assert exit_status(["--version"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("vrs-teleop ")


def test_ctrl_c_while_the_robot_of_a_server_starts_is_no_traceback(tmp_path):
    command = [sys.executable, "-m", "interfaces.cli", "serve", "--port", "0", "--body", "ideal"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=tmp_path, text=True,
                          env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}) as process:  # fmt: skip
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 0
    assert "Traceback" not in said


def test_ctrl_c_in_a_callback_that_nobody_hears_of_counts_all_the_same():
    program = """if True:
        import signal, sys, time, weakref
        import interfaces.cli
        door = sys.modules["interfaces.cli.main"]
        class Lock: pass
        def app(**_):
            lock = Lock()
            callback = weakref.ref(lock, lambda _: signal.raise_signal(signal.SIGINT))
            del lock
            time.sleep(30)
        door.app = app
        door.main(["demo"])
    """
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=20, check=False)
    assert (done.returncode, done.stderr) == (130, "vrs: interrupted\n")


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_with_130_and_one_line(tmp_path, how):
    process = subprocess.Popen(
        [sys.executable, "-c", "from interfaces.cli import main; main()", "demo", "--out", str(tmp_path / "out")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    # The results' directory appears when arguments have been read and the run is about to start.
    deadline = time.monotonic() + 60
    while not (tmp_path / "out").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(how)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in err
    assert err.strip().splitlines()[-1] == "vrs: interrupted"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("serve", "--host", "0.0.0.0"), "--token-file"),
        (("robot", "--listen", "0.0.0.0:8601"), "--token-file"),
        (("serve", "--robot", "r2d2"), "puma560"),
        (("serve", "--link-loss", "pray"), "halt, hold"),
        (("serve", "--robot-at", "no:port:here"), "robot-at"),
        (("serve", "--delay", "never"), "delay"),
        (("serve", "--robot", "ipr", "--room", "attic"), "furnished"),
        (("serve", "--robot", "ipr", "--architecture", "IV"), "timeline"),
        (("serve", "--robot", "ipr", "--val-port", "0"), "val-port"),
        (("serve", "--robot", "ipr", "--camera", "0.5"), "1, 30"),
        (("serve", "--robot", "ipr", "--camera", "nan"), "no camera"),
        (("serve", "--camera", "3"), "camera"),
        (("serve", "--robot", "ipr", "--operator-loss", "panic"), "stop, carry-on"),
        (("robot", "--robot", "ipr", "--operator-loss", "panic"), "stop, carry-on"),
        (("serve", "--jobs", "mine.json"), "jobs"),
        (("serve", "--robot", "ipr", "--jobs", "/"), "a file"),
        (("robot", "--operator-loss", "carry-on"), "operator-loss"),
        (("serve", "--architecture", "II"), "architecture"),
        (("robot", "--robot", "ipr", "--pose", "ready"), "pose"),
        (("robot", "--robot", "ipr", "--link-loss", "shrug"), "halt"),
        (("robot", "--body", "jelly"), "puma560"),
        (("robot", "--robot", "ipr", "--body", "ideal"), f"ipr must be one of {', '.join(WORLDS)}, bare"),
        (("serve", "--robot", "ipr", "--robot", "micro", "--body", "ideal"), "body of ipr must be one of"),
        (("reproduce", "doulgeri", "--body", "mujoco", "--out", "out"), "no robot in it has physics"),
        (("lab", "--robot", "ipr@jelly", "--out", "lab"), "body of ipr must be one of"),
        (("robot", "--pose", "lotus"), "nominal"),
        (("robot", "--offset", "fixed"), "fixed:S"),
        (("robot", "--timeout", "9"), "0.1"),
        (("robot", "--lead", "0"), "0.01"),
        (("robot", "--listen", "127.0.0.1:99999"), "listen"),
        (("robot", "--max-age", "nan"), "max-age"),
        (("robot", "--robot", "ipr", "--timeout", "nan"), "timeout"),
        (("robot", "--rsp", "127.0.0.1:0", "--pose", "ready"), "thin client"),
        (("serve", "--body", "jelly"), "puma560"),
        (("serve", "--max-age", "nan"), "0.01, 2"),
        (("serve", "--robot-at", "127.0.0.1:1", "--body", "exact"), "--robot-at has its own"),
        (("serve", "--robot", "ipr", "--robot-at", "127.0.0.1:1", "--architecture", "I"), "--robot-at has its own"),
        (("serve", "--robot-token-file", "tokens"), "--robot-at"),
    ],
)
def test_doors_say_what_is_allowed(capsys, arguments, said):
    assert exit_status(list(arguments)) == 2
    error = capsys.readouterr().err
    assert error.startswith("vrs: ")
    assert said in error
    assert len(error.strip().splitlines()) == 1


@pytest.mark.parametrize("arguments", [["doctor"], ["console", "--alone"]])
@pytest.mark.parametrize("closed", ["<&-", ">&-", "<&- >&- 2>&-"])
def test_it_runs_without_standard_streams(arguments, closed):
    script = "from interfaces.cli import main; main()"
    asked = ["sh", "-c", f'exec "$0" -c "$@" {closed}', sys.executable, script, *arguments]
    done = subprocess.run(asked, capture_output=True, stdin=subprocess.DEVNULL, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_output_that_finds_no_room_is_one_line(tmp_path):
    script = "from interfaces.cli import main; main()"
    with open("/dev/full", "wb") as full:
        asked = [sys.executable, "-c", script, "doctor", "--json"]
        done = subprocess.run(asked, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (1, "vrs: standard output: No space left on device\n")


def test_a_console_whose_output_nobody_reads_ends_without_a_traceback():
    command = [sys.executable, "-c", "from interfaces.cli import main; main()", "console", "--alone"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        process.stdout.close()
        process.stdin.write(b"where\n")
        process.stdin.flush()
        said = process.stderr.read()
        assert (process.wait(30), said) == (1, b"")


def test_a_terminal_that_knows_no_unicode_gets_what_it_knows():
    asked = [sys.executable, "-c", "from interfaces.cli.main import _ready_streams as r; r(); print('−8 … 8')"]
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run(asked, capture_output=True, env=environment, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"?8 ? 8\n", b"")


@pytest.mark.parametrize("redirected", ["</dev/null", "</etc/hostname", "<&-"])
def test_standard_input_that_is_no_pipe_has_ended(redirected):
    """A service has none, or /dev/null, which can't be waited for."""
    script = (
        "import asyncio\nfrom interfaces.cli.options import end_with_input\n"
        "async def main():\n    ended = asyncio.Event()\n    end_with_input(ended)\n"
        "    await asyncio.wait_for(ended.wait(), 5)\nasyncio.run(main())"
    )
    asked = ["sh", "-c", f'exec "$0" -c "$1" {redirected}', sys.executable, script]
    done = subprocess.run(asked, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("asked", "status"),
    [
        ("127.0.0.1:8600", 200),
        ("LOCALHOST:8600", 200),
        ("127.0.0.1:9000", 200),
        ("lab.example", 200),
        ("127.0.0.1:9001", 403),
        ("lab.example:8600", 403),
        ("other.example", 403),
    ],
)
def test_a_server_answers_to_its_own_addresses_and_those_it_was_told_of(asked, status):
    from starlette.responses import PlainTextResponse
    from starlette.routing import Route

    from interfaces.cli.options import asked_for
    from interfaces.stream.server import application

    allowed = asked_for("127.0.0.1", ["127.0.0.1:9000", "Lab.example"])(8600)
    app = application([Route("/", lambda _: PlainTextResponse("here"))], allowed)

    def answer(origin):
        headers = [(b"host", asked.encode()), (b"origin", origin.encode())]
        scope = {"type": "http", "method": "GET", "path": "/", "query_string": b"", "headers": headers}
        sent = []

        async def receive():
            return {"type": "http.request"}

        async def send(message):
            sent.append(message)

        asyncio.run(app(scope, receive, send))
        return sent[0]["status"], sent[1]["body"].decode()

    found, text = answer(f"http://{asked}")
    assert found == status
    assert ("--reached-as" in text) == (status == 403)
    assert answer("http://other.example")[0] == 403


@pytest.mark.parametrize("text", ["http://lab.example", "lab.example/", "", "a b", "lab:port", "[::1"])
def test_an_address_that_isnt_one_is_refused(capsys, text):
    for arguments in (["serve"], ["serve", "--robot", "ipr"], ["robot"], ["robot", "--robot", "ipr"]):
        assert exit_status([*arguments, "--reached-as", "lab.example", "--reached-as", text]) == 2
        assert "HOST or HOST:PORT" in capsys.readouterr().err


def test_a_token_file_is_made_for_its_owner_alone(tmp_path):
    from interfaces.cli.options import access_for
    from interfaces.messages.control import Role
    from interfaces.stream.access import read_tokens

    path = tmp_path / "tokens"
    access = access_for("192.0.2.1", path, free={Role.SITE})
    assert path.stat().st_mode & 0o777 == 0o600
    tokens = read_tokens(path)
    assert set(tokens) == set(Role)
    assert access.refusal(Role.SITE, None) != ""
    assert access.refusal(Role.SITE, tokens[Role.VIEWER]) != ""
    assert access.refusal(Role.SITE, tokens[Role.SITE]) == ""
    again = access_for("127.0.0.1", path, free={Role.SITE})
    assert again.refusal(Role.OPERATOR, tokens[Role.ADMIN]) == ""
