"""What is said, as sound: text cleaned and bounded, spoken by the program `espeak-ng` without a shell.

`Aloud` is a loudspeaker on board. What is heard is made where people listen, by `Presenter.follow`.
"""

from __future__ import annotations

import asyncio
import contextlib
import io
import math
import shutil
import unicodedata
import wave
from typing import Final

import numpy as np
from numpy.typing import NDArray

from vrs.errors import FormatError, InvalidValueError, VrsError

PROGRAM: Final = "espeak-ng"
LANGUAGE: Final = "en"
"""Of the program's voice, as `espeak-ng --voices` lists them."""
PACE: Final = 150
"""Words a minute; the program takes 80 to 450."""
PITCH: Final = 45
"""Of the voice; the program takes 0 to 99."""
LONGEST: Final = 300
"""Characters of what is said or shown at most."""
TIME: Final = 10.0
"""How long the program may take [s]."""
_MOST_SOUND: Final = 1 << 24
"""Bytes of sound at most, some six minutes."""
_READ_ALOUD: Final = 15.0
"""Characters a second where nothing speaks and people read."""


class SpeechError(VrsError):
    """The program that speaks isn't there, or failed."""

    def __init__(self, problem: str) -> None:
        self.problem = problem
        super().__init__(f"nothing can be said: {problem}")


def cleaned(text: str) -> str:
    """A text as it's said and shown: printable, blanks in one, without the brackets that begin phonemes.

    Raises:
        InvalidValueError: If nothing is left of it, or it's too long.
    """
    if not isinstance(text, str) or len(text) > 4 * LONGEST:
        raise InvalidValueError("text", str(text)[:40], f"1 to {LONGEST} characters")
    words = _printable(text)
    if not 1 <= len(words) <= LONGEST:
        raise InvalidValueError("text", text[:40], f"1 to {LONGEST} characters")
    return words


def shortened(text: str) -> str:
    """The same of a text that somebody else took already: as much of it as there's room for, perhaps nothing."""
    return _printable(text[: 4 * LONGEST])[:LONGEST].strip()


def _printable(text: str) -> str:
    kept = "".join(" " if unicodedata.category(letter)[0] in "ZC" else letter for letter in text)
    return " ".join(kept.replace("[[", " ").replace("]]", " ").split())


def reading_time(text: str) -> float:
    """How long people take to read a text [s]."""
    return 1.0 + len(text) / _READ_ALOUD


def program() -> str | None:
    """Where the program is; None where it isn't."""
    return shutil.which(PROGRAM)


async def spoken(text: str) -> tuple[NDArray[np.int16], int]:
    """Let the program say a text.

    Args:
        text: From `cleaned`; it goes through standard input, so that none of it's an option.

    Returns:
        Samples, (k,), and their rate [1/s].

    Raises:
        SpeechError: If the program isn't there, fails or takes too long.
    """
    found = program()
    if found is None:
        raise SpeechError(f"the program {PROGRAM} isn't installed")
    options = ("-v", LANGUAGE, "-s", str(PACE), "-p", str(PITCH), "--stdin", "--stdout")
    try:
        process = await asyncio.create_subprocess_exec(
            found, *options, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL,
        )  # fmt: skip
    except OSError as error:
        raise SpeechError(error.strerror or str(error)) from None
    try:
        async with asyncio.timeout(TIME):
            data, _ = await process.communicate(text.encode())
    except TimeoutError:
        raise SpeechError(f"{PROGRAM} took longer than {TIME:g} s") from None
    finally:
        if process.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
    if process.returncode:
        raise SpeechError(f"{PROGRAM} ended with status {process.returncode}")
    try:
        return samples_of(data)
    except FormatError as error:
        raise SpeechError(str(error)) from None


def samples_of(data: bytes) -> tuple[NDArray[np.int16], int]:
    """Samples, (k,), and their rate [1/s], of a WAV file of one channel; its header may say any length.

    Raises:
        FormatError: If it's none.
    """
    try:
        with wave.open(io.BytesIO(data)) as sound:
            kind, rate = (sound.getnchannels(), sound.getsampwidth()), sound.getframerate()
            frames = sound.readframes(_MOST_SOUND)
    except (wave.Error, EOFError) as error:
        raise FormatError(PROGRAM, f"no sound: {error}") from None
    if kind != (1, 2) or not 8000 <= rate <= 48_000:
        raise FormatError(PROGRAM, f"sound of {kind[0]} channels of {kind[1]} bytes at {rate}/s")
    return np.frombuffer(frames[: len(frames) // 2 * 2], dtype="<i2").astype(np.int16), rate


class Aloud:
    """Says one text at a time; to be used in a running loop, in which the program is asked for its length."""

    def __init__(self) -> None:
        """Be silent."""
        self.text = ""
        """What is being said; empty in silence."""
        self.until = -math.inf
        """When what is being said ends [s]; inf while nobody knows."""
        self._task: asyncio.Task[None] | None = None

    def speak(self, text: str, *, now: float) -> None:
        """Begin to say something, in place of anything else.

        Args:
            text: What to say.
            now: [s].
        """
        self.hush()
        self.text, self.until = text, math.inf
        self._task = asyncio.create_task(self._measure(shortened(text), now))

    async def _measure(self, words: str, began: float) -> None:
        """Find out how long it takes; without the program as long as reading does."""
        lasts = reading_time(words)
        try:
            if words:
                samples, rate = await spoken(words)
                lasts = len(samples) / rate
        except SpeechError:
            pass
        self.until = began + lasts

    def hush(self) -> None:
        """Be silent at once."""
        if self._task is not None:
            self._task.cancel()
        self.text, self.until, self._task = "", -math.inf, None

    def is_speaking(self, *, now: float) -> bool:
        """Whether what was begun isn't over yet at now [s]."""
        if now >= self.until:
            self.text = ""
        return now < self.until
