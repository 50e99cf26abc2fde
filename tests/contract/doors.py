"""The doors from outside: a `vrs` command that is run, and one that serves, in a process with a pinned environment.

Nothing of ours is imported here. What a command writes must not hang on the machine: kernels of NumPy and OpenBLAS
that hang on the processor are off, and a directory of its own keeps paths out of what it says.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
HOUSE = HERE.parents[1]
DATA = HERE / "data"
SECONDS = 300.0
"""A command that takes longer is ended [s]."""
VRS = (sys.executable, "-c", "from interfaces.cli import main; main()")


def environment(home: Path) -> dict[str, str]:
    """What a command is run with: nothing of the user's but the search path, and what is hidden from tests."""
    hidden = os.environ.get("VRS_WITHOUT", "")
    return {
        "PATH": os.environ["PATH"],
        "PYTHONPATH": os.pathsep.join([*([str(HOUSE / "tests" / "without")] if hidden else []), str(HOUSE)]),
        "VRS_WITHOUT": hidden,
        "HOME": str(home),
        "LANG": "C.UTF-8",
        "TZ": "UTC",
        "COLUMNS": "100",
        "NO_COLOR": "1",
        "MPLBACKEND": "agg",
        "PYTHONHASHSEED": "random",
        "PYTHONDONTWRITEBYTECODE": os.environ.get("PYTHONDONTWRITEBYTECODE", ""),
        # Without these two, bits hang on whether there's AVX-512.
        "NPY_ENABLE_CPU_FEATURES": "X86_V3",
        "OPENBLAS_CORETYPE": "Haswell",
        "OPENBLAS_NUM_THREADS": "1",
    }


def directory(place: Path) -> Path:
    """Prepare an empty directory for commands: `data` in it leads to the suite's own data, `.home` is nobody's."""
    (place / "data").symlink_to(DATA)
    (place / ".home").mkdir()
    return place


@dataclass(frozen=True, slots=True)
class Done:
    """What a command that has ended left."""

    status: int
    out: str
    errors: str


def run(command: Sequence[str], *arguments: str, cwd: Path, stdin: str = "") -> Done:
    """Run a program to its end in a directory made by `directory`."""
    done = subprocess.run(
        [*command, *arguments],
        cwd=cwd,
        env=environment(cwd / ".home"),
        input=stdin.encode(),
        capture_output=True,
        timeout=SECONDS,
        check=False,
    )
    return Done(done.returncode, done.stdout.decode(), done.stderr.decode())


@dataclass(frozen=True, slots=True)
class Serving:
    """A command that serves."""

    process: subprocess.Popen[str]
    address: str
    """HOST:PORT of the first address that it said."""
    line: str
    """The line in which it said so."""


@contextlib.contextmanager
def served(*arguments: str, cwd: Path) -> Iterator[Serving]:
    """Run a `vrs` command that listens; it gets 60 s to say where, and is ended in the end."""
    with (
        open(cwd / "errors.txt", "w", encoding="utf-8") as errors,
        subprocess.Popen(
            [*VRS, *arguments],
            cwd=cwd,
            env=environment(cwd / ".home"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
        ) as process,
    ):
        assert process.stdout is not None
        too_late = threading.Timer(60.0, process.kill)
        too_late.start()
        try:
            line = process.stdout.readline()
            too_late.cancel()
            if "://" not in line:
                raise RuntimeError(f"it doesn't serve: {line!r} {(cwd / 'errors.txt').read_text()!r}")
            address = line.split("://", 1)[1].split()[0].split("/")[0].rstrip(").,")
            # What else it says mustn't fill the pipe.
            threading.Thread(target=process.stdout.read, daemon=True).start()
            yield Serving(process, address, line)
        finally:
            too_late.cancel()
            process.terminate()
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


ARITHMETIC = """
import hashlib, json, math, zlib
import numpy as np, scipy, scipy.interpolate, scipy.optimize
x = np.linspace(-3.0, 3.0, 1001)
a = np.random.default_rng(1).standard_normal((40, 40))
parts = [np.sin(x), np.exp(x), np.arctan2(x, 1.3), np.hypot(x, 0.7), x.sum(), a @ a, np.linalg.solve(a, a[0]),
    np.linalg.svd(a)[1], scipy.interpolate.CubicSpline(x, np.cos(x))(0.3 * x),
    scipy.optimize.brentq(lambda u: u * u - 2.0, 0.0, 2.0),
    [f(0.1 * k) for k in range(1, 60) for f in (math.sin, math.tan, math.exp, math.log, math.atan)]]
kept = hashlib.sha256(zlib.compress(bytes(range(256)) * 99))
for part in parts:
    kept.update(np.asarray(part, dtype=float).tobytes())
print(json.dumps(kept.hexdigest()[:16]))
"""


def arithmetic(cwd: Path) -> str:
    """Digest what NumPy, SciPy, BLAS and the C library make of a few numbers here, in the pinned environment."""
    done = run((sys.executable, "-c", ARITHMETIC), cwd=cwd)
    assert done.status == 0, done.errors
    digest: str = json.loads(done.out)
    return digest
