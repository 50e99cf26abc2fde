"""The rules of the house: imports point one way, one file reads a clock, doors are named, heavy things wait."""

from __future__ import annotations

import ast
import importlib
import inspect
import os
import subprocess
import sys
from pathlib import Path

import pytest

HOME = Path(__file__).resolve().parents[1]
OURS = ("vrs", "robots", "interfaces")
ALLOWED = {"vrs": {"vrs"}, "robots": {"vrs", "robots"}, "interfaces": {"vrs", "robots", "interfaces"}}
STRANGE = {"examples", "tests", "benchmarks"}
LOWER = {
    "link": (),
    "middleware": ("link",),
    "jobs": ("val2",),
    "teleop": ("jobs", "link", "wire"),
    "stream": ("jobs", "link", "teleop", "wire"),
    "rsp": ("link", "stream"),
}
"""The lower parts of `interfaces`, and what each may import of the others."""
STUDYING = ("lab", "report", "recording", "cli")
"""The parts that may import the laboratory: what runs live never needs it."""
HEAVY = {"pybullet", "pybullet_data", "pybullet_utils", "roboticstoolbox", "spatialmath", "trimesh", "matplotlib"}
NUMPY = 0.15
"""What importing NumPy takes on a machine of usual pace [s]."""
SOCKETS = {"socket", "socketserver", "asyncio", "ssl", "http", "urllib", "selectors"}
CLOCKS = {"time", "datetime"}
FILES = [path for package in OURS for path in sorted((HOME / package).rglob("*.py"))]


def imports(tree, *, top_only=False):
    """Names of modules that a file imports, with the line."""
    nodes = ast.walk(tree)
    if top_only:
        nodes = [node for node in tree.body if isinstance(node, (ast.Import, ast.ImportFrom))]
    for node in nodes:
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import in line {node.lineno}"
            yield node.module, node.lineno


def violations(path, package):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for name, line in imports(tree):
        root = name.split(".")[0]
        if root in STRANGE or (root in OURS and root not in ALLOWED[package]):
            yield f"{path}:{line} imports {name}"
        if package == "vrs" and (root in SOCKETS or root.startswith("pybullet")):
            yield f"{path}:{line} imports {name}"
        if package == "vrs" and root in CLOCKS and path.name != "clock.py":
            yield f"{path}:{line} imports {name}"
    for name, line in imports(tree, top_only=True):
        if name.split(".")[0] in HEAVY or name == "scipy.interpolate":
            yield f"{path}:{line} imports {name} when it is loaded"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(HOME)))
def test_imports_point_one_way(path):
    assert list(violations(path, path.relative_to(HOME).parts[0])) == []


def upward(path, part):
    """Imports of a file of a part of `interfaces` that the part may not have."""
    for name, line in imports(ast.parse(path.read_text(encoding="utf-8"))):
        root, _, inner = name.partition(".")
        other = inner.split(".")[0]
        if root != "interfaces" or other in ("", part) or not (HOME / "interfaces" / other).is_dir():
            continue
        allowed = any(f"{inner}.".startswith(f"{one}.") for one in LOWER.get(part, (other,)))
        if not allowed or (other == "lab" and part not in STUDYING):
            yield f"{path}:{line} imports {name}"


@pytest.mark.parametrize("part", sorted(path.parent.name for path in (HOME / "interfaces").glob("*/__init__.py")))
def test_the_parts_of_interfaces_build_on_lower_ones(part):
    assert [found for path in (HOME / "interfaces" / part).rglob("*.py") for found in upward(path, part)] == []


def test_an_import_upward_is_seen(tmp_path):
    bad = tmp_path / "bad.py"
    bad.write_text("from interfaces.stream.hub import Hub\nfrom interfaces.link.round_trip import Ping\n")
    assert len(list(upward(bad, "teleop"))) == 1
    bad.write_text("def f():\n    import interfaces.lab.claims\n")
    assert len(list(upward(bad, "runtime"))) == 1
    assert not list(upward(bad, "report"))


@pytest.mark.parametrize("package", ["robots", "interfaces"])
def test_the_laboratory_reads_no_clock(package):
    reading = [
        f"{path}:{line}"
        for path in sorted((HOME / package).rglob("*.py"))
        for name, line in imports(ast.parse(path.read_text(encoding="utf-8")))
        if name.split(".")[0] in CLOCKS and path != HOME / "interfaces/cli/doctor.py"
    ]
    assert reading == []


def test_a_violation_is_seen(tmp_path):
    bad = tmp_path / "bad.py"
    bad.write_text("import time\nimport socket\nfrom robots import puma560\nimport trimesh\n")
    assert len(list(violations(bad, "vrs"))) == 4


@pytest.mark.parametrize("path", [path for path in FILES if path.name == "__init__.py"], ids=str)
def test_a_door_names_what_it_opens(path):
    name = ".".join(path.parent.relative_to(HOME).parts)
    tree = ast.parse(path.read_text(encoding="utf-8"))
    imported = {
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(f"{name}.")
        for alias in node.names
    }
    defined = {node.name for node in tree.body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    public = {item for item in imported | defined if not item.startswith("_")}
    assert "*" not in public
    if not public:
        return
    module = importlib.import_module(name)
    assert set(module.__all__) == {item for item in public if not inspect.ismodule(getattr(module, item))}
    assert len(module.__all__) == len(set(module.__all__))
    assert all(hasattr(module, name) for name in module.__all__)


@pytest.mark.parametrize(("code", "most"), [("import vrs", 0.3), ("import interfaces.cli", 0.7)])
def test_the_door_opens_quickly_and_loads_nothing_heavy(code, most, tmp_path):
    """Within its bar on a machine of usual pace; NumPy's own import, beside it, says how slow this one is now.

    From the second time on, as for a user: what Python has compiled is kept, here beside the test.
    """
    kept = {**os.environ, "PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(tmp_path)}

    def probe(code: str) -> tuple[float, list[str]]:
        text = (
            f"import sys, time; t = time.process_time(); {code}; t = time.process_time() - t; "
            f"print(t, *sorted({HEAVY!r} & set(sys.modules)))"
        )
        done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True, env=kept)
        seconds, *heavy = done.stdout.split()
        return float(seconds), heavy

    best = yardstick = float("inf")
    for _ in range(5):
        seconds, heavy = probe(code)
        assert heavy == []
        best = min(best, seconds)
        yardstick = min(yardstick, probe("import numpy")[0])
    assert best <= most * max(1.0, yardstick / NUMPY)
