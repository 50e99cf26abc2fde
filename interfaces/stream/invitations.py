"""A class's short codes: who shows one comes in without a token, in the role that the code is for."""

from __future__ import annotations

import hmac
import secrets
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from interfaces.messages.control import Role
from interfaces.stream.limits import Bucket

ALPHABET: Final = "34679ACDEFGHJKMNPQRTVWXY"
"""Characters of codes: no two of them look alike, nor do those that are left out stand for one of them."""
LENGTH: Final = 6
"""Characters of a code."""
LONGEST: Final = 32
"""Characters of what is typed that are looked at."""
RENEWED: Final = 600.0
"""There are new codes so often [s]."""
GRACE: Final = 60.0
"""So long the codes before them count, too [s]."""
INVITED: Final = (Role.VIEWER, Role.OPERATOR)
"""Roles that there are codes for."""
TRIES, TRIES_AT_ONCE = 1.0, 120.0
"""Codes that may be tried a second, for long and at once: a class comes in at once."""
OF_ADDRESS, OF_ADDRESS_AT_ONCE = 0.5, 60.0
"""The same of one address; a school may have one for all."""
ADDRESSES: Final = 1024
"""Addresses whose tries are counted; of more, those that tried longest ago are forgotten."""
MEMBERS: Final = 1024
"""Sessions that codes have opened; of more, the oldest are forgotten."""
LESSON: Final = 4 * 3600.0
"""So long somebody who came in by a code may come back without one [s]."""


@dataclass(frozen=True, slots=True)
class Invitation:
    """A code that is shown."""

    role: Role
    """What it lets its bearer be."""
    code: str
    until: float
    """When another one is shown instead [session time, s]."""


@dataclass(frozen=True, slots=True)
class Membership:
    """What a code has given."""

    role: Role
    until: float
    """Session time [s]."""


class Invitations:
    """The codes in force, who may try one now, and the sessions that codes have opened.

    The secret of such a session (`Welcome.session`) is a token of its role at all doors of the server, until the
    membership ends, whatever code is shown by then.
    """

    def __init__(self, now: float, choose: Callable[[Sequence[str]], str] = secrets.choice) -> None:
        """Begin with codes.

        Args:
            now: Session time [s].
            choose: Chooses a character so that nobody can guess it.
        """
        self._choose = choose
        self._before: tuple[Invitation, ...] = ()
        self._shown = self._new(now)
        self._tries = Bucket(TRIES, TRIES_AT_ONCE, now)
        self._addresses: OrderedDict[str, Bucket] = OrderedDict()
        self._members: OrderedDict[str, Membership] = OrderedDict()

    def _new(self, now: float) -> tuple[Invitation, ...]:
        codes: list[str] = []
        while len(codes) < len(INVITED):
            code = "".join(self._choose(ALPHABET) for _ in range(LENGTH))
            if code not in codes:
                codes.append(code)
        return tuple(Invitation(role, code, now + RENEWED) for role, code in zip(INVITED, codes, strict=True))

    def shown(self, *, now: float) -> tuple[Invitation, ...]:
        """The codes to show at now [s], that of viewers first; new ones are made when it's time."""
        until = self._shown[0].until
        if now >= until:
            self._before, self._shown = self._shown, self._new(now)
            for session in [name for name, member in self._members.items() if now >= member.until]:
                del self._members[session]
        return self._shown

    def may_try(self, address: str, *, now: float) -> bool:
        """Whether a code may be tried from an address at now [s]; that counts as a try."""
        own = self._addresses.pop(address, None) or Bucket(OF_ADDRESS, OF_ADDRESS_AT_ONCE, now)
        self._addresses[address] = own
        if len(self._addresses) > ADDRESSES:
            self._addresses.popitem(last=False)
        # An address that tries too often takes no tries from the others.
        return own.take(now) and self._tries.take(now)

    def redeem(self, typed: str, *, now: float) -> Membership | None:
        """What a code gives at now [s]; None for a wrong one. All are compared, each in constant time."""
        shown = self.shown(now=now)
        old = tuple(one for one in self._before if now < one.until + GRACE)
        given, found = _tidied(typed).encode("utf-8", "replace"), None
        for invitation in (*shown, *old):
            if hmac.compare_digest(invitation.code.encode(), given):
                found = Membership(invitation.role, now + LESSON)
        return found

    def remember(self, session: str, member: Membership) -> None:
        """Let the secret of a session count as a token of its role."""
        self._members[session] = member
        if len(self._members) > MEMBERS:
            self._members.popitem(last=False)

    def member(self, session: str | None) -> Membership | None:
        """What was given to a session, by its secret; None of one that no code has opened."""
        return self._members.get(session or "")


def is_code(shown: str | None) -> bool:
    """Whether what is shown in the place of a token may be a code: tokens are much longer."""
    return shown is not None and len(_tidied(shown)) == LENGTH


def _tidied(typed: str) -> str:
    """A code as it's meant that somebody has typed: without blanks and hyphens, in capitals."""
    return "".join(character for character in typed[:LONGEST].upper() if character not in " -")
