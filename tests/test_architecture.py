"""The rules of the house: imports point one way, one file reads a clock, doors are named, heavy things wait."""

from __future__ import annotations

import ast
import graphlib
import importlib
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

HOME = Path(__file__).resolve().parents[1]
OURS = ("vrs", "robots", "interfaces")
STRANGE = {"examples", "tests", "benchmarks"}
# fmt: off
ORDER = (
    "vrs",
    # The robots.
    "robots.solids", "robots.rooms", "robots.base", "robots.robot", "robots.driver", "robots.chain",
    "robots.vehicle", "robots.things", "robots.description", "robots.bullet", "robots.mujoco", "robots.drives",
    "robots.onboard", "robots.simulated", "robots.mobile", "robots.described", "robots.ipr",
    "robots.puma560", "robots.cubo", "robots",
    # What the interfaces share; values that cross or are stored.
    "interfaces.system", "interfaces.pipes", "interfaces.timer", "interfaces.messages",
    # The network; what is asked of a personal robot.
    "interfaces.link", "interfaces.middleware", "interfaces.jobs",
    # What serves an engine, and its clients; both sites; what a run is.
    "interfaces.engine_server", "interfaces.clients", "interfaces.teleop", "interfaces.runs",
    # Server and protocols; recordings; both drivers, and the door.
    "interfaces.stream", "interfaces.rsp", "interfaces.recording", "interfaces.media", "interfaces.runtime",
    "interfaces.connecting", "interfaces",
    # The language and the page, then the laboratory, which nothing that runs live needs.
    "interfaces.val2", "interfaces.station", "interfaces.relay", "interfaces.lab", "interfaces.report",
    "interfaces.cli",
)
# fmt: on
"""The rooms, folders and files, in their order: each imports only itself and what stands before it."""
HEAVY = {
    "mujoco",
    "yourdfpy",
    "collada",
    "pybullet",
    "pybullet_data",
    "pybullet_utils",
    "roboticstoolbox",
    "spatialmath",
    "trimesh",
    "matplotlib",
}
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
        if root in STRANGE:
            yield f"{path}:{line} imports {name}"
        if package == "vrs" and (root in SOCKETS or root.startswith("pybullet")):
            yield f"{path}:{line} imports {name}"
        if package == "vrs" and root in CLOCKS and path.name != "clock.py":
            yield f"{path}:{line} imports {name}"
    for name, line in imports(tree, top_only=True):
        if name.split(".")[0] in HEAVY or name == "scipy.interpolate":
            yield f"{path}:{line} imports {name} when it is loaded"


POSIX = {"fcntl", "grp", "posix", "pty", "pwd", "readline", "resource", "syslog", "termios", "tty", "uvloop"}
"""Modules that some systems haven't."""
ONLY_SOME = re.compile(
    r"os\.(fork|sched_|setsid|killpg|nice|mkfifo|openpty|fchmod|O_CLOEXEC|O_NONBLOCK)|AF_UNIX|SEQPACKET|pass_fds"
    r"|add_signal_handler"
)


def test_what_only_some_systems_have_is_asked_for_in_its_adapters() -> None:
    """Each of them does without it where it isn't there; the rest knows no system."""
    adapters = {HOME / "interfaces/system.py", HOME / "interfaces/pipes.py"}
    found = []
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        named = {name.split(".")[0] for name, _ in imports(ast.parse(text))} & POSIX
        if path not in adapters:
            found += [f"{path.relative_to(HOME)}: {name}" for name in sorted(named)]
            found += [f"{path.relative_to(HOME)}: {hit[0]}" for hit in ONLY_SOME.finditer(text)]
    assert found == []


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(HOME)))
def test_imports_point_one_way(path):
    assert list(violations(path, path.relative_to(HOME).parts[0])) == []


def imported(home, packages):
    """What each module of a tree imports of the others, by line: at its top, in functions and for types alike."""
    modules = {}
    for path in (path for package in packages for path in (home / package).rglob("*.py")):
        name = ".".join(path.relative_to(home).with_suffix("").parts)
        modules[name.removesuffix(".__init__")] = path
    found = {}
    for module, path in modules.items():
        found[module] = {}
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"relative import in {path}:{node.lineno}"
                names = [f"{node.module}.{alias.name}" for alias in node.names]
            for name in names:
                parts = name.split(".")
                while parts and ".".join(parts) not in modules:
                    parts.pop()
                if parts and ".".join(parts) != module:
                    found[module][".".join(parts)] = node.lineno
    return found


def room_of(module, order):
    """The room that a module is in: the innermost that is named. None where none is."""
    parts = module.split(".")
    while parts and ".".join(parts) not in order:
        parts.pop()
    return ".".join(parts) or None


def out_of_order(found, order):
    """Imports of rooms that stand later in the order, and modules that are in no room of their own."""
    for module, others in found.items():
        room = room_of(module, order)
        if room is None or (room != module and room in OURS and room != "vrs"):
            yield f"{module} is in no room"
            continue
        for other, line in others.items():
            there = room_of(other, order)
            if there is not None and order.index(there) > order.index(room):
                yield f"{module}:{line} imports {other}"


def circle(found):
    """Modules that import each other in a circle; empty where none do."""
    try:
        tuple(graphlib.TopologicalSorter({module: set(others) for module, others in found.items()}).static_order())
    except graphlib.CycleError as error:
        return error.args[1]
    return []


