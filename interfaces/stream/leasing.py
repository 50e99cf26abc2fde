"""Who may command: the lease as sessions see it, who shares it, and what its ends do to the robot."""

from __future__ import annotations

import hmac
import math
import unicodedata
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, Protocol, TypeAlias

from interfaces.messages import Order, Refusal, RefusalCode, control
from interfaces.messages.control import (
    MOST_PRESENT,
    OVERRULED,
    Acquire,
    GiveControl,
    Member,
    Present,
    Problem,
    ProblemCode,
    QueueWish,
    RequestControl,
    Role,
    TakeOver,
    Withdraw,
    may_send,
)
from interfaces.messages.fields import Epoch
from robots.onboard.lease import Ended, Grant, Lease, LeaseEnd, LeaseRefusal, LeaseState

if TYPE_CHECKING:
    from interfaces.engine_server.servlet import Servlet


Wish: TypeAlias = control.LeaseWish | control.Beat
"""What a client asks of the lease, or says to keep it."""


class SessionState:
    """What a session keeps while its connection is lost: who it is, and its servlet."""

    __slots__ = ("alters", "counts", "here", "key", "left", "local", "member", "name", "person", "role", "servlet")

    def __init__(self, key: str, name: str, role: Role, *, local: bool = False) -> None:
        self.key, self.name, self.role, self.local = key, name, role, local
        self.servlet: Servlet
        self.left = 0.0
        """When its connection was lost [s]."""
        self.here = False
        """Whether it has a connection."""
        self.member = 0
        """Its number in a class; 0 where there's none."""
        self.person = ""
        """Whose token was shown; empty where it's nobody's own."""
        self.counts: Callable[[], bool] = lambda: True
        """Whether that counts still."""
        self.alters = False
        """Whether others may correct the paths of its programs."""


class LeasedRobot(Protocol):
    """What the lease does to the robot."""

    @property
    def met(self) -> bool:
        """Whether the real robot has been heard: before that nobody's turn to take the lease runs out."""

    def began(self, grant: Grant, *, now: float) -> None:
        """A lease has begun: its epoch's commands count from now on."""

    def ended(self, ended: Ended, *, now: float) -> None:
        """A lease has ended: stop the robot, and say `Hub.stopped` when it's at rest."""

    def resume(self, epoch: int, *, now: float) -> str:
        """Let a robot go on that stopped by itself; why it can't, empty if it does."""


_REASONS = {
    LeaseRefusal.INVALID: "a holder's name has 1 to 100 characters",
    LeaseRefusal.HELD: "somebody has the lease",
    LeaseRefusal.ENDING: "the robot isn't at rest yet: ask again",
    LeaseRefusal.NOT_ADMIN: "only an admin may take over",
    LeaseRefusal.STALE_EPOCH: "this isn't the epoch of the lease in force",
    LeaseRefusal.EXHAUSTED: "there are no epochs left",
}


LONGEST_NAME: Final = 24
"""Characters of a name in a class."""
OFFERED: Final = 10.0
"""So long an offer stands [s]; then it's the next one's turn, and who let it pass isn't in the queue any more."""
MOST_WAITING: Final = 100
"""Sessions in a queue."""


