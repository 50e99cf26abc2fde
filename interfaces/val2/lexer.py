"""Colours of programs: a Pygments lexer, for the console and for documents."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import ClassVar, Final

from pygments.lexer import RegexLexer, bygroups, default
from pygments.token import (
    Comment,
    Error,
    Keyword,
    Name,
    Number,
    Operator,
    Punctuation,
    String,
    Whitespace,
    _TokenType,
)

from interfaces.val2 import forms

_WORD: Final = r"[#$]?[A-Za-z][A-Za-z0-9_.]*"


class Val2Lexer(RegexLexer):  # type: ignore[misc]
    """Programs, files and single lines of VAL, VAL-II and V+."""

    name = "VAL-II"
    aliases: ClassVar = ["val2", "val", "vplus"]
    filenames: ClassVar = ["*.v2", "*.val", "*.pg"]
    mimetypes: ClassVar = ["text/x-val2"]
    flags = re.MULTILINE

    tokens: ClassVar = {
        "root": [
            (r"^[ \t]*\.[A-Za-z]+(?![A-Za-z0-9_.])", Keyword.Declaration, "line"),
            (r"^([ \t]*)([0-9]+\.\??)(?=[ \t\r\n]|$)", bygroups(Whitespace, Comment.Special)),
            (r"([ \t]*)([0-9]+)(?=[ \t;\r\n]|$)", bygroups(Whitespace, Name.Label)),
            (r"[ \t]+", Whitespace),
            (r"\r\n|\r|\n", Whitespace),
            (r"(?i:REMARK)(?![A-Za-z0-9_.])[^\r\n]*", Comment.Single),
            (rf"({_WORD})(?=[ \t]*(?:\[|=(?!=)))", Name.Variable, "line"),
            (_WORD, Keyword, "line"),
            default("line"),
        ],
        "line": [
            (r"\r\n|\r|\n", Whitespace, "#pop"),
            (r"[ \t\f\v\xa0]+", Whitespace),
            (r"(?:;|#(?![A-Za-z]))[^\r\n]*", Comment.Single),
            (r'"[^"\r\n]*"', String.Double),
            (r'"[^\r\n]*', Error),
            (r"(?<=[,( \t])/[A-Za-z][0-9]*(?:\.[0-9]+)?(?=[ \t]*[,)\r\n;]|$)", String.Escape),
            (r"(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[Ee][+-]?[0-9]+)?", Number),
            (r"\^[Bb][01]+|\^[Oo][0-7]+|\^[Hh][0-9A-Fa-f]+", Number),
            (_WORD, Name),
            (r"\*\*|==|<>|<=|>=|=<|=>|[-+*/^<>=]", Operator),
            (r"[\[\](),:]", Punctuation),
            (r".", Error),
        ],
    }

    def get_tokens_unprocessed(
        self, text: str, stack: tuple[str, ...] = ("root",)
    ) -> Iterator[tuple[int, _TokenType, str]]:
        """The tokens of a text, each with where it begins; names by the tables of the language."""
        for index, token, value in super().get_tokens_unprocessed(text, stack):
            if token in (Name, Keyword):
                yield index, _kind(value.upper(), token), value
            else:
                yield index, token, value


def _kind(word: str, token: _TokenType) -> _TokenType:
    """What a word is: at the beginning of a line (`Keyword`), or within one (`Name`)."""
    if token is Keyword:
        if word in forms.INSTRUCTIONS:
            return Keyword
        return Keyword.Pseudo if word in forms.IGNORED else Name
    if word in forms.OPERATORS:
        return Operator.Word
    if word in forms.FUNCTIONS or word in forms.ALIASES:
        return Name.Constant if word in forms.CONSTANTS else Name.Builtin
    if word in forms.WORDS or word in forms.SWITCHES or word in forms.PARAMETERS:
        return Keyword.Reserved if word in forms.WORDS else Name.Attribute
    return Name.Variable
