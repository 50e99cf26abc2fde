"""VAL's monitor on pages: a terminal a page, over a WebSocket, at the controller that all terminals share."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
from collections import deque
from dataclasses import dataclass, field
from typing import Annotated, Any, Final

import msgspec
from msgspec import Meta
from starlette.routing import WebSocketRoute
from starlette.types import Receive, Scope, Send
from websockets.frames import Opcode

from interfaces.stream.access import Access
from interfaces.stream.limits import Bucket
from interfaces.stream.sockets import let_stay
from interfaces.val2.monitor.monitor import LONGEST, TerminalMonitor
from interfaces.val2.monitor.state import Expects, OutputText, Style
from interfaces.val2.rooms import TerminalRoom

PATH: Final = "/val"
"""Where pages open their terminals."""
MOST: Final = 16
"""Terminals at a time."""
LARGEST: Final = 16_384
"""Longest message of a page [B]."""
RATE: Final = 40.0
"""Messages a second that a page may send for long."""
BURST: Final = 120.0
"""Messages that it may send at once."""
UNREAD: Final = 262_144
"""Characters that may wait for a page; what is said beyond them is lost to it."""
WINDOW: Final = 65_536
"""Characters that a page is sent before it has shown those before."""
FRAME: Final = 8_192
"""Characters that are sent in one message, about."""
GREETING: Final = 5.0
"""Time for the first message [s]."""
BLOCKED: Final = 2.0
"""A page is cut off when a message has waited so long to be sent [s]."""
SUGGESTED: Final = 60
"""Words that are suggested at once."""
_POLICY, _TRY_AGAIN = 1008, 1013
_Text = Annotated[str, Meta(max_length=4 * LONGEST)]
_Key = Annotated[str, Meta(max_length=256)]


class PageHello(msgspec.Struct, frozen=True, tag="hello"):
    """The page's first message: its token, and the session by which it commands."""

    token: _Key | None = None
    session: _Key = ""


class Who(msgspec.Struct, frozen=True, tag="who"):
    """The page has another session."""

    session: _Key


class TypedLines(msgspec.Struct, frozen=True, tag="lines"):
    """What was typed."""

    lines: Annotated[list[_Text], Meta(max_length=256)]


class Interrupt(msgspec.Struct, frozen=True, tag="interrupt"):
    """Ctrl-C."""


class Complete(msgspec.Struct, frozen=True, tag="complete"):
    """Asks what may follow."""

    text: _Text


class Columns(msgspec.Struct, frozen=True, tag="columns"):
    """So many characters fit into a line of it."""

    columns: Annotated[int, Meta(ge=1, le=10_000)]


class ShownCharacters(msgspec.Struct, frozen=True, tag="shown"):
    """So many characters have been shown in all."""

    size: Annotated[int, Meta(ge=0, le=2**53)]


_read: Final = msgspec.json.Decoder(
    PageHello | Who | TypedLines | Interrupt | Complete | Columns | ShownCharacters
).decode


@dataclass(slots=True, eq=False)
class PageTerminal:
    """A page's terminal: messages in, messages out."""

    token: str | None = None
    session: str = ""
    """Of the page, by which it commands; empty before it's known."""
    closing: tuple[int, str] | None = None
    """Code and reason with which the connection is to be closed."""
    monitor: TerminalMonitor | None = None
    greeted: bool = False
    _output: deque[OutputText] = field(default_factory=deque)
    waiting: int = 0
    """Characters that wait to be sent."""
    _sent: int = 0
    _shown: int = 0
    lost: bool = False
    """Whether output was lost since any was queued."""
    _answers: deque[dict[str, Any]] = field(default_factory=lambda: deque(maxlen=32))
    _prompt: str | None = None
    """The prompt that the page was told last; None where it's to be told again."""
    wake: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when there may be something to send."""

    def begin(self, monitor: TerminalMonitor, *, now: float) -> None:
        """Let a monitor speak and listen."""
        self.monitor = monitor
        files = monitor.state.files.offered()
        self._answers.append({"type": "ready", "files": files, "barred": bool(monitor.read_only)})
        monitor.start(now=now)

    def receive(self, data: str | bytes, *, now: float) -> None:
        """Take a message of the page; one that can't be read ends the connection.

        Args:
            data: What has come.
            now: Session time [s].
        """
        if len(data) > LARGEST:
            self.close(_POLICY, f"at most {LARGEST} bytes a message")
            return
        try:
            message = _read(data)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            self.close(_POLICY, f"not a message of a terminal: {error}")
            return
        if isinstance(message, PageHello) == self.greeted:
            self.close(_POLICY, "hello comes first, and once")
            return
        monitor = self.monitor
        match message:
            case PageHello(token, session):
                self.token, self.session, self.greeted = token, session, True
            case Who(session):
                self.session = session
                if monitor is not None:
                    monitor.session = session
            case ShownCharacters(size):
                self._shown = max(self._shown, min(size, self._sent))
            case Complete(text) if monitor is not None:
                fragment, words = monitor.suggestions(text[:LONGEST])
                listed = [one.word for one in words[:SUGGESTED]]
                self._answers.append({"type": "completed", "text": text, "fragment": fragment, "words": listed})
            case Columns(columns) if monitor is not None:
                monitor.fit(columns)
            case Interrupt() if monitor is not None:
                self._prompt = None
                monitor.interrupt(now=now)
            case TypedLines(lines) if monitor is not None:
                self._prompt = None
                for line in lines:
                    monitor.line(line, now=now)
                    self._collect_output(monitor)

    def advance(self, *, now: float) -> None:
        """Do what is due."""
        if self.monitor is not None:
            self.monitor.advance(now=now)
            self._collect_output(self.monitor)
            if self.monitor.done and not self._output:
                self.close(1000, "the monitor was left")
            self.wake.set()

    def _collect_output(self, monitor: TerminalMonitor) -> None:
        """Take what was said, as far as there's room."""
        for piece in monitor.output():
            if self.waiting + len(piece.text) > UNREAD:
                self.lost = True
                continue
            if self.lost:
                self.lost = False
                self._put(OutputText("\n*Output lost* it came faster than it could be shown\n", Style.ERROR))
            self._put(piece)

    def _put(self, piece: OutputText) -> None:
        self.waiting += len(piece.text)
        last = self._output[-1] if self._output else None
        if last is not None and last.style is piece.style and len(last.text) + len(piece.text) <= FRAME:
            self._output[-1] = OutputText(last.text + piece.text, piece.style)
        else:
            self._output.append(piece)

    def next_deadline(self) -> float:
        """When `advance` has something to do [s]; infinity for not before a message comes."""
        return math.inf if self.monitor is None else self.monitor.next_deadline()

    def outgoing(self) -> bytes | None:
        """The next message for the page; None while there's none, or the page hasn't shown those before."""
        if self._answers:
            return json.dumps(self._answers.popleft()).encode()
        if self.monitor is None or self._sent - self._shown > WINDOW:
            return None
        prompt = self.monitor.prompt
        if not self._output and prompt == self._prompt:
            return None
        pieces, size = [], 0
        while self._output and size < FRAME:
            piece = self._output.popleft()
            text, style = piece.text, piece.style
            if len(text) > FRAME:
                self._output.appendleft(OutputText(text[FRAME:], style))
            size += len(text[:FRAME])
            pieces.append((text[:FRAME], style.value))
        self.waiting -= size
        self._sent += size
        self._prompt = prompt
        message = {
            "type": "said", "pieces": pieces, "prompt": prompt, "size": self._sent,
            "commands": self.monitor.expects is Expects.COMMAND,
        }  # fmt: skip
        return json.dumps(message).encode()

    def close(self, code: int, reason: str) -> None:
        """End it, with a reason for people."""
        if self.closing is None:
            self.closing = code, reason

    def leave(self, *, now: float) -> None:
        """The page is gone: what its terminal ran is stopped."""
        if self.monitor is not None:
            self.monitor.leave(now=now)


