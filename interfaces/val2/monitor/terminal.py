"""The monitor at a terminal: history, completion, help on every word, colours."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Final

from prompt_toolkit import PromptSession, print_formatted_text
from prompt_toolkit.application import run_in_terminal
from prompt_toolkit.auto_suggest import AutoSuggestFromHistory
from prompt_toolkit.completion import CompleteEvent, Completer, Completion
from prompt_toolkit.document import Document
from prompt_toolkit.formatted_text import FormattedText, StyleAndTextTuples
from prompt_toolkit.history import FileHistory, History, InMemoryHistory
from prompt_toolkit.input.vt100 import Vt100Input
from prompt_toolkit.key_binding import KeyBindings, KeyPressEvent
from prompt_toolkit.lexers import Lexer
from prompt_toolkit.styles import Style
from prompt_toolkit.styles.pygments import pygments_token_to_classname

from interfaces.timer import Turning
from interfaces.val2.lexer import Val2Lexer
from interfaces.val2.monitor.commands import command_named, hint
from interfaces.val2.monitor.monitor import TerminalMonitor
from interfaces.val2.monitor.state import Expects, OutputText
from vrs.clock import Clock

if TYPE_CHECKING:
    from prompt_toolkit.input import Input
    from prompt_toolkit.output import Output


def style() -> Style:
    """The colours; those that a terminal can't show, it leaves out."""
    return Style.from_dict({
        "prompt": "bold",
        "running": "bold ansiyellow",
        "command": "bold ansicyan",
        "pygments.keyword": "ansicyan",
        "pygments.operator.word": "ansicyan",
        "pygments.name.builtin": "ansiblue",
        "pygments.name.function": "ansiblue",
        "pygments.literal.string": "ansigreen",
        "pygments.literal.number": "ansimagenta",
        "pygments.comment": "italic ansibrightblack",
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
        lines = [self.pieces(line) for line in document.lines]
        return lambda number: lines[number] if number < len(lines) else []

    def pieces(self, text: str) -> StyleAndTextTuples:
        """A line in pieces, each with its class."""
        if self._monitor.expects is Expects.STEP:
            return self._coloured(text)
        bare = text.lstrip()
        word = bare.split(None, 1)[0] if bare else ""
        if self._monitor.expects is Expects.ANSWER or command_named(word) is None:
            return [("", text)]
        end = len(text) - len(bare) + len(word)
        return [("class:command", text[:end]), *self._coloured(text[end:])]

    def _coloured(self, text: str) -> StyleAndTextTuples:
        return [
            (f"class:{pygments_token_to_classname(kind)}", piece) for kind, piece in self._lexer.get_tokens(text)
        ]


_ROWS: Final = 8
"""Lines that are kept free for the menu."""


class Keyboard(Vt100Input):
    """A terminal's keys, none of which is lost.

    While something is written, prompt_toolkit gives the terminal its line mode back. A Ctrl-D that falls into that
    moment comes out of it as a null character, and a Ctrl-C as a signal.
    """

    def cooked_mode(self) -> AbstractContextManager[None]:
        """Stay in raw mode."""
        return self.raw_mode()


class _Completer(Completer):
    """Completes by `suggestions`."""

    def __init__(self, monitor: TerminalMonitor) -> None:
        self._monitor = monitor

    def get_completions(self, document: Document, complete_event: CompleteEvent) -> Iterable[Completion]:
        """What may complete the line."""
        if not complete_event.completion_requested and not document.text_before_cursor.strip():
            return
        fragment, found = self._monitor.suggestions(document.text_before_cursor)
        for one in found:
            yield Completion(one.word, -len(fragment), display_meta=one.help)


class Terminal:
    """A monitor at a terminal."""

    def __init__(
        self,
        monitor: TerminalMonitor,
        clock: Clock,
        *,
        history: Path | None = None,
        source: Input | None = None,
        sink: Output | None = None,
    ) -> None:
        """Begin; `run` reads.

        Args:
            monitor: Whose terminal it is.
            clock: Session time.
            history: Where lines are kept from one session to the next; None for nowhere.
            source: What is read; None for standard input.
            sink: What is written; None for standard output.
        """
        self._monitor, self._clock = monitor, clock
        self._said: list[OutputText] = []
        self._partial = ""
        """What a program typed without ending the line; it's shown before the prompt."""
        self._shown = ""
        self._turning = Turning(clock, self._turn)
        self._session: PromptSession[str] = PromptSession(
            message=self._message,
            lexer=LineLexer(monitor),
            style=style(),
            completer=_Completer(monitor),
            complete_while_typing=True,
            auto_suggest=AutoSuggestFromHistory(),
            bottom_toolbar=self._toolbar,
            history=_history(history),
            key_bindings=self._keys(),
            reserve_space_for_menu=_ROWS,
            input=Keyboard(sys.stdin) if source is None else source,
            output=sink,
        )

    async def run(self) -> None:
        """Until QUIT or the end of the input, and of what is under way then."""
        self._monitor.start(now=self._clock.now())
        self._turning.start()
        try:
            # Between two lines, too: what is typed then isn't to be shown twice.
            with self._session.input.raw_mode():
                while not self._monitor.done:
                    self._write()
                    await self._next()
                self._write()
        finally:
            self._turning.stop()
            self._monitor.leave(now=self._clock.now())

    async def _next(self) -> None:
        """Take a line."""
        self._monitor.fit(self._session.output.get_size().columns)
        try:
            text = await self._session.prompt_async()
        except EOFError:
            self._monitor.leave(now=self._clock.now())
        except KeyboardInterrupt:
            self._monitor.interrupt(now=self._clock.now())
        else:
            self._partial = ""
            self._monitor.line(text, now=self._clock.now())
        self._turn(self._clock.now())

    def _turn(self, now: float) -> float:
        monitor, app = self._monitor, self._session.app
        monitor.advance(now=now)
        self._said += monitor.output()
        if app.is_running:
            if monitor.done:
                if not app.is_done:
                    app.exit(result="")
            elif self._said:
                asyncio.ensure_future(run_in_terminal(self._write))  # noqa: RUF006 - the application keeps it
            elif self._partial + monitor.prompt != self._shown:
                app.invalidate()
        return monitor.next_deadline()

    def _write(self) -> None:
        """Write whole lines of what was said; the rest stands before the prompt."""
        said = [*self._said, *self._monitor.output()]
        pieces = [("class:typed", self._partial), *((f"class:{piece.style}", piece.text) for piece in said)]
        self._said, self._partial = [], ""
        while pieces and not pieces[-1][1].endswith("\n"):
            kind, text = pieces.pop()
            whole, newline, rest = text.rpartition("\n")
            self._partial = rest + self._partial
            if newline:
                pieces.append((kind, whole + newline))
        if pieces:
            output = self._session.app.output
            print_formatted_text(FormattedText(pieces), end="", style=style(), output=output)

    def _message(self) -> StyleAndTextTuples:
        prompt = self._monitor.prompt
        self._shown = self._partial + prompt
        kind = "running" if prompt == "*" else "prompt"
        between = "\n" if self._partial and len(prompt) == 1 else ""
        return [("class:typed", self._partial + between), (f"class:{kind}", prompt)]

    def _toolbar(self) -> StyleAndTextTuples:
        if self._monitor.expects is Expects.ANSWER:
            return [("", " ")]
        text = self._session.default_buffer.document.text_before_cursor
        said = hint(text, program=self._monitor.expects is Expects.STEP)
        return [("class:hint", said or "Tab completes, HELP explains, Ctrl-C is ABORT, Ctrl-D leaves")]

    def _keys(self) -> KeyBindings:
        keys = KeyBindings()

        @keys.add("c-c")
        def _interrupt(event: KeyPressEvent) -> None:
            buffer = event.app.current_buffer
            if self._monitor.busy or not buffer.text:
                self._monitor.interrupt(now=self._clock.now())
                self._turning.soon()
            buffer.reset()

        @keys.add("c-d")
        def _end(event: KeyPressEvent) -> None:
            buffer = event.app.current_buffer
            if buffer.text:
                buffer.delete()
            else:
                self._monitor.end_of_input(now=self._clock.now())
                self._turning.soon()

        return keys


def _history(path: Path | None) -> History:
    """Lines of earlier sessions; none where they can't be kept."""
    if path is None:
        return InMemoryHistory()
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a"):
            return FileHistory(str(path))
    return InMemoryHistory()
