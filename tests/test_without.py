"""`VRS_WITHOUT` hides modules from processes that tests start, as if they weren't installed."""

from __future__ import annotations

import os
import subprocess
import sys

from tests.conftest import WITHOUT


def test_a_hidden_module_is_not_found_and_others_are() -> None:
    code = "from importlib.util import find_spec as f; print(f('trimesh'), f('numpy') is None)"
    environment = os.environ | {"VRS_WITHOUT": "trimesh", "PYTHONPATH": str(WITHOUT)}
    ran = subprocess.run(
        [sys.executable, "-c", code],
        env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert ran.stdout.split() == ["None", "False"]