class Classroom:
    """Who is here of a class, who waits for the lease, and to whom it's offered."""

    def __init__(self) -> None:
        self.members: dict[int, SessionState] = {}
        """By their numbers."""
        self.version = 0
        """Counts the changes of who is here."""
        self.offered: SessionState | None = None
        """Who may acquire a free lease, before all others."""
        self.offered_until = -math.inf
        self._queue: list[SessionState] = []
        self._numbers = 0
        self._lasting = False
        """Whether the offer stands until the robot is met."""

    def enter(self, seat: SessionState) -> None:
        """Give somebody a number, and a name that nobody else has."""
        self._numbers += 1
        seat.member, seat.name = self._numbers, self._unique(cleaned(seat.name))
        self.members[seat.member] = seat

    def _unique(self, name: str) -> str:
        taken = {member.name.casefold() for member in self.members.values()}
        found, count = name, 1
        while found.casefold() in taken:
            count += 1
            found = f"{name[: LONGEST_NAME - len(f' {count}')]} {count}"
        return found

    def leave(self, seat: SessionState) -> None:
        """Forget somebody."""
        self.members.pop(seat.member, None)
        self.version += 1
        self.withdraw(seat)

    def waits(self, seat: SessionState) -> bool:
        """Whether somebody is in the queue."""
        return seat in self._queue

    @property
    def waiting(self) -> list[SessionState]:
        """Who waits, in order: whose connection was lost has no number till it's back."""
        return [seat for seat in self._queue if seat.here]

    def place(self, seat: SessionState) -> int:
        """The place in the queue, from 1; 0 of who isn't in it."""
        return self.waiting.index(seat) + 1 if self.waits(seat) and seat.here else 0

    def request(self, seat: SessionState) -> str:
        """Let somebody wait behind all others; why not, empty if it does."""
        if seat not in self._queue:
            if len(self._queue) >= MOST_WAITING:
                return f"{MOST_WAITING} wait already"
            self._queue.append(seat)
        return ""

    def withdraw(self, seat: SessionState) -> None:
        """Take somebody out of the queue; an offer to it ends."""
        if seat in self._queue:
            self._queue.remove(seat)
        if self.offered is seat:
            self.offered = None

    def put_first(self, seat: SessionState) -> None:
        """Let somebody wait before all others, also before who has an offer."""
        self.withdraw(seat)
        self._queue.insert(0, seat)
        self.offered = None

    def advance(self, *, free: bool, met: bool, now: float) -> bool:
        """Offer a free lease to the first who is here, and end an offer in time; whether anything has changed.

        Args:
            free: Whether the lease is free.
            met: Whether the robot has been heard: an offer's time begins then.
            now: Session time [s].
        """
        before, lasted = self.offered, self._lasting
        self._lasting = before is not None and not met
        if self._lasting or lasted:
            self.offered_until = now + OFFERED
        if before is not None and not (free and before.here and now < self.offered_until):
            if free and before.here:
                self._queue.remove(before)
            self.offered = None
        if free and self.offered is None and (waiting := self.waiting):
            self.offered, self.offered_until = waiting[0], now + OFFERED
        return self.offered is not before or lasted > self._lasting

    def present(self, holder: SessionState | None) -> Present:
        """Who is here, those first who have the lease or wait for it."""
        places = {seat: place for place, seat in enumerate(self.waiting, 1)}
        roles = list(Role)

        def order(seat: SessionState) -> tuple[bool, float, int, int]:
            return seat is not holder, places.get(seat, math.inf), -roles.index(seat.role), seat.member

        here = sorted((seat for seat in self.members.values() if seat.here), key=order)
        listed = here[:MOST_PRESENT]
        return Present(
            tuple(Member(seat.member, seat.name, seat.role, places.get(seat, 0)) for seat in listed),
            others=len(here) - len(listed),
            holder=0 if holder is None else holder.member,
            offered=0 if self.offered is None else self.offered.member,
            offered_until=None if self.offered is None else self.offered_until,
        )


def cleaned(name: str) -> str:
    """A name as all may see it: of one line, without what isn't seen, not too long."""
    seen = (
        " " if unicodedata.category(character) == "Cc" else character
        for character in unicodedata.normalize("NFKC", name)
        if unicodedata.category(character) not in {"Cf", "Cn", "Co", "Cs"}
    )
    return " ".join("".join(seen).split())[:LONGEST_NAME].strip() or "Guest"


def _withdraw(room: Classroom, seat: SessionState, wish: Withdraw) -> str:
    """Take somebody out of the queue; why not, empty if that's done."""
    one = seat if wish.member is None else room.members.get(wish.member)
    if one is not seat and not may_send(seat.role, GiveControl.sender):
        return "only an admin takes others out of the queue"
    if one is None or not room.waits(one):
        return "" if wish.member is None else f"nobody of the number {wish.member} is in the queue"
    room.withdraw(one)
    return ""


