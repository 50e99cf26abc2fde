"""Recordings of an earlier tree open, give the same figures and tables, and run again to the same coefficients."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from tests.contract.cases import RECORDINGS
from tests.contract.doors import DATA


def test_there_are_five_and_they_are_small() -> None:
    files = list((DATA / "recordings").glob("*.mcap"))
    assert {path.stem for path in files} == {"demo", "val2", "mobile", "live", "cut"}
    assert sum(path.stat().st_size for path in files) <= 1_000_000


@pytest.mark.parametrize("name", [case.name for case in RECORDINGS])
def test_a_recording_gives_what_it_gave(name: str, unchanged: Callable[[str], None]) -> None:
    unchanged(name)


def test_an_arms_commands_ran_again_to_the_same_coefficients(past: dict[str, Any]) -> None:
    for name in ("demo", "val2", "live", "cut"):
        again = past["cases"][f"recording {name}"]["commands"][-1]
        assert (again["vrs"].split()[-2:], again["status"]) == (["--commands", "--json"], 0), name
