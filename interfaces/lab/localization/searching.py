"""Where a robot is that was told nothing: starts anywhere, rooms that look alike, robots that were carried off."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from typing_extensions import override

from interfaces.lab.claims import OWN_BAR, Cell, Findings, Results, Study, Table, all_of, at_least, at_most
from interfaces.lab.localization.trial import CONTROL, PostureErrors, body_of, drive, setting, wander
from robots.mobile.apartments import ApartmentConfig, apartment
from robots.mobile.floor_plan import FloorPlan, Ways, plan_map
from robots.onboard.driving import Drive
from robots.onboard.global_localization import Candidate
from robots.onboard.localizer import Localizer, LocalizerConfig, Status
from robots.onboard.map_building import Surveyor
from robots.rooms import Room, read_room
from vrs.mobile import wrapped
from vrs.model import Array

ALIKE: Final = 0.03
"""Scans that fit as well, rms [m], are of one place as far as anybody can tell."""
APART, APART_TURN = 0.5, math.radians(15)
"""Places that are nearer and turned less are the same [m, rad]."""
_BEAMS = 120
_GRID = 0.4
_CLOSE = 40
"""Pairs that are moved against each other."""
_REACH = 8.0
_CAP = 1.0
"""A beam that's off by more counts no more, when pairs are chosen [m]."""
_HALVINGS = 9


