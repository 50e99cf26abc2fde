"""Where a robot is if nobody knows: the lines around it against the map's, then every beam against what they say.

Two lines around the robot that aren't parallel, taken for two of the map, say where it would be. All such guesses
in which the seen lines lie on the map's vote; places with many votes are refined by least squares and held against
the scans beam by beam. A beam that ends too soon met something that the map hasn't got, one that goes through a
wall speaks against the place. If the next best place, elsewhere, is nearly as likely, the answer is *ambiguous*,
with all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from robots.onboard.gsp_map import GspMap, Lines
from robots.onboard.line_filter import Evidence, LineFilter, MatchingConfig, expected_ranges, judged, matched
from vrs.checks import validated, within
from vrs.mobile import wrapped
from vrs.mobile.model import all_wrapped
from vrs.model import Array, frozen_array


@dataclass(frozen=True, slots=True)
@validated
class SearchConfig:
    """How places are looked for and judged."""

    lines: Annotated[int, within(2, 100)] = 14
    """Longest lines around the robot that vote, in [2, 100]."""
    shortest: Annotated[float, within(0.1, 10.0)] = 0.4
    """Shorter ones don't [m], in [0.1, 10]."""
    crossing: Annotated[float, within(0.1, 1.5)] = 0.5
    """Two lines that cross at a smaller angle don't make a guess [rad], in [0.1, 1.5]."""
    agree: Annotated[float, within(0.01, 0.5)] = 0.09
    """Their angle may differ from the map's by so much [rad], in [0.01, 0.5]."""
    inside: Annotated[float, within(0.0, 1.0)] = 0.75
    """Share of a seen line that must lie on the map's, in [0, 1]."""
    slack: Annotated[float, within(0.0, 2.0)] = 0.2
    """By how much the ends of lines may be off [m], in [0, 2]."""
    cell: Annotated[float, within(0.05, 2.0)] = 0.3
    """Guesses so near each other are one [m], in [0.05, 2]; the headings within 10 deg."""
    refined: Annotated[int, within(2, 1000)] = 60
    """Places that are looked at closely, in [2, 1000]."""
    beams: Annotated[int, within(20, 5000)] = 360
    """Beams that they are held against, in [20, 5000]."""
    apart: Annotated[float, within(0.05, 10.0)] = 0.5
    """Places this far apart are different [m], in [0.05, 10]."""
    apart_turn: Annotated[float, within(0.01, 1.0)] = math.radians(15)
    """Or turned by so much [rad], in [0.01, 1]."""
    worth: Annotated[float, within(1.0, 1000.0)] = 40.0
    """How many independent beams all of them are worth, in [1, 1000]: neighbours see the same things."""
    odds: Annotated[float, within(1.0, 1e9)] = 100.0
    """A place is the only one if it's so many times likelier than any other, in [1, 1e9]."""
    explained: Annotated[float, within(0.0, 1.0)] = 0.4
    """Least share of beams that must be explained, in [0, 1]."""
    blank: Annotated[float, within(0.0, 1.0)] = 0.1
    """Largest share of beams that may look where the map has nothing, in [0, 1]."""
    through: Annotated[float, within(0.0, 1.0)] = 0.06
    """Largest share of beams that may go through walls, in [0, 1]."""
    place_doubt: Annotated[float, within(0.01, 2.0)] = 0.15
    """Standard deviation of a guess before it's refined [m], in [0.01, 2]."""
    turn_doubt: Annotated[float, within(0.01, 1.0)] = 0.06
    """And of its heading [rad], in [0.01, 1]."""
    matching: MatchingConfig = field(default_factory=MatchingConfig)
    """Which lines are the same when places are refined."""


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """What a robot saw from some places near each other, in a frame of its own."""

    lines: Lines
    """The free side on the left, with their doubt."""
    origins: Array
    """Where beams begin [m], (k, 2)."""
    ways: Array
    """Their directions, (k, 2)."""
    ranges: Array
    """How far they went [m], (k,)."""
    noise: float
    """Standard deviation of a range [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A place where the robot may be."""

    posture: tuple[float, float, float]
    """Of the surroundings' frame in the world, (x, y, θ) [m, m, rad]."""
    covariance: Array
    """Of that, (3, 3)."""
    evidence: Evidence
    """What of the beams it explains."""
    score: float
    """Mean logarithm of the likelihood of a beam."""


