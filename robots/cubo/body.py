"""CUBO's body, addressed by bindings: names of what an effector moves and of what a sensor measures.

It plans nothing and decides nothing: a thin client's body.
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robots.cubo import parameters as p
from robots.cubo.shapes import EYE
from robots.mobile.body import MobileBody
from robots.mobile.camera import Lens, Look, Sight, jpeg
from robots.mobile.chassis import Limb, MobileReality, Senses, SonarModel
from robots.mobile.microphone import TOLD, TOLD_MODULUS, TOLD_RATE, Microphone, samples_of
from robots.mobile.position import FusedPosition, TruePosition
from robots.rooms import Room
from robots.simulated import USUAL_WORLD
from vrs.checks import finite
from vrs.errors import InvalidValueError
from vrs.mobile import DriveLimits, clipped

Values = tuple[float, ...]
BUTTONS: Final = ("service", "message")
MOVES: Final = ("wheel.left", "wheel.right", "wheels", "arm.left", "arm.right", "tilt", "lip", "screen", "speaker")
"""Bindings of effectors. Wheels: speeds at the rim [m/s], `wheels` right and left. Arms and tilt: an angle [rad],
and a speed [rad/s] if a second value is there and not 0. Lip and screen show what they're given; the speaker plays
fragments."""
MEASURES: Final = (
    "position", "encoders", "proximity", "bumper", "gyro", "battery", "wheels", "arm.left", "arm.right", "tilt",
    "microphone",
)  # fmt: skip
"""Bindings of sensors: (x, y, θ) [m, m, rad]; counts right, left; distances [m], 8 around from straight ahead, the
reach where nothing is; 1 if something is touched; ω [rad/s]; [V]; rim speeds right, left [m/s]; angles [rad]; how
many samples were heard, modulo `TOLD_MODULUS`, and the newest `TOLD` of them."""
COMMANDS: Final = ("ir", "say", "stop", "look")
"""Bindings of commands: the infrared remote control sends a code, a phrase is said, arms, head and wheels stop, a
picture is taken, of which `memories` tells."""
LENS: Final = Lens(width=160, height=120)
"""Of its small camera. Chosen."""
_FRAGMENT: Final = TOLD_RATE // 50
"""Samples of the microphone while a fragment is played."""
_LOUD: Final = 0.25
"""Share of its own voice that the microphone gets."""
_LIMBS: Final = {"arm.right": 0, "arm.left": 1, "tilt": 2}
_MOST_KEPT: Final = 256
"""Of what was said, sent and played."""


class CuboBody(MobileBody):
    """A CUBO in a room of its own; use it as a context manager."""

    def __init__(
        self,
        posture: ArrayLike | None = None,
        *,
        world: str = USUAL_WORLD,
        room: Room | str | None = None,
        reality: MobileReality | None = None,
        rng: np.random.Generator | int = 0,
        limits: DriveLimits = p.LIMITS,
        senses: Senses | None = None,
        exact: bool = False,
    ) -> None:
        """Put a robot into a room, at rest.

        Args:
            posture: (x, y, θ) [m, m, rad]; where the room says, unless given.
            world: One of `robots.simulated.WORLDS`.
            room: A room, or the name of one that comes with the package; only a floor, unless given.
            reality: How real it is; everything, unless given.
            rng: What slips and noise are drawn from, or a seed.
            limits: How fast it may drive.
            senses: What it senses with; proximity, unless given, and what tells it where it is.
            exact: Whether it knows its posture exactly, instead of by odometry and an overhead camera.

        Raises:
            InvalidValueError: If a value is out of range, or the robot would stand in something.
        """
        self.shown: dict[str, Values] = {}
        """What lip and screen show."""
        self.done: deque[tuple[float, str, Values]] = deque(maxlen=_MOST_KEPT)
        """Commands that were carried out: when [s], which, with what."""
        self.played = 0
        """Bytes of sound that were played."""
        self.rims = [0.0, 0.0]
        self._energy = p.CAPACITY
        self._events: deque[str] = deque(maxlen=_MOST_KEPT)
        self._touched = False
        self._sounding = 0.0
        self._memories: list[tuple[str, bytes]] = []
        self._sight: Sight | None = None
        self._voice: deque[bytes] = deque([b""], maxlen=4)
        self._voiced = np.zeros(0)
        self._heard: NDArray[np.int16] = np.zeros(TOLD, dtype=np.int16)
        self._heard_until = 0
        senses = Senses(sonar=SonarModel(rate=20.0, noise=0.002, rays=3)) if senses is None else senses
        super().__init__(
            p.CUBO, posture, world=world, room=room, reality=reality, rng=rng, limits=limits, senses=senses
        )
        self._ear, self._ear_at = Microphone(self.room, EYE.neck[2]), (*self.truth[:2], self.time)
        self._position = TruePosition(self) if exact else FusedPosition(self)
        self._posture = self._position.posture()

    def move(self, binding: str, values: Values) -> None:
        """Let something be done from now on.

        Args:
            binding: One of `MOVES`, but for the speaker.
            values: As `MOVES` says; beyond what the servos can, they do what they can.

        Raises:
            InvalidValueError: If there's no such binding, or a value is missing or isn't finite.
        """
        values = tuple(finite(binding, value) for value in values)
        least = 2 if binding == "wheels" else 1
        if binding not in MOVES or binding == "speaker" or len(values) < least:
            raise InvalidValueError("binding", (binding, values), f"one of {', '.join(MOVES)}, with its values")
        if binding == "wheels":
            self.rims = [values[0], values[1]]
        elif binding.startswith("wheel."):
            self.rims[binding == "wheel.left"] = values[0]
        elif binding in _LIMBS:
            self._swing(p.CUBO.limbs[_LIMBS[binding]], _LIMBS[binding], values)
        else:
            self.shown[binding] = values

    def carry_out(self, binding: str, values: Values) -> None:
        """Do something once: a binding of `COMMANDS`, or one that it doesn't know, which is only noted."""
        self.done.append((self.time, binding, values))
        if binding == "stop":
            self.rims = [0.0, 0.0]
            for number, angle in enumerate(self.angles()):
                self._swing(p.CUBO.limbs[number], number, (angle,))
        elif binding == "look":
            if self._sight is None:
                self._sight = Sight(self.room, EYE, LENS)
            x, y, angle = self.truth
            self._memories.append(
                ("camera", jpeg(self._sight.draw((x, y, angle), Look(0.0, -self.angles()[2]), self.time)))
            )

    def memories(self) -> list[tuple[str, bytes]]:
        """What there's to be sent whole since the last call, by binding: of `camera` pictures, as JPEG."""
        found, self._memories = self._memories, []
        return found

    def sound(self, data: bytes | None) -> None:
        """Play a fragment of sound, or silence where there's none."""
        self.played += len(data or b"")
        self._voice.append(data or b"")
        self._sounding = 2.0 if data else 0.0

    def press(self, button: str) -> None:
        """Press a button, `service` or `message`.

        Raises:
            InvalidValueError: If there's no such button.
        """
        if button not in BUTTONS:
            raise InvalidValueError("button", button, f"one of {', '.join(BUTTONS)}")
        self._events.append(f"button.{button}")

    def measure(self, binding: str) -> Values | None:
        """What a sensor says; None where there's no such binding."""
        match binding:
            case "position":
                return tuple(self._posture)
            case "encoders":
                return self.encoders
            case "proximity":
                far = p.SONAR_REACH[1]
                found = self.sonar
                ranges = [far] * p.PROXIMITY if found is None else found.ranges.tolist()
                return tuple(min(r, far) for r in ranges)
            case "bumper":
                return (float(bool(self.touching)),)
            case "gyro":
                return (self.motion[1],)
            case "battery":
                full, empty = p.BATTERY
                return (empty + (full - empty) * self._energy / p.CAPACITY,)
            case "wheels":
                right, left = self.wheels
                return right.speed * p.WHEEL_RADIUS, left.speed * p.WHEEL_RADIUS
            case "microphone":
                self._listen()
                return float(self._heard_until % TOLD_MODULUS), *self._heard.tolist()
        return (self.angles()[_LIMBS[binding]],) if binding in _LIMBS else None

    def events(self) -> list[str]:
        """Bindings of what happened since the last call."""
        found = list(self._events)
        self._events.clear()
        return found

    def angles(self) -> Values:
        """Angles of the right arm, the left arm and the head [rad]."""
        return self.vehicle.limbs()

    @property
    def step(self) -> float:
        """Of its physics [s]."""
        return self.reality.dt

    @property
    def resting(self) -> bool:
        """Whether it stands still."""
        v, w = self.motion
        return abs(v) < 2e-3 and abs(w) < 2e-2

    def go_on(self, steps: int = 1) -> None:
        """Go on by steps of `reality.dt`.

        Raises:
            LostError: If it fell over.
        """
        right, left = self.rims
        v, w = 0.5 * (right + left), (right - left) / p.WHEEL_BASE
        self.drive(clipped(v, p.LIMITS.v_max), clipped(w, p.LIMITS.w_max), steps)
        self._posture = self._position.posture()
        seconds = steps * self.reality.dt
        work = sum(abs(wheel.torque * wheel.speed) for wheel in self.wheels)
        self._energy = max(0.0, self._energy - (p.IDLE_POWER + self._sounding + 2 * work) * seconds)
        if self.touching and not self._touched:
            self._events.append("bumper")
        self._touched = bool(self.touching)

    def _listen(self) -> None:
        """Hear the room and its own voice, from when it listened last."""
        until, place = int(self.time * TOLD_RATE + 0.5), (*self.truth[:2], self.time)
        count = min(until - self._heard_until, TOLD)
        if count <= 0:
            return
        while len(self._voiced) < count and self._voice:
            self._voiced = np.concatenate([self._voiced, _as_heard(self._voice.popleft())])
        own, self._voiced = self._voiced[:count], self._voiced[count:]
        times = np.arange(until - count + 1, until + 1) / TOLD_RATE
        heard = samples_of(self._ear.hear(self._ear_at, place, times)).astype(np.float64)
        heard[: len(own)] += _LOUD * own
        self._heard = np.concatenate([self._heard, np.clip(heard, -32767, 32767).astype(np.int16)])[-TOLD:]
        self._heard_until, self._ear_at = until, place

    def _swing(self, limb: Limb, number: int, values: Values) -> None:
        speed = (abs(values[1]) if len(values) > 1 else 0.0) or limb.speed
        angle = min(max(values[0], limb.low), limb.high)
        self.vehicle.swing(number, angle, min(max(speed, 1e-3), limb.speed))


def _as_heard(fragment: bytes) -> NDArray[np.float64]:
    """A fragment of what is played, of any length, as it's sampled by the microphone: means, (160,)."""
    played = np.frombuffer(fragment, dtype="<i2", count=len(fragment) // 2)
    if not len(played):
        return np.zeros(_FRAGMENT)
    total = np.concatenate([[0.0], np.cumsum(played, dtype=np.float64)])
    edges = np.linspace(0.0, len(played), _FRAGMENT + 1)
    return np.asarray(np.diff(np.interp(edges, np.arange(len(total)), total)) / (len(played) / _FRAGMENT))
