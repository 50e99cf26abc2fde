"""The emulated way to a live robot: told to clients, changed by who has control; with advice where it's slow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from interfaces.link import Conditions, LinkConditions, Service, delay_profile, loss_model, spelled_loss
from interfaces.link.delays import ALLOWED, DelayProfile
from interfaces.messages.control import DirectionConditions, Impair, LinkFigures, Network
from interfaces.runs.twin_run import QUANTILE
from interfaces.runtime.live.robot_client import RobotClient
from interfaces.stream.hub import ConditionError
from interfaces.teleop.connection import SiteLine
from vrs.errors import InvalidValueError, VrsError


def too_slow(conditions: LinkConditions, max_age: float) -> str:
    """Say that messages will often be too old for a robot that halts then; empty where they won't.

    Args:
        conditions: The way to the robot and back.
        max_age: Older messages don't count there [s].
    """
    # Half a round trip isn't known of the clocks, and counts as age.
    usual = conditions.forward.delay.quantile(QUANTILE) + conditions.backward.delay.quantile(QUANTILE)
    if usual <= max_age:
        return ""
    return (
        f"messages will often be {usual:.2g} s old, with what isn't known of the clocks, and those older "
        f"than {max_age:g} s don't count under --link-loss halt"
    )


def late_often(conditions: LinkConditions, link_loss: str, max_age: float | None) -> str:
    """Say what mends it where messages will often be too old for a robot; empty where they won't.

    Args:
        conditions: See `too_slow`.
        link_loss: What the robot does when nothing is heard, `halt` or `hold`.
        max_age: See `too_slow`; None where that isn't known.
    """
    slow = "" if link_loss != "halt" or max_age is None else too_slow(conditions, max_age)
    return f"{slow}: start vrs serve with --link-loss hold, or vrs robot with --max-age up to 2" if slow else ""


class LiveEmulation:
    """Answers for a `SiteLine`, as `interfaces.stream.hub.Emulation`."""

    def __init__(
        self, line: SiteLine[Any, Any, Any], robot: RobotClient, seed: int, changed: Callable[[float, str], None]
    ) -> None:
        """Answer for a line.

        Args:
            line: The way to the robot, as it was begun.
            robot: The connection at its end.
            seed: Of what is random in it.
            changed: Is told when [s] the conditions changed, and how, for people.
        """
        self._line, self._robot, self._seed, self._changed = line, robot, seed, changed
        self._begun = line.link.conditions
        self._at: float | None = None
        self._by = ""

    def network(self, *, now: float) -> Network:
        """How it is; see `Emulation`."""
        line, attached, report = self._line, self._robot.attached, self._line.operator.report
        conditions, trips = line.link.conditions, line.operator.round_trips
        return Network(
            _way(conditions.forward),
            _way(conditions.backward),
            line.there.measured(now=now),
            line.back.measured(now=now),
            LinkFigures(len(trips), None, _positive(trips.quantile(0.5)), _positive(trips.quantile(0.95))),
            seed=self._seed,
            changed_at=self._at,
            changed_by=self._by,
            robot=self._robot.url,
            problem=self._robot.problem,
            clock=None if report is None else report.uncertainty,
            link_loss="" if attached is None else attached.link_loss,
            timeout=None if attached is None else attached.timeout,
            max_age=None if attached is None else attached.max_age,
            offset=None if attached is None else attached.offset,
            advice="" if attached is None else late_often(conditions, attached.link_loss, attached.max_age),
        )

    def impair(self, wish: Impair, who: str, *, now: float) -> None:
        """Change it; see `Emulation`."""
        before = self._line.link.conditions
        conditions = LinkConditions(
            self._conditions(before.forward, wish.forward), self._conditions(before.backward, wish.backward)
        )
        if conditions == before:
            return
        self._line.change(conditions, now=now)
        self._at, self._by = now, who
        self._changed(now, f"{who} changed the way to the robot: {described(conditions)}")

    def _conditions(self, before: Conditions, wish: DirectionConditions | None) -> Conditions:
        """What a direction does from now on, if it can be as is wished."""
        if wish is None:
            return before
        readers = {"delay": self._profile, "loss": loss_model, "service": _service}
        found: dict[str, Any] = {}
        for name, read in readers.items():
            try:
                found[name] = read(getattr(wish, name))
            except VrsError as error:
                raise ConditionError(name, error) from None
        return replace(before, **found)

    def _profile(self, text: str) -> DelayProfile:
        """The delay profile of a name; of traces, which are files here, only those that it began with."""
        for known in (self._begun.forward.delay, self._begun.backward.delay):
            if text == known.name:
                return known
        if text.partition(":")[0] == "trace":
            allowed = f"{ALLOWED}; and a trace only if the server was started with it"
            raise InvalidValueError("delay profile", text, allowed)
        return delay_profile(text)


def _service(text: str) -> Service:
    if text not in list(Service):
        raise InvalidValueError("service", text, " or ".join(Service))
    return Service(text)


def _positive(seconds: float | None) -> float | None:
    """A round trip [s]: clocks that run apart make short ones negative."""
    return None if seconds is None else max(0.0, seconds)


def _way(conditions: Conditions) -> DirectionConditions:
    return DirectionConditions(conditions.delay.name, spelled_loss(conditions.loss), str(conditions.service))


def described(conditions: LinkConditions) -> str:
    """Conditions in a line, for people."""
    there, back = (_words(_way(way)) for way in (conditions.forward, conditions.backward))
    return f"{there}, both ways" if there == back else f"{there}; back {back}"


def _words(way: DirectionConditions) -> str:
    return f"delay {way.delay}, loss {way.loss}, {way.service}"
