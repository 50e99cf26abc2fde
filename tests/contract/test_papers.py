"""Each paper at its smallest size gives the claims and figures that it gave."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.contract.cases import PAPERS


@pytest.mark.slow
@pytest.mark.parametrize("name", [case.name for case in PAPERS])
def test_a_paper_gives_what_it_gave(name: str, unchanged: Callable[[str], None]) -> None:
    unchanged(name)
