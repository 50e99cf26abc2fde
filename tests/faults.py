"""Plant faults at random places and see whether the tests see them: `python -m tests.faults --since REF`.

Each fault is one change of the syntax tree of a module, in a copy of the project: a comparison or a condition the
other way round, a sign, a constant, a statement left out. Places are drawn from the functions of the modules that
git says were moved or changed since a commit. The tests that import the module run first, then those of its
package, then the contract suite, then all. A test that saw a fault must pass without it. A fault that nothing saw
is printed with its place, to be judged by eye: it may mean the same as what was there.
"""

from __future__ import annotations

import argparse
import ast
import copy
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
OURS = ("vrs", "robots", "interfaces")
LONGEST = 1800.0
"""How long one round of tests may take [s]; a fault that makes them hang is seen."""
_OTHER = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip


@dataclass(frozen=True)
class Fault:
    """One change of one module."""

    path: Path
    """The module, from the tree's root."""
    line: int
    """Where."""
    what: str
    """The line before and after."""
    source: str
    """The whole module with the fault in it."""


def changed(since: str) -> list[Path]:
    """Return the modules of ours that were added, moved or changed since a commit."""
    command = ["git", "diff", "--name-only", "--diff-filter=AMR", "-M", since, "--", *(f"{name}/" for name in OURS)]
    names = subprocess.run(command, cwd=HOME, check=True, capture_output=True, text=True).stdout.split()
    return [Path(name) for name in names if name.endswith(".py") and not name.endswith("__init__.py")]


def _nodes(function: ast.AST) -> Iterator[ast.AST]:
    for node in ast.walk(function):
        if isinstance(
            node, ast.Compare | ast.BoolOp | ast.BinOp | ast.If | ast.Expr | ast.AugAssign | ast.Constant
        ):
            yield node


def _change(node: ast.AST) -> bool:
    """Change one node in place; False where there's nothing to change."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in _OTHER:
        node.ops[0] = _OTHER[type(node.ops[0])]()
    elif isinstance(node, ast.BoolOp | ast.BinOp | ast.AugAssign) and type(node.op) in _OTHER:
        node.op = _OTHER[type(node.op)]()
    elif isinstance(node, ast.If):
        node.test = ast.UnaryOp(ast.Not(), node.test)
    elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call):
        node.value = ast.Constant(None)
    elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
        node.value = node.value * 2 + 1
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        node.value = not node.value
    else:
        return False
    return True


def plant(path: Path, rng: random.Random) -> Fault | None:
    """Return a module with one fault in one of its functions; None where the place drawn has nothing to change."""
    text = (HOME / path).read_text(encoding="utf-8")
    tree = ast.parse(text)
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    places = [node for function in functions for statement in function.body for node in _nodes(statement)]
    if not places:
        return None
    node = rng.choice(places)
    before = ast.unparse(_statement(tree, node)).split("\n")[0]
    if not _change(node):
        return None
    after = ast.unparse(_statement(tree, node)).split("\n")[0]
    if before == after:
        return None
    changed_tree = ast.fix_missing_locations(copy.deepcopy(tree))
    return Fault(path, node.lineno, f"{before}  ->  {after}", ast.unparse(changed_tree))


def _statement(tree: ast.Module, node: ast.AST) -> ast.AST:
    """Return the innermost statement that holds a node."""
    holding = [one for one in ast.walk(tree) if isinstance(one, ast.stmt) and any(n is node for n in ast.walk(one))]
    return min(holding, key=lambda one: sum(1 for _ in ast.walk(one)))


def rounds(path: Path) -> Iterator[list[str]]:
    """Tests by how likely they see a fault of a module: importing it, of its package, contract, all."""
    module = ".".join(path.with_suffix("").parts)
    direct = [
        str(test.relative_to(HOME))
        for test in sorted((HOME / "tests").rglob("test_*.py"))
        if f"{module} import" in (text := test.read_text(encoding="utf-8")) or f"import {module}\n" in text
    ]
    if direct:
        yield direct
    mirror = Path("tests") / path.parent
    while not (HOME / mirror).is_dir():
        mirror = mirror.parent
    if mirror.parts[1:] and mirror != Path("tests/interfaces"):
        yield [str(mirror)]
    yield ["tests/contract"]
    yield ["tests"]


def seen(tree: Path, fault: Fault, workers: int) -> str | None:
    """Return the test that saw a fault first, in a copy of the project; None where none did."""
    place = tree / fault.path
    whole = place.read_text(encoding="utf-8")
    for tests in rounds(fault.path):
        failing_anyway: list[str] = []
        while True:
            place.write_text(fault.source, encoding="utf-8")
            by = _first_failure(tree, tests, workers, failing_anyway)
            place.write_text(whole, encoding="utf-8")
            if by is None:
                break
            if "::" not in by or _first_failure(tree, [by], 0, []) is None:
                return by
            failing_anyway.append(by)
    return None


def copied(folder: Path) -> Path:
    """A copy of the project in a folder, in which a fault may be planted."""
    tree = folder / "tree"
    ignored = shutil.ignore_patterns(".git", ".venv", "out", ".*_cache", "__pycache__")
    shutil.copytree(HOME, tree, ignore=ignored)
    (tree / ".venv").symlink_to(HOME / ".venv")
    return tree


def _first_failure(tree: Path, tests: list[str], workers: int, without: list[str]) -> str | None:
    """Return what fails first, or how the run ended otherwise; None where all pass."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-n", str(workers), *tests]
    command += ["-m", "", *(f"--deselect={test}" for test in without)]
    environment = os.environ | {"PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            command, cwd=tree, env=environment, capture_output=True, text=True, timeout=LONGEST, check=False
        )
    except subprocess.TimeoutExpired:
        return "they hang"
    if done.returncode in (0, 5):
        return None
    failed = [line.split()[1] for line in done.stdout.split("\n") if line.startswith(("FAILED ", "ERROR "))]
    return failed[0] if failed else (done.stdout + done.stderr).strip().split("\n")[-1]


def main() -> int:
    """Plant so many faults; the exit status is how many nothing saw."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--since", default="HEAD~1", help="modules changed or moved since this commit")
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    rng = random.Random(options.seed)
    paths = changed(options.since)
    sizes = [len((HOME / path).read_text(encoding="utf-8").split("\n")) for path in paths]
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        tree = copied(Path(folder))
        count = 0
        while count < options.count:
            fault = plant(rng.choices(paths, sizes)[0], rng)
            if fault is None:
                continue
            count += 1
            by = seen(tree, fault, options.workers)
            missed += by is None
            print(f"{count}. {fault.path}:{fault.line}  {fault.what}\n   {by or 'NOT SEEN'}", flush=True)  # noqa: T201
    print(f"{count - missed} of {count} seen")  # noqa: T201
    return missed


if __name__ == "__main__":
    sys.exit(main())
