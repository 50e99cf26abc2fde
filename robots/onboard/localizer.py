"""A robot that knows whether it knows where it is: it tracks, notices that it was carried off, searches, goes on.

    TRACKING ── scans contradict the map ──▶ SEARCHING ── one place fits ──▶ TRACKING
                                              │      ▲
                               several fit    ▼      │ it sees more
                                             AMBIGUOUS

While it searches it's best to turn on the spot once (`wants_turn`); driving on does, too, if it takes longer.
"""

from __future__ import annotations

import enum
import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Annotated, NamedTuple

import numpy as np

from robots.onboard.global_localization import Candidate, SearchConfig, locate
from robots.onboard.gsp_map import GspMap
from robots.onboard.laser import LaserScan, OdometryTrack
from robots.onboard.line_filter import evidence
from robots.onboard.localization import LocalizationConfig, Tracker
from robots.onboard.map_building import Surveyor
from vrs.checks import validated, within
from vrs.mobile.model import composed
from vrs.model import Array, frozen_array

UNKNOWN = frozen_array(np.diag([1e4, 1e4, 10.0]))
"""Covariance of a posture that isn't known."""
_KEPT_EVENTS = 1000
_MOSTLY = 0.5


class Status(enum.StrEnum):
    """What a localizer knows."""

    TRACKING = "tracking"
    """It knows where it is."""
    SEARCHING = "searching"
    """It doesn't."""
    AMBIGUOUS = "ambiguous"
    """It may be at several places, and says at which."""


class Event(NamedTuple):
    """A change of what is known."""

    time: float
    """[s]."""
    status: Status
    """From then on."""


@dataclass(frozen=True, slots=True)
@validated
class LocalizerConfig:
    """When it's lost, and when it searches."""

    localization: LocalizationConfig = field(default_factory=LocalizationConfig)
    """Of tracking."""
    search: SearchConfig = field(default_factory=SearchConfig)
    """Of looking for its place."""
    through: Annotated[float, within(0.0, 1.0)] = 0.1
    """A scan contradicts if a larger share of its beams goes through walls, in [0, 1]."""
    explained: Annotated[float, within(0.0, 1.0)] = 0.1
    """Or if a smaller one is explained by the map, in [0, 1]."""
    contradicted: Annotated[float, within(0.1, 60.0)] = 1.4
    """It's lost if three of four scans contradicted for so long [s], in [0.1, 60]."""
    unexplained: Annotated[float, within(0.1, 60.0)] = 2.4
    """The same where nothing goes through walls: people may stand around it [s], in [0.1, 60]."""
    back: Annotated[float, within(0.0, 1.0)] = 0.6
    """It wasn't carried off after all if such a share of the beams is explained, in [0, 1]."""
    back_through: Annotated[float, within(0.0, 1.0)] = 0.02
    """And no larger one goes through walls, in [0, 1]."""
    back_scans: Annotated[int, within(1, 1000)] = 5
    """In so many scans one after the other, in [1, 1000]."""
    every: Annotated[float, within(0.05, 60.0)] = 1.0
    """It looks for its place each so many seconds, in [0.05, 60]."""
    scans: Annotated[int, within(2, 120)] = 24
    """It looks after a turn on the spot, or after so many scans from different places, in [2, 120]."""
    patience: Annotated[float, within(0.1, 600.0)] = 12.0
    """After so long it looks with whatever it has [s], in [0.1, 600]: perhaps the robot can't turn."""
    confirmed: Annotated[float, within(0.0, 1.0)] = 0.25
    """A place counts if the last scan is explained there by this share, in [0, 1]."""
    place_doubt: Annotated[float, within(1e-4, 10.0)] = 0.02
    """Standard deviation of a posture to begin with, unless its covariance is given [m], in [1e-4, 10]."""
    turn_doubt: Annotated[float, within(1e-4, 3.0)] = math.radians(1)
    """And of its heading [rad], in [1e-4, 3]."""


