"""Connections that haven't shown who they are: few at a time, each with a deadline, and the oldest gives way."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Iterator
from typing import Generic, TypeVar

from vrs.checks import number_in

C = TypeVar("C", bound=Hashable)


class Strangers(Generic[C]):
    """Connections of one door: which are still unauthenticated, and by when each must have done its next step.

    A new connection always gets in: if there are too many strangers, one of them gives way, the oldest of those
    whose address has at least its share of the room. Who is known (`know`) never gives way.
    """

    def __init__(self, most: int) -> None:
        """Begin with nobody.

        Args:
            most: Most strangers at a time, 1 to 100,000.
        """
        self._most = int(number_in("most", most, 1, 100_000))
        self._addresses: dict[C, str] = {}
        """Of each stranger, the oldest first."""
        self._each: Counter[str] = Counter()
        self._until: dict[C, float] = {}
        self.gave_way = 0
        """Strangers that gave way to newer ones."""

    def __iter__(self) -> Iterator[C]:
        return iter(tuple(self._addresses))

    def __len__(self) -> int:
        return len(self._addresses)

    def add(self, connection: C, address: str, *, until: float) -> C | None:
        """Take a connection; the one that is to be cut off for it, if one is.

        Args:
            connection: A new one.
            address: Where it comes from.
            until: When its next step must be done [s].
        """
        gives_way = self._oldest(address) if len(self._addresses) >= self._most else None
        if gives_way is not None:
            self.gave_way += 1
            self.discard(gives_way)
        self._addresses[connection] = address
        self._each[address] += 1
        self._until[connection] = until
        return gives_way

    def _oldest(self, coming: str) -> C:
        share = self._most / (len(self._each) + (coming not in self._each))
        return next(one for one, address in self._addresses.items() if self._each[address] >= share)

    def expect(self, connection: C, *, until: float = math.inf) -> None:
        """Set when a connection's next step must be done [s]; infinity where nothing is waited for."""
        if connection in self._until:
            self._until[connection] = until

    def renew(self, connection: C, *, until: float = math.inf) -> None:
        """Count a stranger as the newest, for it has done a step; then as `expect`."""
        address = self._addresses.pop(connection, None)
        if address is not None:
            self._addresses[connection] = address
        self.expect(connection, until=until)

    def know(self, connection: C) -> None:
        """Note that a connection has shown who it is: it's no stranger any more, and nothing is waited for."""
        self._forget(connection)
        self.expect(connection)

    def discard(self, connection: C) -> None:
        """Note that a connection is gone."""
        self._forget(connection)
        self._until.pop(connection, None)

    def _forget(self, connection: C) -> None:
        address = self._addresses.pop(connection, None)
        if address is not None:
            self._each[address] -= 1
            if not self._each[address]:
                del self._each[address]

    def overdue(self, now: float) -> list[C]:
        """The connections that haven't done their step in time; they are to be cut off.

        Args:
            now: [s].
        """
        return [connection for connection, until in self._until.items() if until <= now]
