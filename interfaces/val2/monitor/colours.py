"""Colours of what is typed and what is said."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from prompt_toolkit.document import Document
from prompt_toolkit.formatted_text import StyleAndTextTuples
from prompt_toolkit.lexers import Lexer
from prompt_toolkit.styles import Style
from pygments.token import Token, _TokenType

from interfaces.val2.errors import ValError
from interfaces.val2.lexer import Val2Lexer
from interfaces.val2.monitor import commands
from interfaces.val2.monitor.monitor import TerminalMonitor

_CLASSES: Final = (
    (Token.Comment, "class:comment"),
    (Token.Keyword, "class:keyword"),
    (Token.Literal.String, "class:string"),
    (Token.Literal.Number, "class:number"),
    (Token.Name.Builtin, "class:function"),
    (Token.Name.Function, "class:function"),
    (Token.Operator.Word, "class:keyword"),
)


def style() -> Style:
    """The colours; those that a terminal can't show, it leaves out."""
    return Style.from_dict({
        "prompt": "bold",
        "running": "bold ansiyellow",
        "command": "bold ansicyan",
        "keyword": "ansicyan",
        "function": "ansiblue",
        "string": "ansigreen",
        "number": "ansimagenta",
        "comment": "italic ansibrightblack",
        "error": "ansired",
        "note": "ansibrightblack",
        "answer": "",
        "typed": "ansigreen",
        "hint": "noreverse ansibrightblack",
        "bottom-toolbar": "noreverse",
        "completion-menu.meta.completion": "bg:ansibrightblack ansiwhite",
    })  # fmt: skip


class LineLexer(Lexer):
    """Colours the line that is being typed: a command, or an instruction where one is wanted."""

    def __init__(self, monitor: TerminalMonitor) -> None:
        self._monitor = monitor
        self._lexer = Val2Lexer(stripnl=False, ensurenl=False)

    def lex_document(self, document: Document) -> Callable[[int], StyleAndTextTuples]:
        """The pieces of each line."""
        lines = document.lines

        def line(number: int) -> StyleAndTextTuples:
            return self.pieces(lines[number]) if number < len(lines) else []

        return line

    def pieces(self, text: str) -> StyleAndTextTuples:
        """A line in pieces, each with its class."""
        if self._monitor.edits:
            return self._coloured(text)
        if not self._monitor.takes_commands:
            return [("", text)]
        bare = text.lstrip()
        word = bare.split(None, 1)[0] if bare else ""
        try:
            commands.command(word)
        except ValError:
            return [("", text)]
        end = len(text) - len(bare) + len(word)
        return [("class:command", text[:end]), *self._coloured(text[end:])]

    def _coloured(self, text: str) -> StyleAndTextTuples:
        return [(_class(kind), piece) for kind, piece in self._lexer.get_tokens(text)]


def _class(kind: _TokenType) -> str:
    return next((name for family, name in _CLASSES if kind in family), "")
