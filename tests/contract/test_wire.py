"""The wire: every kind of message has the fields it had, what is refused is refused as it was (`session.py`)."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests.contract.golden import WIRE
from tests.contract.golden import differences as changes
from tests.contract.session import sessions
from tests.contract.shapes import differences, shape

GOLDEN: dict[str, Any] = json.loads(WIRE.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What the sessions find now."""
    return sessions(tmp_path_factory.mktemp("wire"))


@pytest.mark.parametrize("session", GOLDEN)
def test_each_role_is_told_messages_of_the_same_shape(session: str, found: dict[str, Any]) -> None:
    now, past = found[session]["shapes"], GOLDEN[session]["shapes"]
    assert {role: set(kinds) for role, kinds in now.items()} == {role: set(kinds) for role, kinds in past.items()}
    wrong = {
        f"{role}: {kind}": differences(one, past[role][kind])
        for role, kinds in now.items()
        for kind, one in kinds.items()
    }
    assert {what: lines for what, lines in wrong.items() if lines} == {}


@pytest.mark.parametrize("session", GOLDEN)
def test_what_is_asked_is_answered_as_it_was(session: str, found: dict[str, Any]) -> None:
    now, past = ({key: told for key, told in one[session].items() if key != "shapes"} for one in (found, GOLDEN))
    assert list(changes(now, past)) == []


def test_a_field_that_is_new_missing_or_of_another_kind_is_seen() -> None:
    golden = shape([{"a": 1, "b": [{"c": 1.5}]}, {"b": []}])
    assert golden == {"": ["map"], "a": ["absent", "integer"], "b": ["array"], "b[]": ["map"], "b[].c": ["number"]}
    assert differences(shape([{"b": [{"c": 2.5}]}]), golden) == []
    assert differences(shape([{"b": [{"c": "x"}]}]), golden) == ["b[].c is text, not number"]
    assert differences(shape([{"b": [{"d": 1.5}]}]), golden) == ["b[].d is new", "b[].c is missing"]
    assert differences(shape([{"a": 1}]), golden) == ["b is missing"]
