"""Who may come in: tokens of the roles, and the exact Host and Origin of what comes."""

from __future__ import annotations

import base64
import calendar
import contextlib
import hashlib
import hmac
import os
import re
import secrets
import stat
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from interfaces.link.proxy import Address
from interfaces.messages.control import Role, covers
from interfaces.stream.invitations import Invitations
from interfaces.system import PLAIN_READ, write_whole, written
from vrs.clock import seconds_since_1970, utc
from vrs.errors import FormatError, InvalidValueError

if TYPE_CHECKING:
    from interfaces.stream.audit import AuditLog

TOKEN_BYTES = 32
"""Random bytes of a token."""
SHORTEST_TOKEN = -(-8 * TOKEN_BYTES // 6)
"""Shortest token [characters]: `TOKEN_BYTES` in base64, six bits a character, without padding."""
LONGEST_TOKEN = 256
"""Longest token that is looked at [characters]."""
ENDED = "this token has ended: ask for another one"
LARGEST_FILE = 65536
"""Largest token file [bytes]."""
_PERSON: Final = re.compile(r"[\w.-]{1,40}")
"""What people are called."""
_HASHED: Final = re.compile(r"sha256:[0-9a-f]{64}")

_LENGTHS = f"{SHORTEST_TOKEN} to {LONGEST_TOKEN} characters"
OPEN = frozenset({Role.VIEWER, Role.OPERATOR})
"""Roles that need no token on a loopback address, as long as there is no token file."""


@dataclass(frozen=True, slots=True)
class Person:
    """Whose token it is; of the token a file has the digest alone."""

    name: str
    """Of 1 to 40 letters, digits, `.`, `_` and `-`."""
    role: Role
    digest: bytes = field(repr=False)
    """SHA-256 of the token."""
    until: float
    """When it ends [s since 1970]."""

    @property
    def counts(self) -> bool:
        """Whether it hasn't ended."""
        return seconds_since_1970() < self.until


class Admission(NamedTuple):
    """Whether a client gets a role, and whether it may keep it."""

    refusal: str = ""
    """Why it doesn't get it; empty if it does."""
    person: str = ""
    """Whose token was shown; empty where it's nobody's own."""
    counts: Callable[[], bool] = lambda: True
    """Whether what was shown counts still: a person's token ends, and its connections with it."""


class Access:
    """Decides which role a client gets. It keeps digests of the tokens, never the tokens themselves.

    The token of an admin also opens the roles of an operator and a viewer, that of an operator a viewer's.
    """

    def __init__(
        self,
        tokens: Mapping[Role, str] | None = None,
        *,
        free: Iterable[Role] = OPEN,
        invitations: Invitations | None = None,
        people: Path | None = None,
    ) -> None:
        """Give each role its token.

        Args:
            tokens: Text by role; a role without a token is open only if `free` says so.
            free: Roles that need no token. With tokens for other machines this is empty.
            invitations: Codes by which a class comes in; None where there's no class.
            people: A token file whose people's tokens count; it's read again when it has changed.

        Raises:
            FormatError: If that file can't be used.
            InvalidValueError: If a token is shorter than 32 random bytes are, or the admin's role is free.
        """
        tokens = {} if tokens is None else tokens
        for token in tokens.values():
            if not _can_be_token(token):
                raise InvalidValueError("token", f"{len(token)} characters", _LENGTHS)
        self._free = frozenset(free)
        if Role.ADMIN in self._free:
            raise InvalidValueError("free", "admin", "roles other than admin")
        self._digests = {Role(role): _digest(token) for role, token in tokens.items()}
        self.invitations = invitations
        self.audit: AuditLog | None = None
        """Where doors write who is refused; nowhere unless given."""
        self._file, self._seen = people, (-1, -1)
        self._people: dict[bytes, Person] = {}
        if people is not None:
            self._people = _by_digest(people)

    @property
    def people(self) -> Mapping[bytes, Person]:
        """Those of the file by their tokens' digests, as it is now; as it was, while it can't be read."""
        if self._file is not None:
            with contextlib.suppress(FormatError, OSError):
                if (version := _version(self._file)) != self._seen:
                    self._people, self._seen = _by_digest(self._file), version
        return self._people

    def __repr__(self) -> str:
        roles = ", ".join(sorted(self._digests))
        return f"Access(tokens for: {roles or 'nobody'})"

    @property
    def needs_tokens(self) -> bool:
        """Whether nobody comes in without a token."""
        return not self._free

    def refusal(self, role: Role, token: str | None) -> str:
        """Why a client can't have a role; empty if it can."""
        return self.admit(role, token).refusal

    def admit(self, role: Role, token: str | None) -> Admission:
        """Decide whether a client gets a role.

        Every token is compared, in constant time, whatever the others gave.

        Args:
            role: What it asks for.
            token: What it shows.
        """
        entitled = False
        shown = _digest("" if token is None else token[: LONGEST_TOKEN + 1])
        for owner, digest in self._digests.items():
            same = hmac.compare_digest(digest, shown)
            entitled |= same and covers(owner, role)
        person: Person | None = None
        for one in self.people.values():
            if hmac.compare_digest(one.digest, shown):
                person = one
        entitled |= person is not None and _counts(person, role)
        member = None if self.invitations is None else self.invitations.member(token)
        entitled |= member is not None and covers(member.role, role)
        if entitled or (token is None and role in self._free):
            if person is None:
                return Admission()
            digest = person.digest
            return Admission("", person.name, lambda: _counts(self.people.get(digest), role))
        if person is not None and not person.counts:
            return Admission(ENDED, person.name)
        text = f"the role {role} needs its token" if token is None else f"this token isn't one for the role {role}"
        return Admission(text, "" if person is None else person.name)


def read_tokens(path: Path) -> dict[Role, str]:
    """Read a token file: the roles' tokens; see `read_people` for those of people.

    Raises:
        FormatError: If there's no such file, others may read it, or it holds anything else.
    """
    return _read(path)[0]


def read_people(path: Path) -> tuple[Person, ...]:
    """Read the people of a token file; errors as of `read_tokens`."""
    return _read(path)[1]


def _by_digest(path: Path) -> dict[bytes, Person]:
    return {one.digest: one for one in read_people(path)}


def _counts(person: Person | None, role: Role) -> bool:
    """Whether somebody's token is one for a role, and hasn't ended."""
    return person is not None and person.counts and covers(person.role, role)


def _version(path: Path) -> tuple[int, int]:
    state = path.stat()
    return state.st_mtime_ns, state.st_ino


def add_person(path: Path, name: str, role: Role, until: str) -> str:
    """Put somebody into a token file, which is made if it's missing; the token, which is kept nowhere.

    Args:
        path: The file.
        name: Of 1 to 40 letters, digits, `.`, `_` and `-`; nobody there may have it.
        role: What the person may do.
        until: The last day on which the token counts, `2027-01-31`, by UTC.

    Raises:
        InvalidValueError: If name or day isn't one, or somebody has the name.
        FormatError: If the file can't be used.
    """
    if not path.exists():
        make_tokens(path)
    if not _PERSON.fullmatch(name) or any(one.name == name for one in read_people(path)):
        allowed = "1 to 40 letters, digits, '.', '_' and '-', and nobody's in the file"
        raise InvalidValueError("name", name, allowed)
    if _end_of(until) is None:
        raise InvalidValueError("until", until, "a day, as 2027-01-31")
    token = make_token()
    line = f"{role} sha256:{_digest(token).hex()} {name} {until}\n"
    _rewrite(path, lambda lines: [*lines, line])
    return token


def end_person(path: Path, name: str) -> None:
    """Take somebody's token out of a file.

    Raises:
        InvalidValueError: If nobody has that name.
        FormatError: If the file can't be used.
    """
    names = [one.name for one in read_people(path)]
    if name not in names:
        raise InvalidValueError("name", name, f"one of {', '.join(names) or 'nobody: the file has no people'}")
    _rewrite(path, lambda lines: [line for line in lines if line.split()[2:3] != [name]])


def _rewrite(path: Path, change: Callable[[list[str]], list[str]]) -> None:
    lines = path.read_text("ascii").splitlines(keepends=True)
    if lines and not lines[-1].endswith("\n"):
        lines[-1] += "\n"
    with written(path):
        write_whole(path, "".join(change(lines)).encode("ascii"), mode=0o600)


def _end_of(day: str) -> float | None:
    """The end of a day by UTC [s since 1970]; None of what is none."""
    found = re.fullmatch(r"(20[0-9]{2})-([0-9]{2})-([0-9]{2})", day)
    with contextlib.suppress(ValueError):
        if found is not None:
            end = float(calendar.timegm((*map(int, found.groups()), 24, 0, 0)))
            return end if f"{utc(end - 1.0):%Y-%m-%d}" == day else None
    return None


def _read(path: Path) -> tuple[dict[Role, str], tuple[Person, ...]]:
    where = f"token file {path}"
    try:
        descriptor = os.open(path, PLAIN_READ)
    except OSError as error:
        raise FormatError(where, error.strerror or "can't be opened") from None
    state = os.fstat(descriptor)
    if not stat.S_ISREG(state.st_mode):
        os.close(descriptor)
        raise FormatError(where, "it isn't a file")
    with open(descriptor, "rb") as file:
        mode = stat.S_IMODE(state.st_mode)
        if os.name == "posix" and mode != 0o600:
            raise FormatError(where, f"its mode must be 0600, so that nobody else reads it; it's {mode:04o}")
        data = file.read(LARGEST_FILE + 1)
    if len(data) > LARGEST_FILE:
        raise FormatError(where, f"it's longer than {LARGEST_FILE} bytes")
    tokens: dict[Role, str] = {}
    people: list[Person] = []
    for number, line in enumerate(data.decode("ascii", "replace").splitlines(), 1):
        words = line.split()
        if not words:
            continue
        if len(words) == 4:
            people.append(_person(words, f"{where}, line {number}"))
            continue
        if len(words) != 2 or words[0] not in set(Role) or words[0] in tokens:
            raise FormatError(where, f"line {number} must hold a role and its token, each role once")
        if not _can_be_token(words[1]):
            raise FormatError(where, f"the token of line {number} must have {_LENGTHS}")
        tokens[Role(words[0])] = words[1]
    if not tokens and not people:
        raise FormatError(where, "it holds no token")
    return tokens, tuple(people)


def _person(words: list[str], where: str) -> Person:
    role, digest, name, day = words
    until = _end_of(day)
    if role not in set(Role) or not _HASHED.fullmatch(digest) or not _PERSON.fullmatch(name) or until is None:
        raise FormatError(where, "it must hold a role, sha256: and a digest, a name, and a day as 2027-01-31")
    return Person(name, Role(role), bytes.fromhex(digest.removeprefix("sha256:")), until)


def make_token(random_bytes: Callable[[int], bytes] = secrets.token_bytes) -> str:
    """Make a token of 32 random bytes.

    Args:
        random_bytes: So many bytes that nobody can guess.
    """
    return base64.urlsafe_b64encode(random_bytes(TOKEN_BYTES)).rstrip(b"=").decode("ascii")


def make_tokens(path: Path, random_bytes: Callable[[int], bytes] = secrets.token_bytes) -> dict[Role, str]:
    """Make a token file with a token of 32 random bytes for each role.

    Args:
        path: Where; nothing may be there.
        random_bytes: So many bytes that nobody can guess.

    Raises:
        FormatError: If it can't be made.
    """
    tokens = {role: make_token(random_bytes) for role in Role}
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise FormatError(f"token file {path}", error.strerror or "can't be made") from None
    try:
        with written(path), open(descriptor, "w", encoding="ascii") as file:
            path.chmod(0o600)
            file.writelines(f"{role} {token}\n" for role, token in tokens.items())
    except FormatError:
        path.unlink()
        raise
    return tokens


def hosts(names: Iterable[str], port: int) -> frozenset[str]:
    """What the Host of a request may be: names and addresses with the port; IPv6 addresses in brackets."""
    return frozenset(str(Address(name.lower(), port)) for name in names)


def check_host(given: Sequence[str], allowed: frozenset[str]) -> bool:
    """Whether a request names this server, exactly and once.

    Args:
        given: The values of its Host headers.
        allowed: From `hosts`.
    """
    return len(given) == 1 and given[0].lower() in allowed


def check_origin(given: Sequence[str], allowed: frozenset[str], *, tls: bool = False) -> bool:
    """Whether a request comes from a page of this server, or from no browser at all.

    Args:
        given: The values of its Origin headers: none from a program that isn't a browser.
        allowed: From `hosts`.
        tls: Whether pages are served by https; else they are by http, or by a proxy's https in front of it.
    """
    if not given:
        return True
    schemes = {"https"} if tls else {"http", "https"}
    scheme, separator, host = given[0].partition("://")
    return len(given) == 1 and bool(separator) and scheme in schemes and host.lower() in allowed


def bearer(authorization: str) -> str | None:
    """The token that a request shows; None where it shows none.

    Args:
        authorization: Its Authorization header; empty if it has none. What is too long for a token is cut off.
    """
    scheme, _, token = authorization.partition(" ")
    return token[: LONGEST_TOKEN + 1] if scheme.lower() == "bearer" and token else None


def _can_be_token(text: str) -> bool:
    return SHORTEST_TOKEN <= len(text) <= LONGEST_TOKEN


def _digest(token: str) -> bytes:
    return hashlib.sha256(token.encode("utf-8", "replace")).digest()
