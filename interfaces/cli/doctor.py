"""`vrs doctor`: checks this machine, and says what to mend."""

from __future__ import annotations

import importlib.util
import json
import platform
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Annotated, Final, NamedTuple, TypeAlias

import typer

from interfaces.cli.options import option

PACKAGES = (
    "matplotlib",
    "meshcat",
    "msgspec",
    "numpy",
    "rich",
    "roboticstoolbox",
    "scipy",
    "trimesh",
    "yourdfpy",
)
OURS = ("vrs", "robots", "interfaces")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "firefox")
PROBE_TIMEOUT = 30.0
"""Longest wait for PyBullet to load [s]."""
HOME: Final = Path(__file__).resolve().parents[2]
Found: TypeAlias = tuple[bool, str]
"""Whether something is as it should be, and what there is."""


def _missing(*names: str) -> str:
    """Which modules aren't there; empty where all are."""
    missing = [name for name in names if importlib.util.find_spec(name) is None]
    return f"missing: {', '.join(missing)}" if missing else ""


def _program(*names: str) -> str | None:
    """Where the first of some programs that is there lies."""
    return next((found for name in names if (found := shutil.which(name))), None)


def check_version() -> Found:
    """The distribution is installed, so that its version is known."""
    try:
        return True, metadata.version("vrs-teleop")
    except metadata.PackageNotFoundError:
        return False, "not installed"


def check_python() -> Found:
    """A Python that it's made for."""
    return sys.version_info >= (3, 11), platform.python_version()


def check_names() -> Found:
    """`vrs`, `robots` and `interfaces` are this project's, not other packages of the same names."""
    strangers = []
    for name in OURS:
        spec = importlib.util.find_spec(name)
        origin = None if spec is None or spec.origin is None else Path(spec.origin).resolve()
        if origin is None or origin.parent.parent != HOME:
            strangers.append(f"{name} is {origin or 'missing'}")
    return not strangers, "; ".join(strangers) or "resolve to this project"


def check_packages() -> Found:
    """Everything that the base install brings."""
    missing = _missing(*PACKAGES)
    return not missing, missing or f"all {len(PACKAGES)} found"


def check_pybullet() -> Found:
    """PyBullet loads, with NumPy, in a process of its own, which may crash; elsewhere MuJoCo is there."""
    if importlib.util.find_spec("pybullet") is None and not _missing("mujoco"):
        return True, f"not there; MuJoCo {metadata.version('mujoco')} is"
    code = "import pybullet; print(pybullet.isNumpyEnabled())"
    try:
        probe = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, timeout=PROBE_TIMEOUT, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return False, f"didn't load: {error}"
    if probe.returncode != 0:
        return False, (probe.stderr.strip().splitlines() or ["crashed while loading"])[-1]
    numpy_enabled = probe.stdout.strip().endswith("1")
    return numpy_enabled, "with NumPy" if numpy_enabled else "without NumPy"


def check_browser() -> Found:
    """A browser to open reports with."""
    path = _program(*BROWSERS)
    return path is not None, path or "none found"


def check_camera() -> Found:
    """What sends a mobile robot's camera and voice by RTP."""
    missing = _missing("aiortc", "av")
    return not missing, missing or f"by RTP, with aiortc {metadata.version('aiortc')}"


def check_voice() -> Found:
    """The program that speaks."""
    path = _program("espeak-ng")
    return path is not None, path or "no espeak-ng found"


def check_port() -> Found:
    """A port on the loopback interface can be opened."""
    try:
        with socket.create_server(("127.0.0.1", 0), backlog=1) as listener:
            return True, f"127.0.0.1:{listener.getsockname()[1]} opened and closed"
    except OSError as error:
        return False, f"127.0.0.1 can't be listened on: {error.strerror}"


def check_clock() -> Found:
    """The clock of live sessions never runs back and is fine enough for a 1 ms servo."""
    info = time.get_clock_info("monotonic")
    found = f"{'monotonic' if info.monotonic else 'not monotonic'}, resolution {info.resolution:g} s"
    return info.monotonic and info.resolution <= 1e-3, found


class Check(NamedTuple):
    """Something that is checked."""

    name: str
    required: bool
    """Whether the demo needs it."""
    look: Callable[[], Found]
    mend: str
    """What to do when it isn't ok."""


def _check_log(path: Path, as_json: bool) -> None:
    """Say whether a log's chain is whole, and its end's hash."""
    from interfaces.stream.audit import check_audit

    found = check_audit(path)
    if as_json:
        facts = {"lines": found.lines, "hash": found.hash, "problem": found.problem, "ok": not found.problem}
        typer.echo(json.dumps({"schema": "vrs-audit/1", **facts}, indent=2, sort_keys=True))
    else:
        typer.echo(f"{path}: {found.problem or 'whole'}")
        typer.echo(f"{found.lines} lines follow each other; the hash of the last one is {found.hash}")
    if found.problem:
        raise typer.Exit(1)


CHECKS: Final = (
    Check("version", False, check_version, "install vrs-teleop in this environment"),
    Check("python", True, check_python, "install Python 3.11 or later and make the environment with it"),
    Check("names", True, check_names, f"remove or rename what hides them; ours lie in {HOME}"),
    Check("packages", True, check_packages, "install vrs-teleop again in this environment"),
    Check("pybullet", True, check_pybullet, "install pybullet again, after numpy, from a wheel for this system"),
    Check(
        "browser",
        False,
        check_browser,
        "install chromium or firefox, or open report.html on another machine: it is one file",
    ),
    Check("camera", False, check_camera, "install 'vrs-teleop[media]'; single pictures and text work without"),
    Check("voice", False, check_voice, "install the program espeak-ng; what's to be said is shown without"),
    Check("ports", False, check_port, "allow this user to listen on 127.0.0.1; the demo works without"),
    Check("clock", False, check_clock, "live sessions need a monotonic clock of 1 ms or finer"),
)


def doctor(
    log: Annotated[Path | None, option("FILE", "Check this audit log instead, line by line.")] = None,
    as_json: Annotated[bool, option("--json", "Write the checks as JSON on standard output.")] = False,
) -> None:
    """Check this machine and say what to mend; exits 1 when something that the demo needs is missing.

    With --log it exits 1 when a line of that log is changed, missing or cut, and says the first one.
    """
    if log is not None:
        _check_log(log, as_json)
        return
    found = [(check, *check.look()) for check in CHECKS]
    healthy = all(ok or not check.required for check, ok, _ in found)
    if as_json:
        rows = [
            {"name": one.name, "ok": ok, "required": one.required, "found": text, "mend": "" if ok else one.mend}
            for one, ok, text in found
        ]
        typer.echo(json.dumps({"schema": "vrs-doctor/1", "ok": healthy, "checks": rows}, indent=2, sort_keys=True))
    else:
        for check, ok, text in found:
            mark = "ok" if ok else "MISSING" if check.required else "optional"
            typer.echo(f"{mark:9}{check.name:10}{text}")
            if not ok:
                typer.echo(f"{'':19}to mend: {check.mend}")
        typer.echo("This machine is fine." if healthy else "Mend what is MISSING, then run vrs doctor again.")
    if not healthy:
        raise typer.Exit(1)
