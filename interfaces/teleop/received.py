"""The operator's log as it has come to the robot."""

from __future__ import annotations

from collections import deque

from interfaces.teleop.messages import LogEntry

WAITING_MOST = 4096
"""Most entries that wait for earlier ones."""


class ReceivedLog:
    """Which entries came, and up to when the timeline is complete with those that were carried out."""

    def __init__(self, complete_until: float) -> None:
        self.executed = 0
        self.complete_until = complete_until
        self._waiting: dict[int, LogEntry] = {}
        self._early: set[int] = set()
        self._claims: deque[tuple[int, float]] = deque(maxlen=WAITING_MOST)

    def due(self, entries: tuple[LogEntry, ...], *, as_they_come: bool) -> list[LogEntry]:
        """Entries to be carried out now, each once."""
        new = [e for e in entries if e.number > self.executed and e.number not in self._early]
        if as_they_come:
            due = list({e.number: e for e in new}.values())
            self._early.update(e.number for e in due)
            while self.executed + 1 in self._early:
                self._early.remove(self.executed + 1)
                self.executed += 1
            return due
        for entry in new:
            if len(self._waiting) < WAITING_MOST:
                self._waiting.setdefault(entry.number, entry)
        due = []
        while self.executed + 1 in self._waiting:
            self.executed += 1
            due.append(self._waiting.pop(self.executed))
        return due

    def claim(self, newest: int, complete_until: float) -> None:
        """A message said that with all entries up to the newest nothing changes before a time."""
        self._claims.append((newest, complete_until))
        held = [c for c in self._claims if c[0] > self.executed]
        if len(held) < len(self._claims):
            kept = max(c[1] for c in self._claims if c[0] <= self.executed)
            self.complete_until = max(self.complete_until, kept)
            self._claims = deque(held, maxlen=WAITING_MOST)
