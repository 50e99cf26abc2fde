"""Colours: what words are, and that nothing is lost."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from pygments.lexers import load_lexer_from_file
from pygments.token import Comment, Error, Keyword, Name, Number, Operator, String, Whitespace

from interfaces.val2 import lexer as module
from interfaces.val2.lexer import Val2Lexer

FILES = sorted(Path(__file__).parent.glob("programs/*.v2"))


def tokens(text):
    lexer = Val2Lexer(stripnl=False, ensurenl=False)
    return [(token, value) for _, token, value in lexer.get_tokens_unprocessed(text)]


def shown(text):
    return [(token, value) for token, value in tokens(text) if token is not Whitespace]


def test_what_words_are():
    assert shown("100 MOVE SHIFT(p BY 1):HERE ;x") == [
        (Name.Label, "100"),
        (Keyword, "MOVE"),
        (Name.Builtin, "SHIFT"),
        (tokens("x(")[1][0], "("),
        (Name.Variable, "p"),
        (Keyword.Reserved, "BY"),
        (Number, "1"),
        (tokens("x)")[1][0], ")"),
        (tokens("x:")[1][0], ":"),
        (Name.Constant, "HERE"),
        (Comment.Single, ";x"),
    ]
    assert shown("IF a AND NOT $b THEN")[2::2] == [(Operator.Word, "AND"), (Name.Variable, "$b")]
    assert shown('TYPE /F8.2, x/2, "a;b"')[1] == (String.Escape, "/F8.2")
    assert (Operator, "/") in shown("TYPE x/2")
    assert shown("speed = 3")[0] == (Name.Variable, "speed")
    assert shown("value[1] = 3")[0] == (Name.Variable, "value")
    assert shown(" .program a")[0][0] is Keyword.Declaration
    assert shown("WINDOW 3")[0] == (Keyword.Pseudo, "WINDOW")
    assert shown("ENABLE CP") == [(Keyword, "ENABLE"), (Name.Attribute, "CP")]
    assert shown("REMARK isn't \"so") == [(Comment.Single, "REMARK isn't \"so")]
    assert shown('TYPE "a')[-1] == (Error, '"a')
    assert shown("MOVE a\r\nBREAK") == [(Keyword, "MOVE"), (Name.Variable, "a"), (Keyword, "BREAK")]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_programs_have_no_errors_and_nothing_is_lost(path):
    text = path.read_bytes().decode()
    found = tokens(text)
    assert "".join(value for _, value in found) == text
    assert [value for token, value in found if token is Error] == []


def test_any_text_has_colours():
    rng = random.Random(5)
    text = "\n".join(path.read_text() for path in FILES)
    for _ in range(300):
        part = list(text[(i := rng.randrange(len(text))) : i + 80])
        rng.shuffle(part)
        assert "".join(value for _, value in tokens("".join(part))) == "".join(part)


def test_pygments_can_load_it():
    assert isinstance(load_lexer_from_file(module.__file__, "Val2Lexer"), Val2Lexer.__mro__[1])
    assert {"val2", "vplus"} <= set(Val2Lexer.aliases)
