"""Numerical inverse kinematics of joints in a row: the Toolbox's Levenberg-Marquardt, then Newton's method.

Where the joints can give the tool any small motion, a pose is a constraint of six rows. More joints than that
stay as near to given ones as they can, by the scale of `vrs.planning.redundancy`, which stretches towards their
limits. Where the joints can't, the position is the constraint, of three rows, and of all joint values that keep it
those are sought whose orientation is the nearest.

Both are one problem, a minimum under constraints, whose conditions Newton's method solves: a solution depends on
the pose and on the joints that it's to be near to, not on the way there, and is smooth in both, as lines need it.
Source: Nocedal, Wright, Numerical Optimization, 2006, ch. 18.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, tau
from typing import Final

import numpy as np
from scipy.linalg import lapack

from robots.description.geometry import Geometry, compiled
from vrs.errors import UnreachablePoseError
from vrs.model import Array, Limits, for_people
from vrs.planning.path import rotation_vector
from vrs.planning.redundancy import TASK, scaled, stiffness, stretched, units

RESIDUAL: Final = 1e-9
"""How far from its pose a solution may be [m, rad]."""
STARTS: Final = 32
"""Joint values that are started from before a pose counts as out of reach."""
_SAMPLES: Final = 512
"""Joint values whose poses are known, to start from the nearest of them."""
_SETTLED: Final = 1e-7
"""Step [rad] after which Newton's next one is below rounding."""
_ROUGHLY: Final = 2e-2
"""The same where a redundant arm's joints needn't be the very nearest."""
_STEPS: Final = 20
_LONGEST: Final = 0.5
"""Longest step [rad, lengths]."""
_ROUGH: Final = 6
"""Steps from afar that leave the curvature of the constraints out, as that may lead to a saddle."""
_STIFF, _STIFFEST = 6.0, 70.0
"""Stiffness from which on a redundant arm lets other joints bear a pose: at 70 % of the way from the middle of its
range to a limit, and at 97 % where the pose is far away."""
_TOGETHER: Final = 0.4
"""How far joints may go from one pose of a path to the next before it's divided [rad, lengths]."""
_HALVINGS: Final = 10
_ALIKE: Final = 1e-6
"""Difference of joint values under which two solutions are one."""
_LITTLE: Final = 1e-3
"""What nearness to given joints counts beside an orientation that can't be reached."""
_CORRECTIONS: Final = 4
_EXACT: Final = 1e-11
_ENOUGH: Final = 4
"""Solutions of a position among which the nearest orientation is taken."""
_HELD: Final = 8
"""Solutions beyond the limits that a redundant arm tries to bring back."""
_LOOKS: Final = 16
"""Joint values at which it's looked how many of a pose's rows they can change."""
_LESS: Final = 0.1
"""What a turn counts beside a way where orientations aren't reached."""
_MASKS: Final = {TASK: np.ones(TASK), 3: np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])}
"""Rows of a pose that count, by their number."""