class Lookalikes:
    """Full turns from all over a room."""

    def __init__(self, room: Room, height: float) -> None:
        """Take a room as it stands, without people, and the scanner's height [m]."""
        standing = Room(room.name, room.length, room.width, room.start, room.blocks, room.columns)
        self._plan = FloorPlan(standing, height)
        places = Ways(room, 0.4).places
        cells = np.unique(np.floor(places / _GRID), axis=0, return_index=True)[1]
        self.places = places[cells]
        """Where scans were made [m], (n, 2)."""
        self._ways = np.arange(_BEAMS) * (math.tau / _BEAMS)
        self.scans = np.array([self.scan((x, y, 0.0)) for x, y in self.places.tolist()])
        """Ranges [m], (n, 120)."""

    def scan(self, posture: tuple[float, float, float]) -> Array:
        """A whole turn from a posture, counter-clockwise from ahead [m], (120,)."""
        x, y, theta = posture
        angles = theta + self._ways
        origins = np.tile((x, y), (_BEAMS, 1))
        found = self._plan.cast(origins, np.column_stack([np.cos(angles), np.sin(angles)]), 0.0, _REACH)
        return np.minimum(found, _REACH)

    def best(self) -> float:
        """How well the two most alike different places fit, rms [m]."""
        S = self.scans
        spectrum = np.fft.rfft(S, axis=1)
        power = (S * S).sum(axis=1)
        pairs = []
        for k in range(len(S)):
            same = np.fft.irfft(spectrum[k] * np.conj(spectrum[k:]), _BEAMS, axis=1)
            squares = np.maximum(power[k] + power[k:, None] - 2 * same, 0.0) / _BEAMS
            turn = np.minimum(np.arange(_BEAMS), _BEAMS - np.arange(_BEAMS)) * math.tau / _BEAMS
            near = np.linalg.norm(self.places[k:] - self.places[k], axis=1) < APART + _GRID
            squares[near[:, None] & (turn < APART_TURN + 0.2)] = np.inf
            i, j = np.unravel_index(np.argsort(squares, axis=None)[:3], squares.shape)
            pairs += [(float(squares[a, b]), k, k + int(a), int(b)) for a, b in zip(i, j, strict=True)]
        pairs.sort()
        return min((self._fit(k, other, shift) for _, k, other, shift in pairs[:_CLOSE]), default=math.inf)

    def _fit(self, k: int, other: int, shift: int) -> float:
        """Move one of two places until its scan fits the other's best; the rms then [m]."""
        wanted = self.scans[k]
        x, y = self.places[other].tolist()
        at = np.array([x, y, -shift * math.tau / _BEAMS])
        step = np.array([_GRID / 2, _GRID / 2, math.tau / _BEAMS])
        best = self._off(wanted, at)
        for _ in range(_HALVINGS):
            for _ in range(4):
                trials = [at + sign * step * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
                offs = [self._off(wanted, trial) for trial in trials]
                least = int(np.argmin(offs))
                if offs[least] >= best:
                    break
                at, best = trials[least], offs[least]
            step = step / 2
        if self._same(k, at):
            return math.inf
        return math.sqrt(float(np.mean((self.scan((at[0], at[1], at[2])) - wanted) ** 2)))

    def _off(self, wanted: Array, at: Array) -> float:
        difference = self.scan((float(at[0]), float(at[1]), float(at[2]))) - wanted
        return float(np.mean(np.minimum(difference * difference, _CAP)))

    def _same(self, k: int, at: Array) -> bool:
        turned = abs(math.remainder(float(at[2]), math.tau)) < APART_TURN
        return turned and math.dist(self.places[k].tolist(), at[:2].tolist()) < APART


def distinctive(room: Room, height: float = 0.3) -> bool:
    """Whether no two different places of a room look alike."""
    return Lookalikes(room, height).best() > ALIKE


STARTS = 10
"""In an apartment, at most."""
CLEAR = 0.42
"""Starts are so far from things [m]: the robot's rear corners pass at 0.39 m as it turns on the spot."""
NEAR, NEAR_TURN = 0.10, math.radians(3)
"""A start is found if the posture is as near as that [m, rad]."""
TURN = 0.65
"""Speed of the turn on the spot [rad/s]."""
PATIENCE = 16.0
"""Longest that is waited for an answer [s]: a turn, and some more looks."""
CARRIED = 8.0
"""When the robot is carried off [s]."""
NOTICED, RECOVERED = 3.0, 40.0
"""It has to notice within [s]; and to be found again within [s]."""


UNDOUBTING: Final = LocalizerConfig(through=1.0, explained=0.0)
"""Of one that is never lost, whatever it sees."""
LONG_ENOUGH = 5.0
"""So long a filter that was begun anywhere may take to come right [s]."""


class FirstPlaceLocalizer(Localizer):
    """Goes on at the place that fits best, however well another one fits."""

    @override
    def _located(self, surveyor: Surveyor) -> tuple[Candidate, ...]:
        return super()._located(surveyor)[:1]


ANSWERS: Final = ("right", "wrong", "ambiguous", "none")
"""What is said of a start."""


class Starts(NamedTuple):
    """Of an apartment."""

    room: str
    answers: Counter[str]
    """How many starts got which of `ANSWERS`."""
    guessed: Counter[str]
    """What a filter says that was begun at a place drawn from the room, of the first start."""


@cache
def _distinctive(seed: int, number: int) -> Room:
    """The number-th apartment of a study whose map is distinctive."""
    for k in range(100):
        made = int(np.random.SeedSequence([seed, number, k, 7]).generate_state(1)[0])
        room = apartment(made, ApartmentConfig(rooms=1 + number % 5))
        if distinctive(_mapped(room)):
            return room
    return room


def _mapped(room: Room) -> Room:
    """What a line map has of a room: an unknown chair tells nothing, nor does a column."""
    return Room(room.name, room.length, room.width, room.start, room.known().blocks)


def measure_starts(study: Study, case: str) -> Starts:
    """Starts in a distinctive apartment; the case is its number and how many."""
    number, count = map(int, case.split(":"))
    room = _distinctive(study.seed, number)
    places = Ways(room, CLEAR).places
    rng = np.random.default_rng([study.seed, number, 11])
    answers: Counter[str] = Counter()
    for k in range(count):
        x, y = places[int(rng.integers(len(places)))].tolist()
        posture = x, y, float(rng.uniform(-math.pi, math.pi))
        seed = study.seed, number, 20 + k
        answers[_start(room, number, seed, posture, Localizer(plan_map(room)))] += 1
        if k == 0:
            first = seed, posture
    seed, posture = first
    x, y = places[int(rng.integers(len(places)))].tolist()
    anywhere = x, y, float(rng.uniform(-math.pi, math.pi))
    guess = Localizer(plan_map(room), anywhere, config=UNDOUBTING)
    return Starts(room.name, answers, Counter([_start(room, number, seed, posture, guess, LONG_ENOUGH)]))


def _start(
    room: Room,
    number: int,
    seed: tuple[int, ...],
    posture: tuple[float, float, float],
    localizer: Localizer,
    least: float = 0.0,
) -> str:
    """Turn on the spot at a posture until it's found, and so long at least [s]; the answer."""
    chosen = setting(room, number, 0.03, seed)
    with body_of(chosen, posture) as body:
        while body.time < PATIENCE:
            localizer.move(body.time, body.reckoned)
            if body.laser is not None:
                localizer.see(body.laser)
            if localizer.status is Status.TRACKING and body.time >= least:
                break
            body.drive(0.0, TURN, round(CONTROL / body.reality.dt))
        return answer_of(localizer, body.truth)


def answer_of(localizer: Localizer, truth: tuple[float, float, float]) -> str:
    """What is to be thought of what a localizer says: one of `ANSWERS`."""
    if localizer.posture is None or localizer.status is not Status.TRACKING:
        return "ambiguous" if localizer.status is Status.AMBIGUOUS else "none"
    x, y, theta = localizer.posture
    near = math.dist((x, y), truth[:2]) <= NEAR and abs(wrapped(theta - truth[2])) <= NEAR_TURN
    return "right" if near else "wrong"


def conclude_starts(_study: Study, found: tuple[Starts, ...]) -> Findings:
    """How many were found, beside a filter that begins anywhere."""
    count = sum((one.answers for one in found), Counter[str]())
    guessed = sum((one.guessed for one in found), Counter[str]())
    starts, without = count.total(), f"tracking from anywhere, {guessed.total()} starts"

    def share(of: Counter[str], answer: str) -> float:
        return 100 * (of[answer] / of.total())

    claims = (
        at_least(
            f"of {starts} starts found [%]", OWN_BAR, 95, share(count, "right"), (without, share(guessed, "right"))
        ),
        at_most(
            "wrong and confident [%]", OWN_BAR, 1, share(count, "wrong"), (without, share(guessed, "wrong"))
        ),
    )  # fmt: skip
    rows: list[list[tuple[str, Cell]]] = [
        [("apartment", one.room), *((what, one.answers[what]) for what in ANSWERS)] for one in found
    ]
    return Findings(claims, (Table.of("starts", f"starts anywhere, {STARTS} an apartment at most", rows),))


def symmetric(number: int) -> Room:
    """A room that looks the same from two places, or a square one from four."""
    length, width = ((5.0, 5.0), (6.4, 4.2), (7.5, 3.6))[number % 3]
    corners = ("0 0", f"{length} 0", f"{length} {width}", f"0 {width}")
    walls = "\n".join(f"wall {a} {b}" for a, b in pairwise([*corners, corners[0]]))
    return read_room(
        f"room 1\nname Symmetric {number}\nsize {length} {width}\nstart 1.5 1.2 40\n{walls}", "symmetric"
    )


class Twice(NamedTuple):
    """The same measured twice."""

    ours: Results
    rival: Results
    """Without what is claimed."""


def measure_symmetric(study: Study, case: str) -> Twice:
    """A turn on the spot in a symmetric room, heard by one that takes the first place, too."""
    number = int(case)
    room = symmetric(number)
    chosen = setting(room, number, 0.03, (study.seed, number, 13))
    both = Localizer(plan_map(room)), FirstPlaceLocalizer(plan_map(room))
    with body_of(chosen) as body:
        drive(body, PATIENCE, lambda _, __: Drive(0.0, TURN), dict(zip(("ours", "rival"), both, strict=True)))
        for one in both:
            one.move(body.time, body.reckoned)
        truth = body.truth
    return Twice(*(_named(one, room, truth) for one in both))


def _named(localizer: Localizer, room: Room, truth: tuple[float, float, float]) -> Results:
    offs = [math.dist(one.posture[:2], truth[:2]) for one in localizer.candidates]
    return Results(
        room=room.name,
        status=localizer.status,
        named=len(offs),  # places that were named
        expected=4 if room.length == room.width else 2,  # places that look the same
        off=min(offs, default=math.nan),  # of the nearest [m]
    )


def conclude_symmetric(_study: Study, measured: tuple[Twice, ...]) -> Findings:
    """Whether it said so, beside one that takes the first place."""

    def good(those: Sequence[Results]) -> int:
        return sum(
            one.status is Status.AMBIGUOUS and one.named == one.expected and one.off <= NEAR for one in those
        )

    found, rivals = zip(*measured, strict=True)
    rows = [
        (
            ("room", one.room),
            ("answer", one.status.value),
            ("places that look the same", one.expected),
            ("named", one.named),
            ("nearest off [cm]", 100 * one.off),
        )
        for one in found
    ]
    what = f"of {len(found)} symmetric rooms called ambiguous, with all places that look the same"
    return Findings(
        (all_of(what, OWN_BAR, good(found), len(found), ("the place that fits best taken", good(rivals))),),
        (Table.of("symmetric", "rooms that look the same from several places", rows),),
    )


def measure_carried(study: Study, case: str) -> Twice:
    """Drive, be carried off, drive on; turn on the spot when the localizer wants it; one without doubt hears it."""
    number = int(case)
    room = _distinctive(study.seed, number)
    rng = np.random.default_rng([study.seed, number, 17])
    chosen = setting(room, number, 0.03, (study.seed, number, 19))
    places = Ways(room, CLEAR).places
    with body_of(chosen) as body:
        localizer, driver, carried = Localizer(plan_map(room), body.truth), wander(chosen), [0.0]
        sure = Localizer(plan_map(room), body.truth, config=UNDOUBTING)

        def pushed(t: float) -> None:
            if abs(t - CARRIED) < CONTROL / 2:
                far = places[np.hypot(*(places - body.truth[:2]).T) > min(2.0, 0.3 * room.length)]
                x, y = far[int(rng.integers(len(far)))].tolist()
                carried[0] = math.dist((x, y), body.truth[:2])
                body.carry((x, y, float(rng.uniform(-math.pi, math.pi))))

        def told(t: float, posture: tuple[float, float, float]) -> Drive:
            return Drive(0.0, TURN) if localizer.wants_turn else driver(t, posture)

        record = drive(body, CARRIED + RECOVERED, told, {"ours": localizer, "rival": sure}, pushed)

    def came_of(one: Localizer, track: PostureErrors) -> Results:
        events = [event for event in one.events if event.time > CARRIED]
        noticed = next((e.time - CARRIED for e in events if e.status is not Status.TRACKING), math.inf)
        found = [e.time - CARRIED for e in events if e.status is Status.TRACKING]
        return Results(
            room=room.name,
            distance=carried[0],  # how far it was carried [m]
            noticed=noticed,  # after so long [s]; inf if never
            recovered=found[-1] if found else math.inf,  # and found again after so long [s]
            off=float(track.place[-1]),  # at the end [m]
        )

    return Twice(came_of(localizer, record.tracks["ours"]), came_of(sure, record.tracks["rival"]))


def conclude_carried(_study: Study, measured: tuple[Twice, ...]) -> Findings:
    """Whether it noticed, and recovered, beside one without doubt."""
    found, rivals = zip(*measured, strict=True)
    noticed, unnoticed = (sum(one.noticed <= NOTICED for one in those) for those in (found, rivals))
    recovered, lost = (sum(one.off <= NEAR for one in those) for those in (found, rivals))
    rows = [
        (
            ("apartment", one.room),
            ("carried [m]", one.distance),
            ("noticed after [s]", one.noticed),
            ("found after [s]", one.recovered),
            ("off at the end [cm]", 100 * one.off),
        )
        for one in found
    ]
    without, total = "no test of the scans", len(found)
    claims = (
        all_of(f"of {total} carried off, noticed within 3 s", OWN_BAR, noticed, total, (without, unnoticed)),
        all_of("and found again", OWN_BAR, recovered, total, (without, lost)),
    )
    return Findings(claims, (Table.of("carried", "robots that were carried off", rows),))
