"""Every example runs as a user runs it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

HOME = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((HOME / "examples").glob("[0-9]*.py"))
PROGRAMS = [*sorted((HOME / "examples/val2").glob("*.v2")), *sorted((HOME / "examples/val2/textbook").glob("*.v2"))]


NEEDS = {"29_grasp.py": [pytest.mark.needs("pybullet")]}
"""What examples need beside the usual world of physics."""


@pytest.mark.parametrize(
    "path", [pytest.param(path, marks=NEEDS.get(path.name, ())) for path in EXAMPLES], ids=lambda path: path.name
)
def test_an_example_runs(path, tmp_path):
    done = subprocess.run(
        [sys.executable, str(path)], capture_output=True, text=True, cwd=tmp_path, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


def test_there_are_examples():
    assert EXAMPLES


def test_the_course_names_each_with_its_own_first_line():
    page = (HOME / "docs" / "examples.md").read_text().splitlines()
    said = [f"| `{path.name}` | {path.read_text().splitlines()[0].strip(chr(34))} |" for path in EXAMPLES]
    said += [f"| `{path.name}` | {path.read_text().splitlines()[0].partition(';')[2]} |" for path in PROGRAMS]
    assert [line for line in page if line.startswith("| `")] == said
