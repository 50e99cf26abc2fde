"""A loudspeaker on board: it speaks as long as the program `espeak-ng` takes for the words. It's given the time.

What is heard is made where people listen, by `Presenter.follow`; here is known when it's over.
"""

from __future__ import annotations

import asyncio
import math

from interfaces.media.speech import SpeechConfig, SpeechError, reading_time, shortened, spoken


class Aloud:
    """Says one text at a time; to be used in a running loop, in which the program is asked for its length."""

    def __init__(self, speech: SpeechConfig | None = None) -> None:
        """Be silent.

        Args:
            speech: How it speaks.
        """
        self._speech = SpeechConfig() if speech is None else speech
        self.text = ""
        """What is being said; empty in silence."""
        self._until = -math.inf
        self._task: asyncio.Task[None] | None = None

    def speak(self, text: str, *, now: float) -> None:
        """Begin to say something, in place of anything else.

        Args:
            text: What to say.
            now: [s].
        """
        self.hush()
        self.text, self._until = text, math.inf
        self._task = asyncio.create_task(self._measure(shortened(text), now))

    async def _measure(self, words: str, began: float) -> None:
        """Find out how long it takes; without the program as long as reading does."""
        lasts = reading_time(words)
        try:
            if words:
                samples, rate = await spoken(words, self._speech)
                lasts = len(samples) / rate
        except SpeechError:
            pass
        self._until = began + lasts

    def hush(self) -> None:
        """Be silent at once."""
        if self._task is not None:
            self._task.cancel()
        self.text, self._until, self._task = "", -math.inf, None

    def is_speaking(self, *, now: float) -> bool:
        """Whether what was begun isn't over yet at now [s]."""
        if now >= self._until:
            self.text = ""
        return now < self._until
