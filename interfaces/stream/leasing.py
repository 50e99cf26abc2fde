"""Who may command: the lease as sessions see it, who shares it, and what its ends do to the robot."""

from __future__ import annotations

import hmac
from typing import TYPE_CHECKING, Protocol, TypeAlias

from interfaces.messages import Order, Refusal, RefusalCode, control
from interfaces.messages.control import OVERRULED, Problem, ProblemCode, Role, may_send
from interfaces.messages.fields import Epoch
from robots.onboard.lease import Ended, Grant, Lease, LeaseEnd, LeaseRefusal

if TYPE_CHECKING:
    from interfaces.engine_server.servlet import Servlet


Wish: TypeAlias = control.LeaseWish | control.Beat
"""What a client asks of the lease, or says to keep it."""


class SessionState:
    """What a session keeps while its connection is lost: who it is, and its servlet."""

    __slots__ = ("key", "left", "local", "name", "role", "servlet")

    def __init__(self, key: str, name: str, role: Role, *, local: bool = False) -> None:
        self.key, self.name, self.role, self.local = key, name, role, local
        self.servlet: Servlet
        self.left = 0.0
        """When its connection was lost [s]."""


class LeasedRobot(Protocol):
    """What the lease does to the robot."""

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


class Leasing:
    """The lease of one robot, and the sessions that have it or share it."""

    def __init__(self, lease: Lease, robot: LeasedRobot, sharers: int) -> None:
        """Nobody has it yet.

        Args:
            lease: The robot's; nobody else calls it.
            robot: What the lease does to the robot.
            sharers: Sessions that may share it, at most.
        """
        self.lease, self._robot, self._sharers = lease, robot, sharers
        self.version = 0
        """Counts the changes of the lease."""
        self.holder: SessionState | None = None
        """Who has it."""
        self._ended: LeaseEnd | None = None
        self._taker: SessionState | None = None
        self._shares: dict[SessionState, bool] = {}
        """Who shares the lease in force; False once another session of it has commanded since."""

    def forget(self, seat: SessionState) -> None:
        """Forget a session that's gone for good."""
        self._shares.pop(seat, None)

    def stopped(self, *, now: float) -> None:
        """Say that the robot is at rest after a lease ended, and takes no command."""
        was = self.lease.state
        grant = self.lease.stopped(now=now)
        if self.lease.state is was:
            return
        taker, self._taker = self._taker, None
        self.version += 1
        if isinstance(grant, Grant):
            self.holder = taker
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
        if isinstance(wish, control.Acquire | control.TakeOver):
            refusal = self._ask(seat, isinstance(wish, control.TakeOver), now)
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
            self.holder = seat
            self._robot.began(answer, now=now)
        else:
            self._taker = seat
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
            self.holder, self._ended = None, ended.why
            self._shares.clear()
            self.version += 1
            self._robot.ended(ended, now=now)

    def seen_by(self, seat: SessionState, answers: int | None = None) -> control.Lease:
        """The lease as a client sees it: its epoch is told to its holder only, and to who shares it."""
        lease, yours, shared = self.lease, seat is self.holder, self._shares.get(seat, False)
        epoch = Epoch(lease.epoch) if lease.epoch and (yours or shared) else None
        return control.Lease(lease.state, epoch, lease.holder, yours, answers, self._ended, shared)
