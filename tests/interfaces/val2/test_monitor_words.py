"""Words at the monitor: which commands and switches there are, and how far they may be abbreviated."""

from __future__ import annotations

import re

import pytest

from interfaces.val2.errors import ValError
from interfaces.val2.monitor import commands
from interfaces.val2.monitor.commands import COMMANDS, command
from interfaces.val2.monitor.state import unique

from .sitting import HELLO


def test_every_command_has_a_handler_and_a_line_of_help():
    assert {one.name for one in COMMANDS.values() if one.act is None} == {"EXIT", "QUIT"}
    for one in COMMANDS.values():
        assert one.help.endswith((".", ",,10")), one.name
        assert len(one.help) <= 79, one.name
        assert all(len(usage) <= 60 for usage in one.usage), one.name


@pytest.mark.parametrize(
    ("word", "name"),
    [("cali", "CALIBRATE"), ("CA", "CALIBRATE"), ("ex", "EXECUTE"), ("exec", "EXECUTE"), ("a", "ABORT"),
     ("do", "DO"), ("WHERE", "WHERE"), ("wh", "WHERE"), ("sto", "STORE"), ("STOREL", "STOREL"), ("del", "DELETE"),
     ("En", "ENABLE"),
     ("pan", "PANIC"), ("proc", "PROCEED"), ("retr", "RETRY"), ("n", "NEXT"), ("x", "XSTEP"), ("status", "STATUS")],
)  # fmt: skip
def test_commands_are_abbreviated_to_a_unique_beginning(word, name):
    assert command(word).name == name


@pytest.mark.parametrize("word", ["l", "LIST", "re", "st", "di", "qui", "exi"])
def test_what_several_begin_with_or_may_not_be_abbreviated_is_refused(word):
    with pytest.raises(ValError, match=r"^\*(Ambiguous|Invalid) command\*"):
        command(word)


def test_every_unique_beginning_is_taken():
    names = [one.name for one in COMMANDS.values() if one.act is not None]
    for name in names:
        for end in range(1, len(name) + 1):
            others = [other for other in names if other.startswith(name[:end]) and other != name]
            if not others:
                assert command(name[:end].lower()).name == name


def test_switches_are_abbreviated_too(sitting):
    sitting.type("DISABLE po")
    assert not sitting.controller.switches["POWER"]
    sitting.type("en PO, dry")
    assert sitting.controller.switches["POWER"]
    assert sitting.controller.switches["DRY.RUN"]
    assert "*Invalid switch*" in sitting.type("ENABLE NONSENSE")
    with pytest.raises(ValError, match="Ambiguous"):
        unique("A", ["AB", "AC"], "word")


def test_an_instruction_or_an_assignment_at_the_prompt_says_what_to_type(sitting):
    assert "DO MOVE p" in sitting.type("MOVE p")
    assert "DO x = 3" in sitting.type("x = 3")
    assert "did you mean" in sitting.type("WHER3")
    assert sitting.shown.startswith("*Invalid command*")


def test_every_word_can_be_explained(sitting):
    for name in COMMANDS:
        assert next(commands.explained(name)).help
    assert "behind a location" in sitting.type("HELP APPRO")
    assert "DRY.RUN" in sitting.type("HELP dry")
    assert sitting.type("HELP xyzzy").startswith("*Unknown word*")
    for line in sitting.type("HELP").splitlines():
        assert len(line) <= 79


@pytest.mark.parametrize("row", [row for row in COMMANDS.values() if row.act is not None], ids=lambda row: row.name)
def test_each_row_has_a_wrong_use_words_that_may_follow_and_its_short_forms(sitting, row):
    sitting.shown = ""
    assert re.fullmatch(r"\*[A-Z][a-z -]+\* .+\n", sitting.line(f"{row.name} )"))
    assert sitting.monitor.prompt == "."
    sitting.type("ENABLE POWER", *HELLO, "DO x = 1", "DO SET p = NULL", 'DO $s = "a"', "STORE f")
    _, words = sitting.monitor.suggestions(f"{row.name} ")
    takes_words = row.forms not in {"", "| n", "| task", "| channel | channel=value", "| port | port=value"} or (
        row.more and row.name == "DIRECTORY"
    )
    assert bool(words) == bool(takes_words)
    for short in row.short.split():
        assert command(short) is row