def test_each_room_imports_what_stands_before_it():
    found = imported(HOME, OURS)
    assert list(out_of_order(found, ORDER)) == []
    assert {room_of(module, ORDER) for module in found} == set(ORDER)
    assert len(ORDER) == len(set(ORDER))


def test_no_files_import_each_other_in_a_circle():
    assert circle(imported(HOME, OURS)) == []


LOW, HIGH = "interfaces/link/low.py", "interfaces/stream/high.py"


@pytest.mark.parametrize(
    ("low", "line"),
    [
        ("from interfaces.stream.high import f\n", 1),
        ("from interfaces.stream import high\n", 1),
        ("import interfaces.stream.high\n", 1),
        ("def f():\n    from interfaces.stream.high import f\n", 2),
        ("class C:\n    def f(self):\n        import interfaces.stream.high as it\n", 3),
        ("from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from interfaces.stream.high import f\n", 3),
        ("try:\n    from interfaces.stream.high import f\nexcept ImportError:\n    f = None\n", 2),
    ],
)
def test_an_import_upward_is_seen_wherever_it_stands(tmp_path, low, line):
    for name, text in ((LOW, low), (HIGH, "def f(): ...\n")):
        path = tmp_path / name
        path.parent.mkdir(parents=True)
        path.write_text(text)
    found = imported(tmp_path, OURS)
    assert list(out_of_order(found, ORDER)) == [f"interfaces.link.low:{line} imports interfaces.stream.high"]
    assert circle(found) == []
    (tmp_path / LOW).write_text("")
    (tmp_path / HIGH).write_text(low.replace("stream.high", "link.low"))
    assert list(out_of_order(imported(tmp_path, OURS), ORDER)) == []


def test_a_circle_and_a_room_that_is_not_named_are_seen(tmp_path):
    (tmp_path / "interfaces/link").mkdir(parents=True)
    for name, text in (
        ("link/one.py", "import interfaces.link.two\n"),
        ("link/two.py", "def f():\n    from interfaces.link.three import g\n"),
        ("link/three.py", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import interfaces.link.one\n"),
        ("elsewhere.py", "import vrs\n"),
    ):
        (tmp_path / "interfaces" / name).write_text(text)
    found = imported(tmp_path, OURS)
    assert {f"interfaces.link.{name}" for name in ("one", "two", "three")} == set(circle(found))
    assert list(out_of_order(found, ORDER)) == ["interfaces.elsewhere is in no room"]


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
    bad.write_text("import time\nimport socket\nfrom tests import rig\nimport trimesh\n")
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


def private_names(home):
    """Names with a leading underscore that our packages define: functions, classes, attributes and variables."""
    names = set()
    for path in (path for package in OURS for path in (home / package).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
                names.add(node.name)
            elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
                names.add(node.attr)
            elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                names.add(node.id)
    return {name for name in names if name.startswith("_") and not name.startswith("__") and name != "_"}


def private_uses(home):
    """Where tests use private names of ours: attributes, imports, and strings as patches have them."""
    ours = private_names(home)
    for path in sorted((home / "tests").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        own = set()
        for node in ast.walk(tree):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                own.add(node.name)
            elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
                own.add(node.attr)
        texts = {part for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in ast.walk(node)}
        for node in ast.walk(tree):
            names = []
            if isinstance(node, ast.Attribute):
                of_self = isinstance(node.value, ast.Name) and node.value.id in {"self", "cls"}
                names = [] if of_self and node.attr in own else [node.attr]
            elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in OURS:
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node not in texts:
                names = [node.value.rpartition(".")[2]] if node.value.replace(".", "").isidentifier() else []
            yield from (f"{path.relative_to(home)}:{node.lineno} {name}" for name in names if name in ours)


def test_tests_use_no_private_names():
    assert list(private_uses(HOME)) == []


@pytest.mark.parametrize(
    ("line", "count"),
    [
        ("from vrs.one import f, C\n", 0),
        ("from vrs.one import _f, _C\n", 2),
        ("c._x\n", 1),
        ("c.y._x._g()\n", 2),
        ("patch(c, '_g')\n", 1),
        ("patch('vrs.one._LIMIT', 3)\n", 1),
        ("c._of_others\n", 0),
        ("class D:\n    def f(self):\n        self._x = 1\n", 0),
        ("class D(C):\n    def f(self):\n        return self._x\n", 1),
        ("f'{c}_x'\n", 0),
        ("'a text of _x'\n", 0),
    ],
)
def test_a_private_name_in_a_test_is_seen(tmp_path, line, count):
    for name, text in (
        ("vrs/one.py", "_LIMIT = 1\ndef _f(): ...\nclass _C:\n    def _g(self):\n        self._x = 1\n"),
        ("tests/test_one.py", line),
    ):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_text(text)
    assert len(list(private_uses(tmp_path))) == count


def test_the_map_of_changes_names_files_that_are_there():
    """A row of *Where to change what* gives a path; names without a folder after it stand beside it."""
    text = (HOME / "docs/architecture.md").read_text(encoding="utf-8")
    table = text.partition("## Where to change what")[2].partition("\n## ")[0]
    rows = [row.split("|") for row in table.splitlines() if row.startswith("| ")]
    missing = []
    for _, _what, where, _ in rows:
        beside = HOME
        for name in re.findall(r"`([\w./]+(?:\.py|\.js|/))`", where):
            path = HOME / name if "/" in name else beside / name
            beside = path if name.endswith("/") else path.parent
            if beside != HOME and not path.exists():
                missing.append(name)
    assert len(rows) > 40
    assert missing == []
