"""What the tests of the contract share: whether this machine computes as the one that made the golden results."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from tests.contract.cases import ALL
from tests.contract.doors import arithmetic, directory
from tests.contract.golden import differences, golden, result, structure


@pytest.fixture(scope="session")
def past() -> dict[str, Any]:
    """The golden results."""
    return golden()


@pytest.fixture(scope="session")
def exact(past: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> bool:
    """Whether bytes are compared, or structure alone: they are those of PyBullet."""
    return (
        find_spec("pybullet") is not None
        and arithmetic(directory(tmp_path_factory.mktemp("arithmetic"))) == past["arithmetic"]
    )


@pytest.fixture
def unchanged(past: dict[str, Any], exact: bool, tmp_path: Path) -> Callable[[str], None]:
    """Run a case and see that it gives what it gave."""

    def check(name: str) -> None:
        found, before = result(ALL[name], tmp_path), past["cases"][name]
        if not exact:
            found, before = structure(found), structure(before)
        wrong = list(differences(found, before))
        assert not wrong, "\n".join(
            [f"not what golden.json has ({name}; how to remake it: tests/contract/golden.py)", *wrong]
        )

    return check