class Localizer:
    """Takes odometry and scans as they come; it knows no clock."""

    def __init__(
        self,
        known: GspMap,
        posture: tuple[float, float, float] | None = None,
        covariance: Array | None = None,
        config: LocalizerConfig | None = None,
    ) -> None:
        """Begin somewhere.

        Args:
            known: The map.
            posture: Where the robot is, (x, y, θ) [m, m, rad]; it searches if that isn't known.
            covariance: Of it, (3, 3); the config's unless given.
            config: When it's lost, and when it searches.
        """
        self._known = known
        self._config = config = LocalizerConfig() if config is None else config
        self.odometry = OdometryTrack()
        self.tracker: Tracker | None = None
        """What follows the robot; None before it was ever known where that is."""
        self._surveyor: Surveyor | None = None
        self._verdicts: deque[tuple[float, bool, bool]] = deque()
        self._looked = self._since = -math.inf
        self._good = 0
        self._candidates: tuple[Candidate, ...] = ()
        self.events: deque[Event] = deque(maxlen=_KEPT_EVENTS)
        """What changed, the newest last."""
        self.status = Status.SEARCHING
        """What is known."""
        if posture is None:
            self._surveyor = Surveyor()
        else:
            place, turn = config.place_doubt**2, config.turn_doubt**2
            doubt = np.diag([place, place, turn]) if covariance is None else covariance
            self.tracker = Tracker(known, posture, doubt, config.localization)
            self.status = Status.TRACKING

    @property
    def posture(self) -> tuple[float, float, float] | None:
        """Where the robot is, (x, y, θ) [m, m, rad]; by dead reckoning while it searches; None if never known."""
        return None if self.tracker is None else self.tracker.posture

    @property
    def covariance(self) -> Array:
        """Of the posture, (3, 3); huge while it searches."""
        tracking = self.status is Status.TRACKING and self.tracker is not None
        return self.tracker.covariance if tracking and self.tracker is not None else UNKNOWN

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Where the robot may be now, the likeliest first, if that's ambiguous."""
        if self.status is not Status.AMBIGUOUS or self._surveyor is None:
            return ()
        here = self._surveyor.builder.posture
        return tuple(replace(one, posture=composed(one.posture, here)) for one in self._candidates)

    @property
    def wants_turn(self) -> bool:
        """Whether a turn on the spot would help."""
        return self._surveyor is not None and self._surveyor.seen_around < 1.0

    def move(self, time: float, reading: tuple[float, float, float]) -> None:
        """Take a reading of the odometry, in its own frame, θ counted on; one that isn't newer is no news."""
        self.odometry.add(time, reading)
        if self._since == -math.inf:
            self._since = time
        for part in (self.tracker, self._surveyor):
            if part is not None:
                part.move(time, reading)

    def see(self, scan: LaserScan) -> bool:
        """Take in a scan; returns whether it was: not if it isn't new, or the odometry doesn't cover it yet."""
        if not self.odometry.takes(scan):
            return False
        tracker, surveyor = self.tracker, self._surveyor
        if tracker is not None:
            tracker.see(scan)
        if surveyor is not None:
            surveyor.see(scan)
            if tracker is not None and self._is_back(tracker):
                self._found(tracker)
            else:
                self._look()
        elif tracker is not None and self._is_lost(tracker):
            self._surveyor, self._candidates = Surveyor(), ()
            self._looked = self._since = self.odometry.time
            self._good = 0
            self._becomes(Status.SEARCHING)
        return True

    def _is_back(self, tracker: Tracker) -> bool:
        """Whether scans fit again where the robot would be if it hadn't been carried off."""
        found, config = tracker.evidence, self._config
        fits = found.explained >= config.back and found.through <= config.back_through
        self._good = self._good + 1 if fits else 0
        return self._good >= config.back_scans

    def _found(self, tracker: Tracker) -> None:
        """Track on."""
        self.tracker, self._surveyor = tracker, None
        self._verdicts.clear()
        self._becomes(Status.TRACKING)

    def _becomes(self, status: Status) -> None:
        if status is not self.status:
            self.status = status
            self.events.append(Event(self.odometry.time, status))

    def _is_lost(self, tracker: Tracker) -> bool:
        """Whether scans have contradicted the map for long enough."""
        config, now, found = self._config, self.odometry.time, tracker.evidence
        through = found.through > config.through
        # Where the map has nothing, nothing can be unexplained.
        unexplained = found.blank < _MOSTLY and found.explained < config.explained * (1 - found.blank)
        self._verdicts.append((now, through, through or unexplained))
        longest = max(config.contradicted, config.unexplained)
        while self._verdicts[0][0] < now - longest - 1.0:
            self._verdicts.popleft()
        return self._mostly(1, config.contradicted) or self._mostly(2, config.unexplained)

    def _mostly(self, which: int, lasting: float) -> bool:
        """Whether three of four verdicts since so long ago [s] are bad, the first and the last among them."""
        since = self.odometry.time - lasting
        verdicts = [one for one in self._verdicts if one[0] >= since - 1e-9]
        bad = [one for one in verdicts if one[which]]
        whole = len(self._verdicts) > len(verdicts) or self._verdicts[0][0] <= since + 0.25
        return whole and 4 * len(bad) >= 3 * len(verdicts) and len(bad) >= 3 and bool(verdicts[-1][which])

    def _look(self) -> None:
        """Look for the place, if there's enough to look at."""
        surveyor, config, now = self._surveyor, self._config, self.odometry.time
        assert surveyor is not None
        if now < self._looked + config.every - 1e-9:
            return
        enough = surveyor.seen_around >= 1.0 or surveyor.scans >= config.scans
        if not enough and now < self._since + config.patience:
            return
        self._looked = now
        places = self._candidates = self._located(surveyor)
        if len(places) != 1:
            self._becomes(Status.AMBIGUOUS if places else Status.SEARCHING)
        elif self._confirmed(places[0], surveyor):
            self._go_on(places[0], surveyor)
        else:
            self._surveyor = Surveyor()

    def _located(self, surveyor: Surveyor) -> tuple[Candidate, ...]:
        """Where it may be, by all that it has seen."""
        return locate(self._known, surveyor.surroundings(), self._config.search)

    def _confirmed(self, place: Candidate, surveyor: Surveyor) -> bool:
        """Whether the last scan fits there, too: a robot that was held has lost itself in its own frame."""
        config, builder = self._config, surveyor.builder
        assert builder.points is not None
        here = composed(place.posture, builder.posture)
        found = evidence(self._known.lines, builder.points, here, builder.noise)
        return found.through <= config.through and found.explained >= config.confirmed

    def _go_on(self, place: Candidate, surveyor: Surveyor) -> None:
        """Track from a place on."""
        builder = surveyor.builder
        posture = composed(place.posture, builder.posture)
        doubt = compounded(place.posture, place.covariance, builder.posture, builder.covariance)
        self.tracker = tracker = Tracker(self._known, posture, doubt, self._config.localization)
        newest = self.odometry.newest
        assert newest is not None
        tracker.move(self.odometry.time, newest)
        tracker.noise = builder.noise
        self._found(tracker)


def compounded(
    a: tuple[float, float, float], doubt_a: Array, b: tuple[float, float, float], doubt_b: Array
) -> Array:
    """Covariance of `composed`, for two postures whose errors have nothing to do with each other, (3, 3)."""
    c, s = math.cos(a[2]), math.sin(a[2])
    A = np.array([[1.0, 0.0, -s * b[0] - c * b[1]], [0.0, 1.0, c * b[0] - s * b[1]], [0.0, 0.0, 1.0]])
    B = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(A @ doubt_a @ A.T + B @ doubt_b @ B.T)