def locate(known: GspMap, around: Surroundings, config: SearchConfig | None = None) -> tuple[Candidate, ...]:
    """Look for the places of a map where a robot may be.

    Args:
        known: The map.
        around: What it saw.
        config: How places are looked for.

    Returns:
        The best first: none where nothing fits, one if that's the place, more if it may be any of them.
    """
    config = SearchConfig() if config is None else config
    beams = _spread(around, config.beams)
    rough = _spread(around, max(20, config.beams // 4))
    places = _voted(guesses(known.lines, around.lines, config), config)
    if not len(places):
        return ()
    scores = [_judged(known, rough, tuple(place.tolist()))[1] for place in places]
    best = np.argsort(scores)[::-1][: config.refined]
    candidates = [_refined(known, around, beams, tuple(places[k].tolist()), config) for k in best]
    return decided(candidates, config)


def decided(candidates: list[Candidate], config: SearchConfig) -> tuple[Candidate, ...]:
    """Choose among candidates: the best, if it fits, and those elsewhere that are not much less likely."""
    ordered = sorted(candidates, key=lambda one: -one.score)
    if not ordered or not _fits(ordered[0].evidence, config):
        return ()
    chosen: list[Candidate] = []
    least = ordered[0].score - math.log(config.odds) / config.worth
    for one in ordered:
        if one.score >= least and all(_elsewhere(one, other, config) for other in chosen):
            chosen.append(one)
    return tuple(chosen)


def _fits(found: Evidence, config: SearchConfig) -> bool:
    enough = found.explained >= config.explained
    return enough and found.through <= config.through and found.blank <= config.blank


def _elsewhere(one: Candidate, other: Candidate, config: SearchConfig) -> bool:
    (x, y, theta), (ox, oy, other_theta) = one.posture, other.posture
    turned = abs(wrapped(theta - other_theta)) >= config.apart_turn
    return turned or math.hypot(x - ox, y - oy) >= config.apart


def guesses(known: Lines, seen: Lines, config: SearchConfig) -> Array:
    """Where the robot would be, for each two seen lines taken for two of the map.

    Returns:
        x, y, θ [m, m, rad] and a weight, the shorter line's length, (k, 4).
    """
    long = np.flatnonzero(seen.lengths >= config.shortest)
    chosen = seen.taken(long[np.argsort(-seen.lengths[long], kind="stable")[: config.lines]])
    found = [np.zeros((0, 4))]
    for a in range(len(chosen)):
        for b in range(a + 1, len(chosen)):
            corner = wrapped(float(chosen.poses[b, 2] - chosen.poses[a, 2]))
            if abs(math.sin(corner)) >= math.sin(config.crossing):
                found.append(_guessed(known, chosen.taken(np.array([a, b])), corner, config))
    return np.vstack(found)


def _guessed(known: Lines, two: Lines, corner: float, config: SearchConfig) -> Array:
    """Postures for two lines, against all pairs of the map that cross at the same angle."""
    directions = known.poses[:, 2]
    angle = all_wrapped(directions[None, :] - directions[:, None] - corner)
    fits = np.abs(angle) < config.agree
    fits &= (two.lengths[0] <= known.lengths + 2 * config.slack)[:, None]
    fits &= (two.lengths[1] <= known.lengths + 2 * config.slack)[None, :]
    i, j = np.nonzero(fits)
    if not len(i):
        return np.zeros((0, 4))
    # The longer line tells the heading better.
    share = two.lengths[1] / two.lengths.sum()
    theta = directions[i] - two.poses[0, 2] + share * angle[i, j]
    c, s = np.cos(theta), np.sin(theta)
    n_i, n_j = known.normals[i], known.normals[j]
    moved = [np.column_stack([c * x - s * y, s * x + c * y]) for x, y, _ in two.poses.tolist()]
    d_i = np.sum(n_i * (known.poses[i, :2] - moved[0]), axis=1)
    d_j = np.sum(n_j * (known.poses[j, :2] - moved[1]), axis=1)
    det = n_i[:, 0] * n_j[:, 1] - n_i[:, 1] * n_j[:, 0]
    x = (d_i * n_j[:, 1] - d_j * n_i[:, 1]) / det
    y = (d_j * n_i[:, 0] - d_i * n_j[:, 0]) / det
    place = np.column_stack([x, y])
    on = np.ones(len(i), dtype=np.bool_)
    for k, of in ((0, i), (1, j)):
        along = np.sum((place + moved[k] - known.poses[of, :2]) * known.directions[of], axis=1)
        low = np.maximum(along + two.spans[k, 0], known.spans[of, 0] - config.slack)
        high = np.minimum(along + two.spans[k, 1], known.spans[of, 1] + config.slack)
        on &= high - low >= config.inside * two.lengths[k]
    weight = np.full(int(on.sum()), two.lengths.min())
    return np.column_stack([place[on], np.remainder(theta[on], math.tau), weight])


def _voted(found: Array, config: SearchConfig) -> Array:
    """The places with the most votes, means of what voted, (k, 3)."""
    if not len(found):
        return np.zeros((0, 3))
    turns = 36
    cells = np.column_stack([
        np.floor(found[:, :2] / config.cell), np.floor(found[:, 2] * turns / math.tau) % turns
    ])  # fmt: skip
    _, at = np.unique(cells, axis=0, return_inverse=True)
    at = at.ravel()
    votes = np.bincount(at, found[:, 3])
    # The first of a cell is what its headings are counted from: they don't jump by a turn in it.
    first = np.full(len(votes), len(at))
    np.minimum.at(first, at, np.arange(len(at)))
    base = found[first, 2]
    turn = all_wrapped(found[:, 2] - base[at])
    sums = [np.bincount(at, found[:, 3] * value) / votes for value in (found[:, 0], found[:, 1], turn)]
    order = np.argsort(-votes, kind="stable")[: 8 * config.refined]
    return np.column_stack([sums[0], sums[1], base + sums[2]])[order]


def _spread(around: Surroundings, count: int) -> Surroundings:
    """The same with so many beams at most."""
    step = max(1, math.ceil(len(around.ranges) / count))
    return Surroundings(
        around.lines, around.origins[::step], around.ways[::step], around.ranges[::step], around.noise
    )


def _judged(known: GspMap, beams: Surroundings, posture: tuple[float, ...]) -> tuple[Evidence, float]:
    x, y, theta = posture
    expected = expected_ranges(known.lines, beams.origins, beams.ways, (x, y, theta))
    difference = beams.ranges - expected
    return judged(difference, beams.noise), log_likelihood(difference, beams.ranges, beams.noise)


def log_likelihood(difference: Array, ranges: Array, noise: float) -> float:
    """Mean logarithm of the likelihood of beams.

    Seven of ten beams end at the map's line, with a spread of 3 cm and the noise; a quarter end before it,
    anywhere; the rest end anywhere at all.

    Args:
        difference: How much farther they went than the map says [m], (k,), −inf where it has nothing there.
        ranges: How far they went [m], (k,).
        noise: Standard deviation of a range [m].
    """
    spread = math.hypot(0.03, noise)
    expected = np.where(np.isfinite(difference), ranges - difference, 8.0)
    hit = (
        0.7
        * np.exp(-0.5 * (np.where(np.isfinite(difference), difference, 1e3) / spread) ** 2)
        / (math.sqrt(math.tau) * spread)
    )
    before = np.where(difference < 0, 0.25 / np.maximum(expected, 0.3), 0.0)
    return float(np.mean(np.log(hit + before + 0.05 / 8.0)))


def _refined(
    known: GspMap, around: Surroundings, beams: Surroundings, place: tuple[float, ...], config: SearchConfig
) -> Candidate:
    """A place after least squares with all lines that can be recognised from it."""
    x, y, theta = place
    doubt = np.diag([config.place_doubt**2, config.place_doubt**2, config.turn_doubt**2])
    held = LineFilter((x, y, theta), doubt, known)
    for widen in (1.0, 0.2):
        fresh = LineFilter(held.posture, widen * widen * doubt, known)
        fresh.correct(matched(fresh, around.lines, config.matching))
        held = fresh
    found, score = _judged(known, beams, held.posture)
    return Candidate(held.posture, frozen_array(held.covariance), found, score)
