"""`.ci/figures.py` brings a page's tables up to a run."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import pytest

PAGE = """# A paper
As measured:

| claim | source | expected | measured | 95 % | holds |
|---|---|---|---|---|---|
| b [m] | Fig. 2 | < 1 | 0.5 | 0.4 to 0.6 | yes |
| a | Fig. 1 | 3 | 3 |  | yes |

| run | error m |
|---|--:|
| 1 | 0.1 |

| another | table |
|---|---|
| stays | so |

| run | error m |
|---|--:|
| 3 | 0 |
"""
AFTER = """# A paper
As measured:

| claim | source | expected | measured | 95 % | holds |
|---|---|---|---|---|---|
| b [m] | Fig. 2 | < 1 | 1.235 | 1 to 1.5 | **no** |
| a | Fig. 1 | 3 | 3 |  | yes |

| run | error m |
|---|--:|
| 1 | 0.25 |
| 2 |  |

| another | table |
|---|---|
| stays | so |

| run | error m |
|---|--:|
| 3 | 0.5 |
"""


def brought_up(text: str, result: dict[str, Any]) -> str:
    path = Path(__file__).resolve().parents[1] / ".ci" / "figures.py"
    spec = importlib.util.spec_from_file_location("figures", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    found: str = module.brought_up(text, result)
    return found


def claim(name: str, source: str, expected: str, measured: float, holds: bool, *ends: float) -> dict[str, Any]:
    names = "claim", "source", "expected", "measured", "holds", "interval"
    return dict(zip(names, (name, source, expected, measured, holds, ends or None), strict=True))


RESULT = {
    "claims": [claim("a", "Fig. 1", "3", 3, True)],
    "timings": [claim("b [m]", "Fig. 2", "< 1", 1.23456, False, 1, 1.5)],
    "tables": [{"columns": ["run", "error m"], "rows": rows} for rows in ([[1, 0.25], [2, None]], [[3, 0.5]])],
}


def test_rows_are_found_by_their_claim_and_tables_by_their_head() -> None:
    assert brought_up(PAGE, RESULT) == AFTER
    assert brought_up(AFTER, RESULT) == AFTER


def test_what_is_no_claim_any_more_is_told() -> None:
    with pytest.raises(ValueError, match=r"no claims any more: b \[m\]"):
        brought_up(PAGE, {**RESULT, "timings": []})
