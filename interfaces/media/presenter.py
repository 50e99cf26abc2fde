"""What the robot says and shows: `speak` lasts as long as its words, `show` stands until it's cleared."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from interfaces.media.coding import VoicePlayout, encode_sound
from interfaces.media.speech import SpeechError, cleaned, reading_time, shortened, spoken
from vrs.clock import Clock

MOST_WAITING: Final = 8
"""Words that wait until others are said, at most."""

GRACE: Final = 1.5
"""So long words that are over elsewhere may still be heard here [s]."""


class Presenter:
    """The robot's voice and screen. `changed` is called whenever what there's to see or hear is another."""

    def __init__(
        self,
        clock: Clock,
        playout: VoicePlayout,
        *,
        screen: Callable[[str], None] = lambda _: None,
        audible: bool = True,
    ) -> None:
        """Say and show nothing.

        Args:
            clock: Session time.
            playout: Where sound is put.
            screen: Shows a message on the robot; an empty one clears it.
            audible: Whether sound reaches anybody; else words are only shown, as long as reading them takes.
        """
        self._clock, self._playout, self._screen = clock, playout, screen
        self._audible = audible
        self.saying = ""
        """What is being said; empty in silence."""
        self.message = ""
        """What stands on the screen; empty for nothing."""
        self.problem = "" if audible else "sound needs the extra [media]"
        """Why nothing is heard; empty while it is."""
        self.changed: Callable[[], None] = lambda: None
        self._followed = "", ""
        self._said: asyncio.Task[None] | None = None
        self._turn = asyncio.Lock()
        self._waiting = 0

    async def speak(self, text: str) -> None:
        """Say something, after what is being said; returns when it's over. Who is cancelled falls silent at once.

        Without sound the words are shown as long as reading them takes.

        Args:
            text: 1 to 300 characters.

        Raises:
            InvalidValueError: If it isn't such a text.
            SpeechError: If too many wait to be said already.
        """
        words = cleaned(text)
        if self._waiting >= MOST_WAITING:
            raise SpeechError(f"{MOST_WAITING} others wait to be said already")
        self._waiting += 1
        try:
            async with self._turn:
                await self._say(words)
        finally:
            self._waiting -= 1

    async def _say(self, words: str) -> None:
        lasts = await self._sound(words)
        self._set_saying(words)
        try:
            await asyncio.sleep(lasts)
        except asyncio.CancelledError:
            self._playout.hush()
            raise
        finally:
            self._set_saying("")

    async def _sound(self, words: str) -> float:
        """Put words where they're heard; how long they take from now on [s]."""
        if not self._audible:
            return reading_time(words)
        try:
            samples, rate = await spoken(words)
            packets = await asyncio.to_thread(encode_sound, samples, rate)
        except SpeechError as error:
            self.problem = str(error)
            return reading_time(words)
        self.problem = ""
        now = self._clock.now()
        _, end = self._playout.say(packets, now=now)
        return end - now

    def _set_saying(self, words: str) -> None:
        self.saying = words
        self.changed()

    def follow(self, says: str, shows: str) -> None:
        """Say and show what a robot says and shows that was told so elsewhere; to be called with each report of it.

        What is being said isn't cut off within `GRACE` of its end there, which is heard later here.

        Args:
            says: What it says now; empty in silence.
            shows: What is on its screen; empty for nothing.
        """
        if shows != self._followed[1]:
            self._set_message(shortened(shows))
        if says != self._followed[0]:
            before, self._said = self._said, asyncio.create_task(self._go_over(self._said, shortened(says)))
            if before is not None and says:
                before.cancel()
        self._followed = says, shows

    async def _go_over(self, before: asyncio.Task[None] | None, words: str) -> None:
        """Say other words, or none any more."""
        if words:
            try:
                await self.speak(words)
            except SpeechError as error:
                self.problem = str(error)
        elif before is not None:
            _, late = await asyncio.wait([before], timeout=GRACE)
            for task in late:
                task.cancel()

    async def close(self) -> None:
        """Fall silent, and follow nobody any more."""
        if self._said is not None:
            self._said.cancel()
            await asyncio.gather(self._said, return_exceptions=True)
            self._said = None

    def show(self, text: str) -> None:
        """Show a message on the robot's screen and in the pages, in place of the one that's there.

        Args:
            text: 1 to 300 characters.

        Raises:
            InvalidValueError: If it isn't such a text.
        """
        self._set_message(cleaned(text))

    def clear(self) -> None:
        """Show no message any more."""
        self._set_message("")

    def _set_message(self, text: str) -> None:
        self.message = text
        self._screen(text)
        self.changed()
