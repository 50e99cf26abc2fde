"""What a program asks of the arm: the seam between the language and motion.

Times are session time [s]. Whoever calls `begin`-like methods asks `ready` first; where the robot is elsewhere, the
answer to what was asked comes later, and `answered` says when.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

from interfaces.val2.values import Location, PrecisionPoint, Transformation

ALTER_PERIOD: Final = 0.028
"""How long a program takes for a correction by ALTOUT at least [s], as in VAL-II."""


@dataclass(frozen=True, slots=True)
class Where:
    """Where an arm is."""

    tool: Transformation
    """The tool's tip in the world, in which BASE says where the robot stands."""
    joints: PrecisionPoint
    hand: float
    """Opening of the hand [mm]."""


class ArmPort(Protocol):
    """The arm, as programs and the monitor see it; `motion/` makes it of a robot's timeline.

    Every method that asks for something raises ValError where that can't be, and then has changed nothing.
    """

    # Where it is.

    def here(self, *, now: float) -> Where:
        """Where the operator's arm is, the virtual one."""

    def destination(self, *, now: float) -> Where:
        """Where it goes: where it is, if it goes nowhere."""

    def real(self, *, now: float) -> Where | None:
        """Where the other twin was measured last; None where there's none."""

    def reaches(self, location: Location, *, now: float) -> bool:
        """Whether a motion could go there: INRANGE."""

    # What it waits for.

    def answered(self, *, now: float) -> bool:
        """Whether all that was asked has been answered.

        Raises:
            ValError: If it was refused; once, and then it counts as answered.
        """

    def ready(self, *, now: float) -> bool:
        """Whether the next motion may be asked for: the last has begun, and all has been answered."""

    def settled(self, *, now: float) -> bool:
        """Whether the arm stands at its destination, and the hand has done what it was told."""

    def next_deadline(self) -> float:
        """When any of these may change by itself [s]; infinity for never."""

    # Motions. With CP on, each goes round the destination of the one before; the hand's OPEN and CLOSE,
    # SPEED and what else is asked for the next motion alone, go with it.

    def move(self, target: Location, *, straight: bool, hand: float | bool | None = None, now: float) -> None:
        """MOVE, MOVES; with a hand MOVET, MOVEST: an opening [mm], or open or closed."""

    def approach(self, target: Location, distance: float, *, straight: bool, now: float) -> None:
        """APPRO, APPROS: to a distance [mm] behind a location along its tool axis."""

    def depart(self, distance: float, *, straight: bool, now: float) -> None:
        """DEPART, DEPARTS: back from the destination along its tool axis [mm]."""

    def drive(self, joint: int, change: float, speed: float, *, now: float) -> None:
        """DRIVE: turn a joint, 1 to 6, by a change [deg] at a speed [%]."""

    def draw(self, dx: float, dy: float, dz: float, *, now: float) -> None:
        """DRAW: straight by a way in world axes [mm] from the destination."""

    def go_ready(self, *, now: float) -> None:
        """READY."""

    def nest(self, *, now: float) -> None:
        """NEST."""

    def align(self, *, now: float) -> None:
        """ALIGN: turn the tool's axis to the nearest world axis."""

    def delay(self, seconds: float, *, now: float) -> None:
        """DELAY: stand still for a time [s], as a motion."""

    def actuate(self, hand: bool | None, *, now: float) -> None:
        """OPENI (True), CLOSEI (False), RELAXI (None): now, where the arm stands; `settled` waits for it."""

    # For the next motion, or those after it.

    def set_hand(self, hand: bool | None) -> None:
        """OPEN, CLOSE, RELAX: with the next motion."""

    def set_speed(self, speed: float, *, turn: float | None, unit: str, always: bool) -> None:
        """Program speed: in a unit of `%`, `MMPS` or `IPS`; of turning [%]."""

    def fastest(self, unit: str) -> float:
        """The greatest program speed that counts, in a unit of `%`, `MMPS` or `IPS`."""

    def set_acceleration(self, up: float, down: float) -> None:
        """ACCEL: shares of the limits [%]."""

    def set_duration(self, seconds: float, *, always: bool) -> None:
        """DURATION: shortest time of a motion [s]; 0 for none."""

    def set_tolerance(self, percent: float | None, *, fine: bool, always: bool) -> None:
        """COARSE, FINE: how near counts as there."""

    def tolerance(self) -> tuple[bool, float]:
        """Whether FINE is in force, and its percentage."""

    def set_nulling(self, on: bool, *, always: bool) -> None:
        """NULL, NONULL: whether motions end when the real arm's errors have become small."""

    def set_configuration(self, word: str) -> None:
        """RIGHTY, LEFTY, ABOVE, BELOW, FLIP, NOFLIP: at the next joint-interpolated motion."""

    # At once. TOOL and BASE want a settled arm.

    def set_tool(self, tool: Transformation) -> None:
        """TOOL."""

    def tool(self) -> Transformation:
        """The tool transformation."""

    def set_base(self, base: Transformation) -> None:
        """BASE: where the robot stands in the world in which locations are."""

    def base(self) -> Transformation:
        """The base transformation."""

    def set_monitor_speed(self, percent: float, *, now: float) -> None:
        """Monitor speed: time alone is stretched, of the motion in progress too."""

    def monitor_speed(self) -> float:
        """The monitor speed [%]."""

    def set_continuous_path(self, on: bool) -> None:
        """ENABLE CP, DISABLE CP."""

    def set_dry_run(self, on: bool) -> None:
        """ENABLE DRY.RUN: motions take no time and move nothing."""

    def at(self, t: float | None) -> None:
        """AT, ours: execution time of the next motion [s]; None for as soon as it can."""

    def alter(self, values: tuple[float, ...], *, now: float) -> None:
        """ALTOUT: correct the tool's place by X, Y, Z [mm] and a turn [deg], a rotation vector."""

    def set_alter(self, mode: int | None, *, now: float) -> None:
        """ALTER with a mode's bits (1: cumulative, 2: world axes, those of BASE), NOALTER with None."""

    def brake(self, *, now: float) -> None:
        """BRAKE, REACTI, ABORT: decelerate within the limits, drop what was to come."""

    def give_up(self, *, now: float) -> None:
        """Ask for nothing more of what is under way: somebody else commands the arm."""

    def withdraw(self, *, now: float) -> None:
        """Take what was asked for ahead then out of the plan, when commands count again."""

    def retry(self, *, now: float) -> bool:
        """Ask again for the motion that `brake` interrupted; False if there was none."""

    def begin_program(self) -> None:
        """EXECUTE: speeds, tolerances and requests are as at the beginning."""

    # The timeline.

    def undo(self, *, now: float) -> str:
        """UNDO, ours: take back the newest command; what became of it, one line."""

    def timeline(self, *, now: float) -> list[str]:
        """TIMELINE, ours: what is scheduled, a line each."""

    def past(self, t: float, *, now: float) -> Where:
        """REWIND, ours: where the arm was at a time [s]."""
