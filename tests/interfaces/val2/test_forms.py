"""The tables of the language: sound in themselves, and the reference tells the same."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from interfaces.val2 import expressions, forms
from interfaces.val2.errors import ValError
from interfaces.val2.functions import OPERATORS
from interfaces.val2.parser import parse_expression, parse_line

REFERENCE = (Path(__file__).parents[3] / "docs" / "val2.md").read_text()
ROWS = [*forms.INSTRUCTIONS.values(), *forms.FUNCTIONS.values()]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.usage)
def test_the_reference_has_every_word(row):
    usage, said = row.usage.replace("|", "\\|"), row.help.replace("|", "\\|")
    assert re.search(
        rf"^{re.escape(f'| `{usage}` | {said} | ')}[^|]+ \| {re.escape(row.origin)} \|$", REFERENCE, re.M
    )


def test_the_reference_has_switches_parameters_and_what_is_passed_over():
    for switch in forms.SWITCHES.values():
        assert (
            f"| `{switch.name}` | {'on' if switch.default else 'off'} | {switch.help} | {switch.origin} |"
            in REFERENCE
        )
    for one in forms.PARAMETERS.values():
        assert (
            f"| `{one.name}` | {one.default:g} {one.unit} | {one.low:g} to {one.high:g} {one.unit} |" in REFERENCE
        )
    for word in forms.IGNORED:
        assert f"`{word}`" in REFERENCE


def test_abbreviations_are_of_one_instruction_alone():
    words = [*(name for name, row in forms.INSTRUCTIONS.items() if "whole" not in row.tags), *forms.IGNORED]
    for short, name in forms.ABBREVIATIONS.items():
        assert [word for word in words if word.startswith(short)] == [name]
        assert short != name


def test_no_word_is_two_things():
    assert not forms.IGNORED & forms.INSTRUCTIONS.keys()
    assert not forms.OPERATORS.keys() & forms.FUNCTIONS.keys()
    assert forms.OPERATORS.keys() - {"NOT", "COM"} <= {
        row.name for row in OPERATORS.values() if len(row.slots) == 2
    }
    assert set(forms.ALIASES.values()) <= forms.FUNCTIONS.keys()


def test_functions_that_are_listed_are_those_that_are_made():
    assert {row.name for row in forms.FUNCTIONS.values() if row.act is None} == expressions.OF_NAMES.keys()
    assert not any(row.act is None for row in forms.INSTRUCTIONS.values())


@pytest.mark.parametrize("row", forms.INSTRUCTIONS.values(), ids=lambda row: row.name)
def test_every_instruction_is_known_to_the_parser(row):
    known = True
    try:
        known = parse_line(row.name).statement.passed is None
    except ValError as error:
        known = error.what != "Undefined instruction"
    assert known


@pytest.mark.parametrize("row", forms.FUNCTIONS.values(), ids=lambda row: row.name)
def test_functions_count_their_arguments(row):
    least = sum(slot.required for slot in row.slots)
    if least:
        with pytest.raises(ValError, match="Missing argument"):
            parse_expression(f"{row.name}({', '.join('x' * (least - 1))})")
    if not row.repeats:
        with pytest.raises(ValError, match="Too many arguments"):
            parse_expression(f"{row.name}({', '.join('x' * (len(row.slots) + 1))})")