class Inverse:
    """Finds joint values of poses of a tip."""

    def __init__(self, chain: Geometry, limits: Limits, prismatic: tuple[int, ...], length: float) -> None:
        """Prepare it.

        Args:
            chain: The joints.
            limits: Their limits.
            prismatic: Which of them slide.
            length: By which lengths are divided to be compared with angles [m].
        """
        self._chain, self._limits, self._prismatic, self._length = chain, limits, prismatic, length
        n = self._n = limits.dof
        self._unit = units(prismatic, n, length)
        self._weight = 1.0 / self._unit**2
        self._ranges = limits.q_min.tolist(), limits.q_max.tolist()
        self._turns = [0.0 if j in prismatic else tau for j in range(n)]
        rng = np.random.default_rng(0)
        self._samples = rng.uniform(limits.q_min, limits.q_max, (_SAMPLES, n))
        self._poses = chain.frames(self._samples)[:, -1]
        J = chain.jacobian(self._samples[:_LOOKS])
        J[:, :3] /= length
        J *= self._unit
        self.rank, self.position = (int(np.linalg.matrix_rank(part, rtol=1e-6).max()) for part in (J, J[:, :3]))
        self._full = self.rank == TASK
        self._rows = TASK if self._full else 3
        self._redundant = n > self.rank
        # Squares of distances to a pose, but for what's the same for all: from the way, and from the turn.
        p, R = self._poses[:, :3, 3], self._poses[:, :3, :3].reshape(-1, 9)
        self._away = (p * p).sum(1) / length**2
        self._towards = np.concatenate([-2.0 * p / length**2, -R if self._full else -_LESS * R], axis=1)

    def near(self, X: Array, q: Array) -> Array:
        """Return joint values of a pose within the limits, (n,), the nearest to q, (n,), that are found.

        Raises:
            UnreachablePoseError: If none are found.
        """
        if not self._full:
            return self._nearest_orientation(X, q)
        beyond: list[Array] = []
        for k, start in enumerate(self._starts(X, q)):
            guess = self._guess(X, start, q)
            if guess is None:
                continue
            # Near to q a redundant arm's other joints help first; from afar another start is sooner tried.
            close = k == 0 and float((np.abs(guess - q) / self._unit).max()) < _LONGEST
            there = self._inside(X, guess, q) if close else self._admitted(X, guess, q, _STIFFEST)
            if there is not None:
                return there
            beyond.append(guess)
        for guess in beyond[:_HELD] if self._redundant else ():
            there = self._inside(X, guess, q)
            if there is not None:
                return there
        raise UnreachablePoseError(self._obstacle(X, beyond))

    def _nearest_orientation(self, X: Array, q: Array) -> Array:
        """Joint values whose position is a pose's, of the orientation that is nearest to its."""
        best, least, found, beyond = q, np.inf, 0, []
        for start in self._starts(X, q):
            for rows in (TASK, 3):
                guess = self._guess(X, start, q, rows)
                there = None
                if guess is not None and rows == TASK and self._n == self.rank:
                    there = self._corrected(X, guess)
                if guess is not None and there is None:
                    there = self.settled(X, guess, stretched(q, self._limits), rough=_ROUGH)
                if there is None:
                    continue
                there = self._turned_to(there, q)
                if self._violated(there):
                    beyond.append(there)
                    continue
                found += 1
                miss = self._miss(X, there)
                if miss < least - _ALIKE:
                    best, least = there, miss
                break
            if least < _ALIKE or found >= _ENOUGH:
                break
        if not found:
            raise UnreachablePoseError(self._obstacle(X, beyond))
        return best

    def some(self, X: Array, *, within_limits: bool) -> Array:
        """Return joint values of a pose that are found from `STARTS` places, (m, n)."""
        found: list[Array] = []
        for start in self._starts(X, 0.5 * (self._limits.q_min + self._limits.q_max)):
            guess = self._guess(X, start, start, TASK if self._full else 3)
            if guess is None:
                continue
            if self._full:
                there = self._inside(X, guess, start) if within_limits else self._corrected(X, guess)
            else:
                there = self.settled(X, guess, stretched(start, self._limits), rough=_ROUGH)
                if there is not None and within_limits and self._violated(there := self._turned_to(there, start)):
                    there = None
            if there is not None and not any(np.abs(there - other).max() < _ALIKE for other in found):
                found.append(there)
        return np.array(sorted(found, key=lambda q: q.tolist())).reshape(-1, self._n)

    def along(self, X: Array, q: Array, goal: Array | None) -> Array:
        """Return joint values of poses in a row, (k, n), that go on from q, (n,); see `RobotModel.follow`.

        Args:
            X: The poses, (k, 4, 4).
            q: Joint values to go on from, (n,).
            goal: Those to arrive at, (n,), of a redundant arm; None stays as near to q as the poses allow.
        """
        found = np.full((len(X), self._n), np.nan)
        wanted = np.broadcast_to(stretched(q, self._limits), found.shape)
        if goal is not None and self._redundant:
            share = self._shares(X, q, goal)[:, None]
            wanted = wanted + share * (stretched(goal, self._limits) - stretched(q, self._limits))
        last, before = q, compiled(self._chain).forward(q)
        mark = stretched(q, self._limits)
        for k, pose in enumerate(X):
            there = self._onward(before, pose, last, mark, wanted[k], _HALVINGS)
            if there is None:
                break
            found[k], last, before, mark = there, there, pose, wanted[k]
        return found

    def _starts(self, X: Array, q: Array) -> Iterator[Array]:
        """Yield joint values to start from: q, then those whose poses are known, the nearest first."""
        yield q
        away = self._away + self._towards @ np.concatenate([X[:3, 3], X[:3, :3].ravel()])
        first = int(away.argmin())
        yield self._samples[first]
        for k in np.argsort(away, kind="stable")[:STARTS]:
            if k != first:
                yield self._samples[k]

    def _guess(self, X: Array, start: Array, q: Array, rows: int = TASK) -> Array | None:
        """Joint values of a pose, or of its position alone, found from a start, on the turns nearest to q.

        Those of a redundant arm are close to it, as `_admitted` leads them elsewhere.
        """
        if self._chain.follows:
            there = self.settled(X, start, stretched(start, self._limits), rough=_STEPS)
        else:
            there = compiled(self._chain).solve(X, start, _MASKS[rows])
            if there is not None and self._full and not self._redundant:
                there = self._corrected(X, there)
        return None if there is None else self._turned_to(there, q)

    def _corrected(self, X: Array, q: Array) -> Array | None:
        """The joint values of a pose next to some that are all but that."""
        chain, p, RT = compiled(self._chain), X[:3, 3], X[:3, :3].T
        for _ in range(_CORRECTIONS):
            T = chain.forward(q)
            x, y, z = (T[:3, 3] - p).tolist()
            c = (x, y, z, *_sine(T[:3, :3] @ RT))
            if max(map(abs, c)) < _EXACT:
                return q
            J, miss = chain.jacobian(q), np.array(c)
            if self._n == TASK:
                q = q - _linear(J, miss)
            elif self._n > TASK:
                q = q - J.T @ _linear(J @ J.T, miss)
            else:
                q = q - _linear(J.T @ J, J.T @ miss)
        return None

    def _turned_to(self, q: Array, near: Array) -> Array:
        """The same angles on the turns nearest to others that the limits admit, if any."""
        found = []
        for angle, reference, low, high, turn in zip(
            q.tolist(), near.tolist(), *self._ranges, self._turns, strict=True
        ):
            least, most = low - RESIDUAL, high + RESIDUAL
            value = angle + turn * round((reference - angle) / (turn or 1.0))
            if turn and not least <= value <= most:
                over = ceil((least - value) / turn) if value < least else -ceil((value - most) / turn)
                if least <= value + turn * over <= most:
                    value += turn * over
            found.append(min(max(value, low), high) if least <= value <= most else value)
        return np.array(found)

    def _violated(self, q: Array) -> bool:
        """Whether a joint is beyond its limits."""
        return any(not low <= value <= high for value, low, high in zip(q.tolist(), *self._ranges, strict=True))

    def _admitted(self, X: Array, q: Array, near: Array, stiff: float = _STIFF) -> Array | None:
        """Joint values of a pose, if within the limits; a redundant arm's are led away from them."""
        if self._violated(q):
            return None
        if not self._redundant:
            return q
        if float(stiffness(q, self._limits).max()) >= stiff:
            there = self.settled(
                X, q, stretched(near, self._limits), rough=_ROUGH if stiff > _STIFF else 1, within=_ROUGHLY
            )
            there = None if there is None else self._corrected(X, there)
            if there is not None and not self._violated(there):
                return there
        there = self._corrected(X, q)
        return None if there is None or self._violated(there) else there

    def _inside(self, X: Array, q: Array, near: Array) -> Array | None:
        """Joint values of a pose within the limits; of a redundant arm those that pass them are held at them."""
        there = self._admitted(X, q, near)
        if there is not None or not self._redundant:
            return there
        low, high, wanted = self._limits.q_min, self._limits.q_max, stretched(near, self._limits)
        free = np.ones(self._n, dtype=bool)
        while int(free.sum()) >= self.rank:
            held = self.settled(X, np.clip(q, low, high), wanted, rough=_ROUGH, free=free)
            if held is None:
                return None
            q = self._turned_to(held, near)
            past = np.maximum(q - high, low - q) / self._unit
            if float(past.max()) <= 0.0:
                return q
            free[int(past.argmax())] = False
        return None

    def settled(
        self,
        X: Array,
        q: Array,
        wanted: Array,
        *,
        rough: int = 0,
        free: Array | None = None,
        within: float = _SETTLED,
    ) -> Array | None:
        """Return joint values of a pose, by Newton's method from values near them, or None.

        Args:
            X: The pose, (4, 4).
            q: Joint values to begin with, (n,).
            wanted: What a redundant arm's are to be near to, on the scale of `stretched`, (n,).
            rough: For how many steps curvature is left out.
            free: Which joints may move, (n,); all unless given.
            within: Step after which it's good enough [rad, lengths].
        """
        chain, rows = compiled(self._chain), self._rows
        n = self._n if free is None else int(free.sum())
        curves = not self._full or n > TASK
        p, RT = X[:3, 3], X[:3, :3].T
        K = np.zeros((n + rows, n + rows))
        right = np.empty(n + rows)
        pull = np.zeros(TASK)
        for k in range(_STEPS):
            T, J = chain.forward(q), chain.jacobian(q)
            M = T[:3, :3] @ RT
            c = np.array((*(T[:3, 3] - p).tolist(), *_sine(M)))
            if not curves:
                step = _linear(J if free is None else J[:, free], -c)
            else:
                if not self._full:
                    pull[3:] = c[3:]
                H, slope = self._objective(q, J, M, c, wanted, exact=k >= rough)
                if k >= rough:
                    H += chain.curvature(q, pull)
                A = J[:rows]
                if free is not None:
                    H, slope, A = H[np.ix_(free, free)], slope[free], A[:, free]
                K[:n, :n], K[:n, n:], K[n:, :n] = H, A.T, A
                right[:n], right[n:] = -slope, -c[:rows]
                solved = _linear(K, right)
                step, pull[:rows] = solved[:n], solved[n:]
            if free is not None:
                whole = np.zeros(self._n)
                whole[free] = step
                step = whole
            size = float((np.abs(step) / self._unit).max())
            if not size < np.inf:
                return None
            if size > _LONGEST:
                step = step * (_LONGEST / size)
                pull[:] = 0.0
            q = q + step
            if size < within:
                return q if within > _SETTLED or self._kept(X, q) else None
        return None

    def _objective(
        self, q: Array, J: Array, M: Array, c: Array, wanted: Array, *, exact: bool
    ) -> tuple[Array, Array]:
        """Hessian, (n, n), and gradient, (n,), of what is least: distance from what is wanted, or the turn."""
        scale, stiff = scaled(q, self._limits)
        H = np.zeros((self._n, self._n))
        H.flat[:: self._n + 1] = self._weight * stiff
        slope = self._weight * (scale - wanted)
        if self._full:
            return H, slope
        w = J[3:]
        if exact:
            turn = w.T @ (0.5 * (float(np.trace(M)) * np.eye(3) - M)) @ w
            turn = 0.5 * (turn + turn.T)
        else:
            turn = w.T @ w
        near = _LITTLE if self._redundant else 0.0
        return turn + near * H, w.T @ c[3:] + near * slope

    def _kept(self, X: Array, q: Array) -> bool:
        """Whether the rows that bind are within `RESIDUAL` of a pose."""
        T = compiled(self._chain).forward(q)
        if not float(np.abs(T[:3, 3] - X[:3, 3]).max()) <= RESIDUAL:
            return False
        return not self._full or float(np.abs(T[:3, :3] - X[:3, :3]).max()) <= RESIDUAL

    def _miss(self, X: Array, q: Array) -> float:
        """By which angle the tip's orientation misses a pose's [rad]."""
        r = rotation_vector(compiled(self._chain).forward(q)[:3, :3] @ X[:3, :3].T)
        return float(np.sqrt(r @ r))

    def _onward(self, before: Array, X: Array, q: Array, mark: Array, wanted: Array, halvings: int) -> Array | None:
        """Joint values of a pose that go on from q, those of the pose before; None where they end."""
        there = self.settled(X, q, wanted)
        if there is not None and float((np.abs(there - q) / self._unit).max()) <= _TOGETHER:
            return there
        if not halvings:
            return None
        middle, between = _halfway(before, X), 0.5 * (mark + wanted)
        half = self._onward(before, middle, q, mark, between, halvings - 1)
        return None if half is None else self._onward(middle, X, half, between, wanted, halvings - 1)

    def _shares(self, X: Array, q: Array, goal: Array) -> Array:
        """How far along the straight way between the poses of two joint values others are, (k,)."""
        end = compiled(self._chain).forward(goal)

        def away(pose: Array) -> Array:
            return np.concatenate(
                [(pose[:3, 3] - end[:3, 3]) / self._length, rotation_vector(pose[:3, :3] @ end[:3, :3].T)]
            )

        way = away(compiled(self._chain).forward(q))
        size = float(way @ way)
        return np.array([1.0 - float(away(pose) @ way) / size if size else 1.0 for pose in X])

    def _obstacle(self, X: Array, beyond: list[Array]) -> str:
        """Why a pose has no joint values, those that were found but pass the limits given."""
        if beyond:
            low, high = self._limits.q_min, self._limits.q_max
            past = [np.maximum(q - high, low - q) / self._unit for q in beyond]
            least = min(range(len(past)), key=lambda k: float(past[k].max()))
            q, j = beyond[least], int(past[least].argmax())
            at, unit = for_people(j, float(q[j]), self._prismatic)
            most, _ = for_people(j, float((high if q[j] > high[j] else low)[j]), self._prismatic)
            return (
                f"no solution within the limits was found: joint {j + 1} would be at {at:.4g} {unit}, "
                f"beyond {most:.4g} {unit}"
            )
        away = np.sqrt(((self._poses[:, :3, 3] - X[:3, 3]) ** 2).sum(1).min())
        return (
            f"no solution was found from {STARTS} starts; of {_SAMPLES} places where the tip can be the nearest is "
            f"{away:.3g} m away"
        )


def _sine(M: Array) -> tuple[float, float, float]:
    """Axis of a rotation times the sine of its angle."""
    (_, xy, xz), (yx, _, yz), (zx, zy, _) = M.tolist()
    return 0.5 * (zy - yz), 0.5 * (xz - zx), 0.5 * (yx - xy)


def _linear(A: Array, b: Array) -> Array:
    """Solve equations; the least solution where they have several, or none."""
    _, _, x, info = lapack.dgesv(A, b)
    if info or not float(x @ x) < 1e12:
        if not np.isfinite(A).all():
            return np.full(len(b), np.nan)
        x = np.linalg.lstsq(A, b, rcond=1e-9)[0]
    return np.asarray(x)


def _halfway(X: Array, Y: Array) -> Array:
    """The pose in the middle between two."""
    from vrs.planning.path import rotations

    Z = np.array(Y)
    r = rotation_vector(Y[:3, :3] @ X[:3, :3].T)
    Z[:3, :3] = rotations(0.5 * r[None])[0] @ X[:3, :3]
    Z[:3, 3] = 0.5 * (X[:3, 3] + Y[:3, 3])
    return Z
