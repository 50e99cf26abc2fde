"""Commands give what they gave: exit status, output and files, byte for byte (`golden.py`)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from tests.contract.cases import ALL, COMMANDS


def test_this_machine_computes_as_the_one_that_made_the_golden_results(exact: bool) -> None:
    if not exact:
        pytest.skip("without PyBullet, or where NumPy or BLAS rounds otherwise, only the structure is compared")


def test_there_is_a_golden_result_for_each_case_and_no_other(past: dict[str, Any]) -> None:
    assert list(past["cases"]) == list(ALL)


SLOW = {"demo trace", "run signals", "run react", "run alter", "run dialogue", "run timed", "run unreachable"} | {
    "lab recorded",
    "lab localization",
}
"""Seconds each, of ways that others go as well."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(case.name, marks=pytest.mark.slow if case.name in SLOW else ()) for case in COMMANDS],
)
def test_a_command_gives_what_it_gave(name: str, unchanged: Callable[[str], None]) -> None:
    unchanged(name)


def test_a_wrong_command_line_is_answered_by_one_line(past: dict[str, Any]) -> None:
    wrong = {name: case["commands"][0] for name, case in past["cases"].items() if name.startswith("wrong: ")}
    assert len(wrong) > 25
    for name, said in wrong.items():
        assert (said["status"], len(said["errors"]), said["out"]) == (2, 1, []), name
        assert said["errors"][0].startswith("vrs: "), name