class Leasing:
    """The lease of one robot, and the sessions that have it, share it, or wait for it."""

    def __init__(
        self,
        lease: Lease,
        robot: LeasedRobot,
        sharers: int,
        classroom: Classroom | None = None,
        *,
        in_order: bool = False,
        note: Callable[..., None] = lambda *_, **_facts: None,
    ) -> None:
        """Nobody has it yet.

        Args:
            lease: The robot's; nobody else calls it.
            robot: What the lease does to the robot.
            sharers: Sessions that may share it, at most.
            classroom: Who queues for it; None where nobody does.
            in_order: Whether operators are in the queue from when they connect first.
            note: Is told when somebody gets the lease, shares it or asks for it by force, and when it ends: what,
                which session if it's known, and other facts by name.
        """
        self.lease, self._robot, self._sharers, self.classroom = lease, robot, sharers, classroom
        self._in_order, self._note = in_order, note
        self.version = 0
        """Counts the changes of the lease."""
        self.holder: SessionState | None = None
        """Who has it."""
        self._shown: control.Lease | None = None
        self._ended: LeaseEnd | None = None
        self._taker: SessionState | None = None
        self._shares: dict[SessionState, bool] = {}
        """Who shares the lease in force; False once another session of it has commanded since."""

    def enter(self, seat: SessionState) -> None:
        """Let a session in that isn't of this process."""
        if self.classroom is not None:
            self.classroom.enter(seat)
            if self._in_order and seat.role is Role.OPERATOR:
                self.classroom.request(seat)

    def note(self, seat: SessionState, *, here: bool) -> None:
        """Note that a session has a connection, or has lost it."""
        seat.here = here
        if self.classroom is not None:
            self.classroom.version += 1
            # Those behind it in the queue move up, or back.
            self.version += self.classroom.waits(seat)

    def forget(self, seat: SessionState) -> None:
        """Forget a session that's gone for good."""
        self._shares.pop(seat, None)
        if self.classroom is not None:
            self.classroom.leave(seat)

    def stopped(self, *, now: float) -> None:
        """Say that the robot is at rest after a lease ended, and takes no command."""
        was = self.lease.state
        grant = self.lease.stopped(now=now)
        if self.lease.state is was:
            return
        taker, self._taker = self._taker, None
        self.version += 1
        if isinstance(grant, Grant):
            self._begin(taker, grant, now)
        self._offer(now)

    def _begin(self, seat: SessionState | None, grant: Grant, now: float) -> None:
        self.holder = seat
        if seat is not None and self.classroom is not None:
            self.classroom.withdraw(seat)
        self._note("control", seat, epoch=str(grant.epoch))
        self._robot.began(grant, now=now)

    def refusal(self, seat: SessionState, order: Order, now: float) -> Refusal | None:
        """Why an order isn't carried out now; None if it is. One that is ends the shares of all others."""
        shares = self._shares.get(seat)
        if seat is not self.holder and not shares:
            if shares is None:
                return Refusal("no lease: acquire it first")
            return Refusal(OVERRULED, RefusalCode.OVERRULED)
        heard = self.lease.heard if seat is self.holder else self.lease.refused
        epoch = order.epoch or 0
        if heard(epoch, now=now) is not None:
            return Refusal(f"no lease: epoch {epoch} isn't in force")
        for other in [other for other, counts in self._shares.items() if counts and other is not seat]:
            self._shares[other] = False
            self.version += 1
        return None

    def wish(self, seat: SessionState, wish: Wish, now: float) -> control.Lease | Problem | None:
        """Do what a client asks of the lease; the answer, None for a beat that counts."""
        number = None if isinstance(wish, control.Beat) else wish.number
        if not may_send(seat.role, control.Acquire.sender):
            return Problem(ProblemCode.NOT_ALLOWED, "a viewer has no lease", number)
        if isinstance(wish, control.Share):
            return self._share(seat, wish, now)
        if isinstance(wish, QueueWish):
            return self._queue(seat, wish, now)
        if isinstance(wish, Acquire | TakeOver):
            if text := self._others_turn(seat, now):
                return Problem(ProblemCode.LEASE, text, number)
            refusal = self._ask(seat, isinstance(wish, TakeOver), now)
        elif seat is not self.holder:
            refusal = self._of_a_share(seat, wish, now)
        elif isinstance(wish, control.Release):
            refusal = self.lease.release(wish.epoch, now=now)
        else:
            refusal = self.lease.heard(wish.epoch, now=now)
        self.turn(now)
        if refusal is None and isinstance(wish, control.Resume):
            text = self._robot.resume(wish.epoch, now=now)
            if text:
                return Problem(ProblemCode.LEASE, text, number)
        if refusal is not None:
            stale = refusal is LeaseRefusal.STALE_EPOCH
            code = ProblemCode.STALE_EPOCH if stale else ProblemCode.LEASE
            return Problem(code, _REASONS[refusal], number)
        return None if number is None else self.seen_by(seat, number)

    def _others_turn(self, seat: SessionState, now: float) -> str:
        """Why somebody can't have a free lease in a class, as it's offered to another one; empty if it can."""
        self.turn(now)
        offered = None if self.classroom is None else self.classroom.offered
        if offered is None or offered is seat or may_send(seat.role, TakeOver.sender):
            return ""
        return f"control is offered to {offered.name}: ask for it, and wait"

    def _queue(self, seat: SessionState, wish: QueueWish, now: float) -> control.Lease | Problem:
        """Do what a client asks of the queue."""
        room = self.classroom
        if room is None:
            return Problem(ProblemCode.NOT_ALLOWED, "there's no queue here: acquire control", wish.number)
        self.turn(now)
        if isinstance(wish, RequestControl):
            problem = self._request(room, seat, now)
        elif isinstance(wish, Withdraw):
            problem = _withdraw(room, seat, wish)
        else:
            problem = self._give(room, seat, wish, now)
        if problem:
            return Problem(ProblemCode.LEASE, problem, wish.number)
        self.version += 1
        self.turn(now)
        return self.seen_by(seat, wish.number)

    def _request(self, room: Classroom, seat: SessionState, now: float) -> str:
        """Let somebody have a lease that nobody else waits for, or wait for it; why not, empty if it does."""
        if seat is self.holder:
            return ""
        problem = room.request(seat)
        self._offer(now)
        if room.offered is not seat:
            return problem
        refusal = self._ask(seat, False, now)
        return "" if refusal is None else _REASONS[refusal]

    def _give(self, room: Classroom, seat: SessionState, wish: GiveControl, now: float) -> str:
        """Offer the lease to somebody before all others, whoever has it now; why not, empty if that's done."""
        taker = room.members.get(wish.member)
        if not may_send(seat.role, wish.sender):
            return "only an admin gives control to somebody"
        if taker is None or not taker.here:
            return f"nobody has the number {wish.member} here"
        if not may_send(taker.role, Acquire.sender):
            return f"{taker.name} is a viewer, who can't have control"
        if taker is not self.holder:
            room.put_first(taker)
            self._note("gives control", seat, to=taker.name)
            self.lease.revoke(admin=True, now=now)
            self._taker = None
        return ""

    def _offer(self, now: float) -> None:
        """In a class, offer a free lease to the next one."""
        room = self.classroom
        if room is not None and room.advance(
            free=self.lease.state is LeaseState.FREE, met=self._robot.met, now=now
        ):
            self.version += 1

    def commanding(self, seat: SessionState) -> bool:
        """Whether a session has the lease, or shares it."""
        return seat is self.holder or self._shares.get(seat, False)

    def admits(self, seat: SessionState, epoch: int, now: float) -> bool:
        """Whether a session has the lease, and this is its epoch."""
        admitted = seat is self.holder and self.lease.heard(epoch, now=now) is None
        self.turn(now)
        return admitted

    def _ask(self, seat: SessionState, force: bool, now: float) -> LeaseRefusal | None:
        """Ask for the lease; who has it already keeps it."""
        self.turn(now)
        admin = may_send(seat.role, control.TakeOver.sender)
        if force and not admin:
            return LeaseRefusal.NOT_ADMIN
        if seat is self.holder:
            return None
        lease, name = self.lease, seat.name
        answer = lease.take_over(name, admin=admin, now=now) if force else lease.acquire(name, now=now)
        if isinstance(answer, LeaseRefusal):
            return answer
        self.version += 1
        if isinstance(answer, Grant):
            self._begin(seat, answer, now)
        else:
            self._taker = seat
            self._note("takes over", seat)
        return None

    def _share(self, seat: SessionState, wish: control.Share, now: float) -> control.Lease | Problem:
        """Let a session command under the lease of another one whose name it knows."""
        self.turn(now)
        holder = self.holder
        known = b"" if holder is None else holder.key.encode()
        shown = wish.session.encode("utf-8", "surrogatepass")
        if holder is None or not hmac.compare_digest(known, shown):
            return Problem(ProblemCode.LEASE, "that session doesn't have the lease", wish.number)
        if seat is not holder and not self._shares.get(seat):
            if seat not in self._shares and len(self._shares) >= self._sharers:
                return Problem(ProblemCode.LEASE, f"{self._sharers} share it already", wish.number)
            self._shares[seat] = True
            self._note("shares control", seat, of=holder.name)
            self.version += 1
        return self.seen_by(seat, wish.number)

    def _of_a_share(self, seat: SessionState, wish: Wish, now: float) -> LeaseRefusal | None:
        """Why what somebody wishes who doesn't hold the lease isn't done; who shares it may go on, and leave it."""
        assert isinstance(wish, control.Release | control.Resume | control.Beat)
        if not self._shares.get(seat) or isinstance(wish, control.Beat):
            return LeaseRefusal.STALE_EPOCH
        refusal = self.lease.refused(wish.epoch, now=now)
        if refusal is None and isinstance(wish, control.Release):
            del self._shares[seat]
            self.version += 1
        return refusal

    def turn(self, now: float) -> None:
        """Stop the robot if the lease has ended; that of a holder in this process needs no beats."""
        epoch = self.lease.epoch
        if self.holder is not None and self.holder.local and epoch is not None:
            self.lease.heard(epoch, now=now)
        ended = self.lease.advance(now=now)
        if ended is not None:
            self._note("control ended", self.holder, epoch=str(ended.epoch), why=ended.why.value)
            self.holder, self._ended = None, ended.why
            self._shares.clear()
            self.version += 1
            self._robot.ended(ended, now=now)
        self._offer(now)

    def show(self, lease: control.Lease) -> None:
        """Let all see the lease of another hub, which this one relays, in place of its own."""
        self._shown = lease
        self.version += 1

    def present(self) -> Present:
        """Who is here of a class; nobody where there's none."""
        return Present() if self.classroom is None else self.classroom.present(self.holder)

    def seen_by(self, seat: SessionState, answers: int | None = None) -> control.Lease:
        """The lease as a client sees it: its epoch is told to its holder only, and to who shares it."""
        if self._shown is not None:
            return self._shown
        lease, yours, shared = self.lease, seat is self.holder, self._shares.get(seat, False)
        epoch = Epoch(lease.epoch) if lease.epoch and (yours or shared) else None
        room = self.classroom
        return control.Lease(
            lease.state, epoch, lease.holder, yours, answers, self._ended, shared,
            member=seat.member,
            waiting=0 if room is None else room.place(seat),
            offered_until=room.offered_until if room is not None and room.offered is seat else None,
        )  # fmt: skip
