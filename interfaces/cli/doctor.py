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
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Annotated

import typer

from interfaces.cli.options import option

PACKAGES = (
    "matplotlib",
    "meshcat",
    "msgspec",
    "numpy",
    "rich",
    "roboticstoolbox",
    "ruckig",
    "scipy",
    "trimesh",
)
OURS = ("vrs", "robots", "interfaces")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "firefox")
PROBE_TIMEOUT = 30.0
"""Longest wait for PyBullet to load [s]."""


@dataclass(frozen=True, slots=True)
class Check:
    """Outcome of one check."""

    name: str
    ok: bool
    required: bool
    """Whether the demo needs it."""
    found: str
    mend: str = ""
    """What to do when it isn't ok."""


def check_python() -> Check:
    """The Python that PyBullet's wheels exist for."""
    version = platform.python_version()
    ok = sys.version_info[:2] == (3, 11)
    return Check("python", ok, True, version, "install Python 3.11 and make the environment with it")


def check_packages() -> Check:
    """Everything that the base install brings."""
    missing = [name for name in PACKAGES if importlib.util.find_spec(name) is None]
    found = f"missing: {', '.join(missing)}" if missing else f"all {len(PACKAGES)} found"
    return Check("packages", not missing, True, found, "install vrs-teleop again in this environment")


def check_pybullet() -> Check:
    """PyBullet loads, and was built with NumPy; in a process of its own, which may crash."""
    code = "import pybullet; print(pybullet.isNumpyEnabled())"
    mend = "install pybullet again, after numpy, from a wheel for this system"
    try:
        probe = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, timeout=PROBE_TIMEOUT, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return Check("pybullet", False, True, f"didn't load: {error}", mend)
    if probe.returncode != 0:
        lines = probe.stderr.strip().splitlines()
        return Check("pybullet", False, True, lines[-1] if lines else "crashed while loading", mend)
    numpy_enabled = probe.stdout.strip().endswith("1")
    return Check("pybullet", numpy_enabled, True, "with NumPy" if numpy_enabled else "without NumPy", mend)


def check_browser() -> Check:
    """A browser to open reports with."""
    path = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    mend = "install chromium or firefox, or open report.html on another machine: it is one file"
    return Check("browser", path is not None, False, path or "none found", mend)


def check_port() -> Check:
    """A port on the loopback interface can be opened."""
    mend = "allow this user to listen on 127.0.0.1; the demo works without"
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as listener:
            listener.bind(("127.0.0.1", 0))
            listener.listen(1)
            port = listener.getsockname()[1]
    except OSError as error:
        return Check("ports", False, False, f"127.0.0.1 can't be listened on: {error.strerror}", mend)
    return Check("ports", True, False, f"127.0.0.1:{port} opened and closed")


def check_clock() -> Check:
    """The clock of live sessions never runs back and is fine enough for a 1 ms servo."""
    info = time.get_clock_info("monotonic")
    ok = info.monotonic and info.resolution <= 1e-3
    found = f"{'monotonic' if info.monotonic else 'not monotonic'}, resolution {info.resolution:g} s"
    return Check("clock", ok, False, found, "live sessions need a monotonic clock of 1 ms or finer")


def check_names() -> Check:
    """`vrs`, `robots` and `interfaces` are this project's, not other packages of the same names."""
    home = Path(__file__).resolve().parents[2]
    strangers = []
    for name in OURS:
        spec = importlib.util.find_spec(name)
        origin = None if spec is None or spec.origin is None else Path(spec.origin).resolve()
        if origin is None or origin.parent.parent != home:
            strangers.append(f"{name} is {origin or 'missing'}")
    mend = f"remove or rename what hides them; ours lie in {home}"
    return Check("names", not strangers, True, "; ".join(strangers) or "resolve to this project", mend)


def check_version() -> Check:
    """The distribution is installed, so that its version is known."""
    try:
        return Check("version", True, False, metadata.version("vrs-teleop"))
    except metadata.PackageNotFoundError:
        return Check("version", False, False, "not installed", "install vrs-teleop in this environment")


def check_camera() -> Check:
    """What sends a mobile robot's camera and voice by RTP."""
    missing = [name for name in ("aiortc", "av") if importlib.util.find_spec(name) is None]
    found = f"missing: {', '.join(missing)}" if missing else f"by RTP, with aiortc {metadata.version('aiortc')}"
    mend = "install 'vrs-teleop[media]'; single pictures and text work without"
    return Check("camera", not missing, False, found, mend)


def check_voice() -> Check:
    """The program that speaks."""
    path = shutil.which("espeak-ng")
    mend = "install the program espeak-ng; what's to be said is shown without"
    return Check("voice", path is not None, False, path or "no espeak-ng found", mend)


CHECKS = (
    check_version,
    check_python,
    check_names,
    check_packages,
    check_pybullet,
    check_browser,
    check_camera,
    check_voice,
    check_port,
    check_clock,
)


def doctor(
    as_json: Annotated[bool, option("--json", "Write the checks as JSON on standard output.")] = False,
) -> None:
    """Check this machine and say what to mend; exits 1 when something that the demo needs is missing."""
    checks = [check() for check in CHECKS]
    healthy = all(check.ok or not check.required for check in checks)
    if as_json:
        value = {"schema": "vrs-doctor/1", "ok": healthy, "checks": [_entry(check) for check in checks]}
        typer.echo(json.dumps(value, indent=2, sort_keys=True))
    else:
        for check in checks:
            mark = "ok" if check.ok else "MISSING" if check.required else "optional"
            typer.echo(f"{mark:9}{check.name:10}{check.found}")
            if not check.ok:
                typer.echo(f"{'':19}to mend: {check.mend}")
        typer.echo("This machine is fine." if healthy else "Mend what is MISSING, then run vrs doctor again.")
    if not healthy:
        raise typer.Exit(1)


def _entry(check: Check) -> dict[str, object]:
    entry = asdict(check)
    return entry if not check.ok else {**entry, "mend": ""}
