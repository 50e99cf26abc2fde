"""The monitor of one terminal: lines in, what is said and the prompt out."""

from __future__ import annotations

import contextlib
import math
from collections import deque
from typing import Final

from interfaces.val2 import context
from interfaces.val2.errors import ValError
from interfaces.val2.monitor import commands, running
from interfaces.val2.monitor.control import ControlState, SharedController
from interfaces.val2.monitor.files import Files
from interfaces.val2.monitor.layout import WIDTH
from interfaces.val2.monitor.state import Dialogue, Expects, OutputText, Question, Style, TerminalState, split_word
from interfaces.val2.printer import print_step

LONGEST: Final = 2048
"""Longest line [characters]."""
OVERLONG: Final = "\x00"
"""What stands for a line that was too long to be read."""
WAITING: Final = 64
"""Lines that may wait until an instruction is done."""
CONTROL_POLL: Final = 0.02
"""Time between two looks whether control was given [s]."""
_URGENT: Final = frozenset({"ABORT", "PANIC"})
"""What doesn't wait."""
_NARROWEST: Final = 40
"""Columns for which tables are laid out at least."""
_GREETING: Final = "", ""
"""What waits for control at the beginning."""


class TerminalMonitor:
    """One terminal's monitor. Errors are said; they never end it."""

    def __init__(
        self,
        shared: SharedController,
        files: Files,
        version: str,
        *,
        queues_commands: bool = False,
        read_only: str = "",
        session: str | None = None,
    ) -> None:
        """Begin; `start` greets.

        Args:
            shared: Where the controller is, and others perhaps.
            files: What LOAD and STORE reach.
            version: What ID says.
            queues_commands: Whether lines that can't be done while a program runs wait for its end; else they are
                errors.
            read_only: Why this terminal only looks, whoever is in control.
            session: By which the person here commands from elsewhere, too: control is that session's, and isn't
                asked for before a command needs it.
        """
        self.session = session
        """Whose right to command it asks for; None for the controller's own."""
        self._shared, self._queues_commands, self.read_only = shared, queues_commands, read_only
        self._listener = self.take
        self.state = TerminalState(shared.controller, shared.control, files, version)
        self._dialogue: Dialogue | None = None
        self._asked = Question()
        """What the dialogue asks."""
        self._prompted: str | None = None
        """What a program asks."""
        self._waiting: deque[str] = deque()
        self._ended = False
        self._pending: tuple[str, str] | None = None
        """The name and the line of a command that waits for control, empty at the beginning; None for none."""
        self._fault, self._checked_at = "", -math.inf
        self.done = False
        """Whether it's over: QUIT, or the end of the input."""

    @property
    def prompt(self) -> str:
        """What is asked; empty while nothing is, since an instruction is being carried out."""
        if self.done:
            return ""
        if self._dialogue is not None and not self._busy:
            return self._asked.prompt
        if self._prompted is not None:
            return self._prompted
        return "" if self._busy else "*" if self.state.controller.running else "."

    @property
    def expects(self) -> Expects:
        """What the next line is."""
        if self._prompted is not None:
            return Expects.ANSWER
        return Expects.COMMAND if self._dialogue is None else self._asked.expects

    def suggestions(self, text: str) -> tuple[str, list[commands.Word]]:
        """What may complete the next line, as far as the cursor; see `commands.suggestions`."""
        fragment, found = commands.suggestions(text, self.state, program=self.expects is Expects.STEP)
        return fragment, [] if self.expects is Expects.ANSWER else found

    @property
    def _in_control(self) -> bool:
        return self._shared.holder is self._listener

    @property
    def _runs(self) -> bool:
        """Whether a program or an instruction of this terminal is under way."""
        return self._in_control and (self.state.controller.running or self.state.controller.doing)

    @property
    def _busy(self) -> bool:
        """Whether lines wait: for an instruction, or for control."""
        works = self.state.work is not None or (self._in_control and self.state.controller.doing)
        return self._pending is not None or works

    @property
    def busy(self) -> bool:
        """Whether a program or an instruction of this terminal is under way, or lines wait."""
        return self._runs or self._busy or bool(self._waiting)

    def output(self) -> list[OutputText]:
        """What was said since this was last called."""
        output, self.state.output = self.state.output, []
        return output

    def fit(self, columns: int) -> None:
        """Lay tables out for a terminal of so many columns; one wider than usual changes nothing."""
        self.state.width = min(max(columns - 1, _NARROWEST), WIDTH)

    def start(self, *, now: float) -> None:
        """Say what this is, and ask for control."""
        self.state.now = now
        self.state.say(f"{self.state.version}. HELP lists the commands.", style=Style.NOTE)
        if self.session is None or self.read_only:
            self._pending = _GREETING
        self.advance(now=now)

    def line(self, text: str, *, now: float) -> None:
        """Take a line."""
        self.state.now = now
        if self.done or self._ended:
            return
        if len(text) > LONGEST or text == OVERLONG:
            self.state.fail(ValError("Line too long", f"{LONGEST} characters at most"))
            return
        text = "".join(letter for letter in text.expandtabs() if letter.isprintable())
        word = text.strip().upper()
        at_prompt = not (self._busy or self._waiting) and self._prompted is None
        if not self._queues_commands and (word == "PANIC" or (word == "ABORT" and not at_prompt)):
            # It's done whatever is under way; what a program asks and what waits is dropped.
            if word == "PANIC" or self._in_control:
                self._waiting.clear()
                self._prompted = None
                self._command(word)
        elif self.takes(text):
            self._take(text)
        elif len(self._waiting) >= WAITING and not self._queues_commands:
            self.state.fail(ValError("Too many lines waiting", f"{WAITING} at most"))
        else:
            self._waiting.append(text)
        self.advance(now=now)

    def takes(self, text: str) -> bool:
        """Whether a line can be taken now; else it waits."""
        return not self._waiting and self._can_take(text)

    def _can_take(self, text: str) -> bool:
        if self._prompted is not None:
            return True
        if self._busy or self._dialogue is not None:
            return not self._busy
        if not (self._queues_commands and self._in_control and self.state.controller.running):
            return True
        command = commands.command_named(split_word(text)[0])
        return not text.strip() or (command is not None and not command.waits(split_word(text)[1]))

    def _take(self, text: str) -> None:
        """Do what a line says."""
        self.state.line = text
        dialogue = None if self._busy else self._dialogue
        if dialogue is not None and not self._asked.passes(text):
            self._ask(dialogue, text)
        elif dialogue is None and self._prompted is not None:
            self._prompted = None
            with self.state.guarded():
                self.state.controller.answer(text, now=self.state.now)
        else:
            self._command(text)

    def _ask(self, dialogue: Dialogue, text: str | None) -> None:
        """Let a dialogue go on with a line, or without; it asks, or is over."""
        asked: Question | None = None
        with self.state.guarded(), contextlib.suppress(StopIteration):
            asked = dialogue.send(text)
        if asked is not None:
            self._dialogue, self._asked = dialogue, asked
        elif self._dialogue is dialogue:
            self._dialogue = None

    def _command(self, text: str) -> None:
        """Do what a command says, or say what is wrong with it."""
        self.state.line = text
        with self.state.guarded():
            self._carry_out(text)

    def _carry_out(self, text: str) -> None:
        bare = text.split(";", 1)[0].strip() if '"' not in text else text.strip()
        word, rest = split_word(bare)
        if not bare or (rest == "?" and running.show_setting(self.state, word.upper())):
            return
        command = commands.command(bare)
        if command.act is None:
            self._end()
            return
        if not command.only_shows(rest):
            answer = self.read_only or self._shared.request(self._listener, self.session, now=self.state.now)
            if answer is ControlState.PENDING and command.name not in _URGENT:
                self._waiting.appendleft(text)
                self._pending = command.name, text
                return
            if isinstance(answer, str):
                raise ValError("No control", f"{command.name}: {answer}")
        if command.waits(rest) and self.state.controller.running and command.name != "DO":
            raise ValError("Program running", f"{command.name} must wait, or ABORT it")
        if (dialogue := command.carry_out(self.state, rest)) is not None:
            self._ask(dialogue, None)

    def interrupt(self, *, now: float) -> None:
        """Ctrl-C: what is asked is dropped, else what this terminal runs is aborted."""
        self.state.now = now
        self._waiting.clear()
        self.state.drop_work()
        if self._dialogue is not None:
            self._end_dialogue(kept=False)
        elif self._runs:
            self._prompted = None
            self._command("ABORT")
        self.advance(now=now)

    def _end_dialogue(self, *, kept: bool) -> None:
        dialogue, self._dialogue, self._prompted = self._dialogue, None, None
        if dialogue is not None:
            with self.state.guarded(), contextlib.suppress(EOFError, StopIteration):
                if kept:
                    dialogue.throw(EOFError())
            dialogue.close()

    def end_of_input(self, *, now: float) -> None:
        """No line will come any more: what is under way is done, then it's over."""
        self.state.now = now
        self._ended = True
        self.advance(now=now)

    def leave(self, *, now: float) -> None:
        """The terminal is gone."""
        self.state.now = now
        if not self.done:
            self._end()

    def _end(self) -> None:
        self._end_dialogue(kept=True)
        self.state.drop_work()
        self.done = True
        self._waiting.clear()
        self._shared.leave(self._listener, now=self.state.now)

    def take(self, event: context.Event) -> None:
        """Take an event of the controller, when in control."""
        state = self.state
        match event:
            case context.Typed(text):
                state.output.append(OutputText(text, Style.TYPED))
            case context.Traced(program, number, done):
                state.say(f"{program} {number}: {print_step(done)}", style=Style.NOTE)
            case context.Asked(text):
                self._prompted = text
            case context.ProgramPaused(program, step, word, 0):
                self._prompted = None
                if word != "XSTEP" or not state.steps:
                    state.say(f"{program} stands before step {step} ({word})", style=Style.NOTE)
            case context.ProgramPaused(program, step, word, task):
                state.say(f"{program}, task {task}, stands before step {step} ({word})", style=Style.NOTE)
            case context.ProgramEnded(program, word, task) if task:
                state.say(f"{program}, task {task}, has ended ({word})", style=Style.NOTE)
            case context.ProgramEnded(program, word):
                self._prompted, state.steps = None, 0
                if program or word == "ABORT":
                    state.say(f"{program or 'DO'} has ended ({word})", style=Style.NOTE)
            case context.ProgramFailed(error, task):
                if task == 0:
                    self._prompted, state.steps = None, 0
                state.fail(error)
            case context.Warned(text):
                state.say(f"*Warning* {text}", style=Style.NOTE)

    def advance(self, *, now: float) -> None:
        """Do what is due: of the controller, of what is shown again and again, and lines that have waited."""
        self.state.now = now
        self._shared.advance(now=now)
        if self._pending is not None:
            self._settle_control(*self._pending)
        self._report_fault()
        if self._dialogue is not None and now >= self._asked.due:
            self._ask(self._dialogue, None)
        self.state.work_on(allowed=self._in_control)
        self._continue_steps()
        self._release_scheduled()
        while self._waiting and not self.done and self._can_take(self._waiting[0]):
            self._take(self._waiting.popleft())
            if self._pending is not None:
                break
            self._shared.advance(now=now)
            self._continue_steps()
        if self._ended and not self.done:
            self._finish()

    def _settle_control(self, name: str, line: str) -> None:
        """See whether control was given; the line that asked for it waits."""
        answer = self.read_only or self._shared.request(self._listener, self.session, now=self.state.now)
        if answer is ControlState.PENDING:
            return
        self._pending = None
        if isinstance(answer, str) and not name:
            self.state.say(f"*No control* {answer}: looking only", style=Style.NOTE)
        elif isinstance(answer, str) and self._waiting and self._waiting[0] is line:
            self._waiting.popleft()
            self.state.fail(ValError("No control", f"{name}: {answer}"))

    def _report_fault(self) -> None:
        """Say when the robot has stopped by itself, or can't be reached; and when that's over."""
        self._checked_at = self.state.now
        if self._pending == _GREETING:
            return
        fault = self._shared.control.fault(now=self.state.now)
        before, self._fault = self._fault, "" if fault is None else str(fault)
        if self._fault and self._fault != before:
            self.state.say(self._fault, style=Style.ERROR)
        elif before and not self._fault:
            self.state.say("The robot follows again", style=Style.NOTE)

    def _continue_steps(self) -> None:
        """The next of the steps that NEXT is to do."""
        controller = self.state.controller
        while self.state.steps and not (controller.running or controller.doing):
            self.state.steps -= 1
            with self.state.guarded():
                controller.proceed(single=True, now=self.state.now)
            self._shared.advance(now=self.state.now)

    def _release_scheduled(self) -> None:
        """A motion for later isn't waited for, once it's accepted."""
        controller = self.state.controller
        if self.state.scheduling and self._in_control and controller.doing:
            controller.release_scheduled(now=self.state.now)
            self._shared.advance(now=self.state.now)
            self.state.scheduling = controller.doing

    def _finish(self) -> None:
        """Leave, once nothing is under way."""
        if self._dialogue is not None and not self._busy and not self._waiting:
            self._end_dialogue(kept=True)
        if self._prompted is not None:
            self.state.fail(ValError("End of input", "the program asks for a line"))
            self._prompted = None
            self._command("ABORT")
        if not self.busy:
            self._end()

    def next_deadline(self) -> float:
        """When to call `advance` next [s]; infinity for not before a line comes."""
        if self.state.work is not None:
            return self._checked_at
        asked = math.inf if self._dialogue is None else self._asked.due
        waits = self._pending is not None
        polled = self._checked_at + (CONTROL_POLL if waits else self._shared.control.fault_poll_interval)
        return min(self._shared.next_deadline(), asked, polled)
