"""The monitor of one terminal: lines in, what is said and the prompt out."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import Final

from interfaces.val2 import context
from interfaces.val2.errors import ValError
from interfaces.val2.monitor import commands, settings
from interfaces.val2.monitor.control import SharedOperator, Switchboard
from interfaces.val2.monitor.editor import Editing
from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.handlers import HANDLERS
from interfaces.val2.monitor.locations import Teach, WatchDialogue
from interfaces.val2.monitor.state import Dialogue, Said, Style, TerminalState, split_word
from vrs.errors import VrsError

LONGEST: Final = 2048
"""Longest line [characters]."""
OVERLONG: Final = "\x00"
"""What stands for a line that was too long to be read."""
WAITING: Final = 64
"""Lines that may wait until an instruction is done."""
ASKING: Final = 0.02
"""Time between two looks whether control was given [s]."""
_URGENT: Final = frozenset({"ABORT", "PANIC"})
"""What doesn't wait."""


class TerminalMonitor:
    """One terminal's monitor. Errors are said; they never end it."""

    def __init__(
        self,
        board: Switchboard,
        files: Files,
        version: str,
        *,
        patient: bool = False,
        barred: str = "",
        person: SharedOperator | None = None,
    ) -> None:
        """Begin; `start` greets.

        Args:
            board: Where the controller is, and others perhaps.
            files: What LOAD and STORE reach.
            version: What ID says.
            patient: Whether lines that can't be done while a program runs wait for its end, as they do where all
                come at once; else they are errors.
            barred: Why this terminal only looks, whoever is in control.
            person: Who sits here, where they command by a session of their own, too: control is theirs, and isn't
                asked for before a command needs it.
        """
        self._person = person
        self._board, self._patient, self.barred = board, patient, barred
        self.desk = TerminalState(board.controller, files, version)
        self._dialogue: Dialogue | None = None
        self._asked: str | None = None
        self._waiting: deque[str] = deque()
        self._greeting = False
        self._ended = False
        self._due = math.inf
        self._claimed = ("", "")
        """A command's name, and its line that waits for control."""
        self._trouble, self._looked = "", -math.inf
        self.done = False
        """Whether it's over: QUIT, or the end of the input."""

    @property
    def prompt(self) -> str:
        """What is asked; empty while nothing is, since an instruction is being carried out."""
        if self.done:
            return ""
        if self._dialogue is not None and not self._busy:
            return self._dialogue.prompt
        if self._asked is not None:
            return self._asked
        if self._busy:
            return ""
        return "*" if self.desk.controller.running else "."

    @property
    def _mine(self) -> bool:
        return self._board.holder is self

    @property
    def _busy(self) -> bool:
        """Whether lines wait: for an instruction, or for control."""
        works = self.desk.work is not None or (self._mine and self.desk.controller.doing)
        return self._greeting or self._due < math.inf or works

    @property
    def busy(self) -> bool:
        """Whether a program or an instruction of this terminal is under way, or lines wait."""
        running = self._mine and (self.desk.controller.running or self.desk.controller.doing)
        return running or self._busy or bool(self._waiting)

    @property
    def takes_commands(self) -> bool:
        """Whether the next line is a command."""
        return self._asked is None and (self._dialogue is None or isinstance(self._dialogue, Teach))

    @property
    def edits(self) -> bool:
        """Whether the next line is one of a program."""
        return isinstance(self._dialogue, Editing)

    def output(self) -> list[Said]:
        """What was said since this was last called."""
        said, self.desk.said = self.desk.said, []
        return said

    def start(self, *, now: float) -> None:
        """Say what this is, and ask for control."""
        self.desk.say(f"{self.desk.version}. HELP lists the commands.", style=Style.NOTE)
        self._greeting = self._person is None or bool(self.barred)
        self.advance(now=now)

    def line(self, text: str, *, now: float) -> None:
        """Take a line."""
        if self.done or self._ended:
            return
        if len(text) > LONGEST or text == OVERLONG:
            self.desk.fail(ValError("Line too long", f"{LONGEST} characters at most"))
            return
        text = "".join(letter for letter in text.expandtabs() if letter.isprintable())
        word = text.strip().upper()
        if not self._patient and (word == "PANIC" or (word == "ABORT" and not self._at_prompt)):
            self._urgent(word, now)
        elif self.takes(text):
            self._take(text, now=now)
        else:
            self._wait(text)
        self.advance(now=now)

    @property
    def _at_prompt(self) -> bool:
        """Whether the next line can be taken, and isn't an answer to a program."""
        return not (self._busy or self._waiting) and self._asked is None

    def _urgent(self, word: str, now: float) -> None:
        """What is done whatever is under way; what a program asks and what waits is dropped."""
        if word == "PANIC" or self._mine:
            self._waiting.clear()
            dialogue, self._asked = self._dialogue, None
            self._command(word, now)
            self._dialogue = dialogue

    def _wait(self, text: str) -> None:
        if len(self._waiting) >= WAITING and not self._patient:
            self.desk.fail(ValError("Too many lines waiting", f"{WAITING} at most"))
        else:
            self._waiting.append(text)

    def takes(self, text: str) -> bool:
        """Whether a line can be taken now; else it waits."""
        return not self._waiting and self._can_take(text)

    def _can_take(self, text: str) -> bool:
        if self._busy or self._dialogue is not None or self._asked is not None:
            return not self._busy or self._asked is not None
        runs = self._patient and self._mine and self.desk.controller.running
        return not runs or self._is_allowed(text)

    def _take(self, text: str, *, now: float) -> None:
        """Do what a line says."""
        if self._dialogue is not None and not self._busy:
            self._converse(self._dialogue, text, now)
        elif self._asked is not None:
            self._asked = None
            self._guarded(lambda: self.desk.controller.answer(text, now=now))
        else:
            self._command(text, now)

    def _converse(self, dialogue: Dialogue, text: str, now: float) -> None:
        if isinstance(dialogue, Teach) and not dialogue.takes(text):
            self._command(text, now)
            self._dialogue = self._dialogue or dialogue
            return

        def answer() -> None:
            self.desk.line = text
            self._dialogue = dialogue.line(text, now=now)

        self._guarded(answer)

    @staticmethod
    def _is_allowed(text: str) -> bool:
        """Whether a line is a command that may be given while a program runs."""
        word, _ = split_word(text)
        try:
            return not text.strip() or not commands.command_named(word).idle
        except ValError:
            return False

    def _command(self, text: str, now: float) -> None:
        """Do what a command says, or say what is wrong with it."""
        self.desk.line = text
        self._guarded(lambda: self._carry_out(text, now))

    def _guarded(self, action: Callable[[], object]) -> None:
        try:
            action()
        except ValError as error:
            self.desk.fail(error)
        except VrsError as error:
            self.desk.fail(ValError("Not possible", str(error)))

    def _carry_out(self, text: str, now: float) -> None:
        bare = text.split(";", 1)[0].strip() if '"' not in text else text.strip()
        word, rest = split_word(bare)
        if not bare:
            return
        if rest == "?" and settings.state(self.desk, word.upper()):
            return
        command = commands.command(bare)
        if command.name in {"QUIT", "EXIT"}:
            self._end(now)
            return
        if not command.looks(rest):
            answer = self.barred or self._board.wanted(self, self._person, now=now)
            if answer is None and command.name not in _URGENT:
                self._waiting.appendleft(text)
                self._due, self._claimed = now + ASKING, (command.name, text)
                return
            if answer:
                raise ValError("No control", f"{command.name}: {answer}")
        running = self.desk.controller.running
        if command.idle and running and command.name != "DO":
            raise ValError("Program running", f"{command.name} must wait, or ABORT it")
        self._dialogue = HANDLERS[command.name](self.desk, rest, now=now)
        if command.name == "ENABLE":
            self._board.resume(now=now)

    def interrupt(self, *, now: float) -> None:
        """Ctrl-C: what is asked is dropped, else what this terminal runs is aborted."""
        self._waiting.clear()
        self.desk.drop_work()
        if self._dialogue is not None:
            self._drop(now=now, kept=False)
        elif self._mine and (self.desk.controller.running or self.desk.controller.doing):
            self._asked = None
            self._command("ABORT", now)
        self.advance(now=now)

    def _drop(self, *, now: float, kept: bool) -> None:
        dialogue, self._dialogue, self._asked = self._dialogue, None, None
        if dialogue is not None:
            self._guarded(lambda: dialogue.leave(now=now, kept=kept))

    def end_of_input(self, *, now: float) -> None:
        """No line will come any more: what is under way is done, then it's over."""
        self._ended = True
        self.advance(now=now)

    def leave(self, *, now: float) -> None:
        """The terminal is gone."""
        if not self.done:
            self._end(now)

    def _end(self, now: float) -> None:
        self._drop(now=now, kept=True)
        self.desk.drop_work()
        self.done = True
        self._waiting.clear()
        self._board.leave(self, now=now)

    def take(self, event: context.Event) -> None:
        """Take an event of the controller, when in control."""
        desk = self.desk
        match event:
            case context.Typed(text):
                desk.said.append(Said(text, Style.TYPED))
            case context.Asked(text):
                self._asked = text
            case context.ProgramPaused(program, step, word):
                self._asked = None
                if word != "XSTEP" or not desk.steps:
                    desk.say(f"{program} stands before step {step} ({word})", style=Style.NOTE)
            case context.ProgramEnded(program, word):
                self._asked, desk.steps = None, 0
                if program or word == "ABORT":
                    desk.say(f"{program or 'DO'} has ended ({word})", style=Style.NOTE)
            case context.ProgramFailed(error):
                self._asked, desk.steps = None, 0
                desk.fail(error)
            case context.Warned(text):
                desk.say(text if text.startswith("*") else f"*Warning* {text}", style=Style.NOTE)
            case _:
                pass

    def advance(self, *, now: float) -> None:
        """Do what is due: of the controller, of what is shown again and again, and lines that have waited."""
        self._board.advance(now=now)
        if self._greeting or now >= self._due:
            self._settle_control(now)
        self._look(now)
        if isinstance(self._dialogue, WatchDialogue):
            self._dialogue.advance(now=now)
        self.desk.work_on(allowed=self._mine)
        self._step_on(now)
        self._schedule(now)
        while self._waiting and not self.done:
            text = self._waiting.popleft()
            if not self._can_take(text):
                self._waiting.appendleft(text)
                break
            self._take(text, now=now)
            if self._due < math.inf:
                break
            self._board.advance(now=now)
            self._step_on(now)
        if self._ended and not self.done:
            self._finish(now)

    def _settle_control(self, now: float) -> None:
        """See whether control was given; the line that asked for it waits."""
        answer = self.barred or self._board.wanted(self, self._person, now=now)
        if answer is None:
            self._due = now + ASKING
            return
        self._due = math.inf
        if self._greeting:
            self._greeting = False
            if answer:
                self.desk.say(f"*No control* {answer}: looking only", style=Style.NOTE)
        elif answer and self._waiting and self._waiting[0] is self._claimed[1]:
            self._waiting.popleft()
            self.desk.fail(ValError("No control", f"{self._claimed[0]}: {answer}"))

    def _look(self, now: float) -> None:
        """Say when the robot has stopped by itself, or can't be reached; and when that's over."""
        self._looked = now
        if self._greeting:
            return
        trouble = self._board.trouble(now=now)
        text = "" if trouble is None else str(trouble)
        if text == self._trouble:
            return
        self._trouble = text
        if text:
            self.desk.say(text, style=Style.ERROR)
        else:
            self.desk.say("The robot follows again", style=Style.NOTE)

    def _step_on(self, now: float) -> None:
        """The next of the steps that NEXT is to do."""
        controller = self.desk.controller
        while self.desk.steps and not (controller.running or controller.doing):
            self.desk.steps -= 1
            self._guarded(lambda: controller.xstep(now=now))
            self._board.advance(now=now)

    def _schedule(self, now: float) -> None:
        """A motion for later isn't waited for, once it's accepted."""
        controller = self.desk.controller
        if self.desk.scheduling and self._mine and controller.doing:
            controller.let_go(now=now)
            self._board.advance(now=now)
            self.desk.scheduling = controller.doing

    def _finish(self, now: float) -> None:
        """Leave, once nothing is under way."""
        if self._dialogue is not None and not self._busy and not self._waiting:
            self._drop(now=now, kept=True)
        if self._asked is not None:
            self.desk.fail(ValError("End of input", "the program asks for a line"))
            self._asked = None
            self._command("ABORT", now)
        if not self.busy:
            self._end(now)

    def next_deadline(self) -> float:
        """When to call `advance` next [s]; infinity for not before a line comes."""
        if self.desk.work is not None:
            return self._looked
        watched = self._dialogue.due if isinstance(self._dialogue, WatchDialogue) else math.inf
        return min(self._board.next_deadline(), self._due, watched, self._looked + self._board.looks)