class PageTerminalServer:
    """Terminals of pages in a room; its route goes into an application."""

    def __init__(self, room: TerminalRoom, access: Access) -> None:
        """Begin with nobody.

        Args:
            room: What all terminals are at.
            access: What the token of a page opens; without any tokens, whoever comes is an operator.
        """
        self._room, self._access = room, access
        self._terminals: set[PageTerminal] = set()

    @property
    def route(self) -> WebSocketRoute:
        """Where pages come."""
        return WebSocketRoute(PATH, self)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one page, until it goes."""
        await receive()
        await send({"type": "websocket.accept"})
        terminal, met = PageTerminal(), asyncio.Event()
        self._terminals.add(terminal)
        writing = asyncio.create_task(self._write(terminal, scope["state"]["socket"], send))
        greeting = asyncio.create_task(self._greet(terminal, met, scope))
        clock = asyncio.get_running_loop().time
        allowed = Bucket(RATE, BURST, clock())
        try:
            while (message := await receive())["type"] != "websocket.disconnect":
                if not allowed.take(clock()):
                    terminal.close(_POLICY, f"at most {RATE:g} messages a second")
                elif terminal.closing is None:
                    text = message.get("text")
                    terminal.receive(
                        message.get("bytes") or b"" if text is None else text, now=self._room.clock.now()
                    )
                if terminal.greeted or terminal.closing is not None:
                    met.set()
                terminal.wake.set()
                self._room.soon()
        finally:
            greeting.cancel()
            self._terminals.discard(terminal)
            self._room.leave(terminal)
            writing.cancel()
            await asyncio.wait([writing, greeting])

    async def _greet(self, terminal: PageTerminal, met: asyncio.Event, scope: Scope) -> None:
        """Give a page its monitor, once it has said who it is."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(GREETING):
                await met.wait()
        if not terminal.greeted:
            terminal.close(_POLICY, f"hello must come within {GREETING:g} s")
        await self._room.ready()
        if terminal.closing is None:
            self._begin(terminal, scope)
        terminal.wake.set()

    def _begin(self, terminal: PageTerminal, scope: Scope) -> None:
        room = self._room
        address = str((scope.get("client") or ("",))[0])
        found = room.monitor(self._access, terminal.token, terminal.session, address=address)
        if found is None:
            terminal.close(_POLICY, "this token opens no terminal")
        elif sum(other.monitor is not None for other in self._terminals) >= MOST:
            terminal.close(_TRY_AGAIN, f"there are {MOST} terminals already: close one elsewhere")
        else:
            monitor, counts = found
            let_stay(scope, known=True, counts=counts)
            terminal.begin(monitor, now=room.clock.now())
            room.join(terminal)

    async def _write(self, terminal: PageTerminal, socket: Any, send: Send) -> None:
        """Send what there is; a page that takes nothing is cut off."""
        try:
            while terminal.closing is None:
                await terminal.wake.wait()
                terminal.wake.clear()
                while (data := terminal.outgoing()) is not None:
                    async with asyncio.timeout(BLOCKED):
                        await socket.put(data, Opcode.TEXT)
            code, reason = terminal.closing
            async with asyncio.timeout(BLOCKED):
                await send({"type": "websocket.close", "code": code, "reason": _short(reason)})
        except (TimeoutError, OSError):
            socket.abort()


def _short(reason: str) -> str:
    """As much of a reason as a closing frame holds."""
    return reason.encode()[:120].decode(errors="ignore")
