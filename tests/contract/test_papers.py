"""Each paper at its smallest size gives the claims and figures that it gave."""

from __future__ import annotations

import os
from collections.abc import Callable

import pytest

from tests.contract.cases import PAPERS, SLOW


@pytest.mark.parametrize("name", [case.name for case in PAPERS])
def test_a_paper_gives_what_it_gave(name: str, unchanged: Callable[[str], None]) -> None:
    if name.removeprefix("reproduce ") in SLOW and "VRS_CONTRACT_SLOW" not in os.environ:
        pytest.skip("make contract measures it")
    unchanged(name)
