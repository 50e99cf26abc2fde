"""A person at a monitor."""

from __future__ import annotations

from pathlib import Path

import pytest

from .sitting import Sitting


@pytest.fixture
def sitting(tmp_path: Path) -> Sitting:
    return Sitting(tmp_path)
