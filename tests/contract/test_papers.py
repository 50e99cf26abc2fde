"""Each paper at its smallest size gives the claims and figures that it gave: `make contract`, not `make test`."""

from __future__ import annotations

import os
from collections.abc import Callable

import pytest

from tests.contract.cases import PAPERS


@pytest.mark.skipif(
    "VRS_CONTRACT_SLOW" not in os.environ, reason="most of a minute each: make contract measures it"
)
@pytest.mark.parametrize("name", [case.name for case in PAPERS])
def test_a_paper_gives_what_it_gave(name: str, unchanged: Callable[[str], None]) -> None:
    unchanged(name)
