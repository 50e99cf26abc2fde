"""`VRS_WITHOUT` hides modules as if they weren't installed; tests that ask for one are skipped, no others."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ABSENT, HIDDEN, HOME, WITHOUT


def test_a_hidden_module_is_not_found_and_others_are() -> None:
    code = "from importlib.util import find_spec as f; print(f('trimesh'), f('numpy') is None)"
    environment = os.environ | {"VRS_WITHOUT": "trimesh", "PYTHONPATH": str(WITHOUT)}
    ran = subprocess.run(
        [sys.executable, "-c", code],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert ran.stdout.split() == ["None", "False"]


ASKING = """
import sys
from functools import partial
import pytest
from robots.puma560.body import RealArm

@pytest.mark.parametrize("world", ["bullet", "mujoco"])
def test_in_a_world_that_is_named(world):
    RealArm(world=world).close()

@pytest.mark.parametrize("make", [partial(RealArm, world="bullet")])
def test_in_a_world_of_what_makes_it(make):
    make().close()

@pytest.mark.needs("pybullet")
def test_that_says_so():
    RealArm(world="bullet").close()

def test_that_imports_it():
    import pybullet

@pytest.mark.needs("pybullet")
def test_that_says_so_and_passes():
    RealArm().close()

def test_that_asks_and_does_not_say_so():
    RealArm(world="bullet").close()

def test_in_the_usual_world():
    RealArm().close()
    assert "pybullet" not in sys.modules
"""
OUTCOMES = {
    "test_in_a_world_that_is_named[bullet]": "SKIPPED", "test_in_a_world_that_is_named[mujoco]": "PASSED",
    "test_in_a_world_of_what_makes_it[make0]": "SKIPPED", "test_that_says_so": "SKIPPED",
    "test_that_imports_it": "SKIPPED", "test_that_says_so_and_passes": "FAILED",
    "test_that_asks_and_does_not_say_so": "FAILED", "test_in_the_usual_world": "PASSED",
}  # fmt: skip


@pytest.mark.skipif("mujoco" in ABSENT - HIDDEN, reason="needs mujoco")
def test_what_asks_for_a_hidden_module_is_skipped_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "test_asking.py").write_text(ASKING)
    (tmp_path / "test_importing.py").write_text("import pybullet_data\n")
    environment = os.environ | {
        "VRS_WITHOUT": "pybullet,pybullet_data", "PYTHONPATH": os.pathsep.join([str(WITHOUT), str(HOME)])
    }  # fmt: skip
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", "-c", os.devnull, "--rootdir", tmp_path, "-p", "tests.conftest", "-v",
         "-rs", "-p", "no:cacheprovider", "-p", "no:xdist", tmp_path],
        env=environment, capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    found = dict(re.findall(r"^test_asking\.py::(\S+) (PASSED|FAILED|SKIPPED)", ran.stdout, re.MULTILINE))
    assert found == OUTCOMES, ran.stdout
    assert "says that it needs pybullet, and passes without" in ran.stdout
    assert "test_importing.py:0: needs pybullet_data" in ran.stdout
