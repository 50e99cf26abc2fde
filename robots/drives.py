"""What PyBullet's joints lack: rotor inertia, and friction that can hold a joint still.

Over one step of length h the joint speeds go from v to v⁺ = v + h a, where

    (M + A) a = τ - c - B v⁺ - f,    f_i = f⁺_i if v⁺_i > 0, f⁻_i if v⁺_i < 0, in [f⁻_i, f⁺_i] if v⁺_i = 0,

M is the mass matrix, c gravity and velocity torques, A = diag(G² J_m), B viscous and f Coulomb friction. Both
frictions see the speed at the step's end, so they never turn a joint round, and a joint at rest stays there;
the solution is the only minimum of a strictly convex function. PyBullet's own joint gets τ - B v⁺ - f - A a
and so moves with the same a.

The symmetric linear equations of six joints are written out: between PyBullet's calls, NumPy and LAPACK cost three
times more.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import mul

import numpy as np

from vrs.errors import InvalidValueError


def solve_six(A: Sequence[Sequence[float]], d: Sequence[float], b: Sequence[float]) -> list[float]:
    """Solve (A + diag(d)) x = b by L D Lᵀ, for six unknowns.

    Args:
        A: Symmetric, (6, 6); only its lower triangle is read.
        d: What is added to the diagonal, 6 numbers; the sum is positive definite.
        b: Right side, 6 numbers.

    Returns:
        x, 6 numbers.

    Raises:
        ZeroDivisionError: If A + diag(d) is singular.
    """
    a00, _, _, _, _, _ = A[0]
    a10, a11, _, _, _, _ = A[1]
    a20, a21, a22, _, _, _ = A[2]
    a30, a31, a32, a33, _, _ = A[3]
    a40, a41, a42, a43, a44, _ = A[4]
    a50, a51, a52, a53, a54, a55 = A[5]
    d0, d1, d2, d3, d4, d5 = d
    x0, x1, x2, x3, x4, x5 = b
    r0 = 1.0 / (a00 + d0)
    l10 = a10 * r0
    r1 = 1.0 / (a11 + d1 - a10 * l10)
    x1 -= l10 * x0
    a21 -= a20 * l10
    l20 = a20 * r0
    l21 = a21 * r1
    r2 = 1.0 / (a22 + d2 - (a20 * l20 + a21 * l21))
    x2 -= l20 * x0 + l21 * x1
    a31 -= a30 * l10
    a32 -= a30 * l20 + a31 * l21
    l30 = a30 * r0
    l31 = a31 * r1
    l32 = a32 * r2
    r3 = 1.0 / (a33 + d3 - (a30 * l30 + a31 * l31 + a32 * l32))
    x3 -= l30 * x0 + l31 * x1 + l32 * x2
    a41 -= a40 * l10
    a42 -= a40 * l20 + a41 * l21
    a43 -= a40 * l30 + a41 * l31 + a42 * l32
    l40 = a40 * r0
    l41 = a41 * r1
    l42 = a42 * r2
    l43 = a43 * r3
    r4 = 1.0 / (a44 + d4 - (a40 * l40 + a41 * l41 + a42 * l42 + a43 * l43))
    x4 -= l40 * x0 + l41 * x1 + l42 * x2 + l43 * x3
    a51 -= a50 * l10
    a52 -= a50 * l20 + a51 * l21
    a53 -= a50 * l30 + a51 * l31 + a52 * l32
    a54 -= a50 * l40 + a51 * l41 + a52 * l42 + a53 * l43
    l50 = a50 * r0
    l51 = a51 * r1
    l52 = a52 * r2
    l53 = a53 * r3
    l54 = a54 * r4
    r5 = 1.0 / (a55 + d5 - (a50 * l50 + a51 * l51 + a52 * l52 + a53 * l53 + a54 * l54))
    x5 -= l50 * x0 + l51 * x1 + l52 * x2 + l53 * x3 + l54 * x4
    x5 = x5 * r5
    x4 = x4 * r4 - l54 * x5
    x3 = x3 * r3 - (l43 * x4 + l53 * x5)
    x2 = x2 * r2 - (l32 * x3 + l42 * x4 + l52 * x5)
    x1 = x1 * r1 - (l21 * x2 + l31 * x3 + l41 * x4 + l51 * x5)
    x0 = x0 * r0 - (l10 * x1 + l20 * x2 + l30 * x3 + l40 * x4 + l50 * x5)
    return [x0, x1, x2, x3, x4, x5]


def solve(A: Sequence[Sequence[float]], d: Sequence[float], b: Sequence[float]) -> list[float]:
    """Solve (A + diag(d)) x = b; see `solve_six`, which takes a third of the time."""
    found: list[float] = np.linalg.solve(np.array(A) + np.diag(d), b).tolist()
    return found


_TRIES = 12
_SWEEPS = 2000
_TOLERANCE = 1e-12


class Drives:
    """Rotors and friction of joints, stepped beside a rigid-body engine."""

    def __init__(
        self,
        *,
        armature: Sequence[float],
        viscous: Sequence[float],
        coulomb: Sequence[tuple[float, float]],
        dt: float,
    ) -> None:
        """Take what the joints have, all at the joint side of the gears.

        Args:
            armature: Rotor inertias G² J_m [kg m²].
            viscous: Viscous friction [N m s/rad].
            coulomb: Coulomb friction for positive and for negative speed [N m], (≥ 0, ≤ 0).
            dt: Step [s].

        Raises:
            InvalidValueError: If an inertia or a friction would push the joint along.
        """
        if min(armature) < 0 or min(viscous) < 0 or any(low > 0 or high < 0 for high, low in coulomb):
            raise InvalidValueError("drives", (armature, viscous, coulomb), "inertias and friction that oppose")
        self._dt = dt
        self._solve = solve_six if len(armature) == 6 else solve
        self._armature, self._viscous = list(armature), list(viscous)
        self._diagonal = [j + dt * b for j, b in zip(armature, viscous, strict=True)]
        self._none = [0.0] * len(self._armature)
        self._sliding: list[float] | None = None
        self._table = [(0.0, high, low) for high, low in coulomb]
        self._rubs = any(high > 0 or low < 0 for high, low in coulomb)
        self._modes = [0] * len(self._armature)

    @property
    def passive(self) -> bool:
        """Whether there is neither rotor nor friction, so that torques pass unchanged."""
        return not (self._rubs or any(self._armature) or any(self._viscous))

    def joint_torques(
        self, M: Sequence[Sequence[float]], bias: Sequence[float], qd: Sequence[float], tau: Sequence[float]
    ) -> list[float]:
        """Return what the rigid-body engine must apply in the next step.

        Args:
            M: Mass matrix without rotors, (n, n) [kg m²].
            bias: Gravity and velocity torques c [N m].
            qd: Joint speeds at the step's start [rad/s].
            tau: Drive torques τ [N m].

        Returns:
            Torques [N m], (n,).
        """
        dt, sliding = self._dt, self._sliding
        if sliding is not None:
            load = [t - c - b * v - y for t, c, b, v, y in zip(tau, bias, self._viscous, qd, sliding, strict=True)]
            a = self._solve(M, self._diagonal, load)
            ends = [v + dt * x for v, x in zip(qd, a, strict=True)]
            if min(map(mul, ends, self._modes)) >= 0:
                return [
                    t - j * x - b * v - y
                    for t, j, b, v, x, y in zip(tau, self._armature, self._viscous, ends, a, sliding, strict=True)
                ]
        rhs = [t - c - b * v for t, c, b, v in zip(tau, bias, self._viscous, qd, strict=True)]
        if self._rubs:
            a, f = self._with_coulomb(M, rhs, qd)
        else:
            a, f = self._solve(M, self._diagonal, rhs), self._none
        return [
            t - j * x - b * (v + dt * x) - y
            for t, j, b, v, x, y in zip(tau, self._armature, self._viscous, qd, a, f, strict=True)
        ]

    def _with_coulomb(
        self, M: Sequence[Sequence[float]], rhs: list[float], qd: Sequence[float]
    ) -> tuple[list[float], list[float]]:
        """Find accelerations and Coulomb torques, trying last step's sliding and sticking joints first."""
        dt, modes = self._dt, self._modes
        for _ in range(_TRIES):
            f = [row[s] for row, s in zip(self._table, modes, strict=True)]
            a = self._some_stuck(M, rhs, qd, f)
            wrong = False
            for i, s in enumerate(modes):
                if s:
                    if (qd[i] + dt * a[i]) * s < 0:
                        modes[i], wrong = 0, True
                else:
                    _, high, low = self._table[i]
                    if f[i] > high + _TOLERANCE * (1 + high):
                        modes[i], wrong = 1, True
                    elif f[i] < low - _TOLERANCE * (1 - low):
                        modes[i], wrong = -1, True
            if not wrong:
                self._sliding = None if 0 in modes else f
                return a, f
        self._sliding = None
        return self.relax(M, rhs, qd)

    def _some_stuck(
        self, M: Sequence[Sequence[float]], rhs: list[float], qd: Sequence[float], f: list[float]
    ) -> list[float]:
        """Solve with the joints of mode 0 brought to rest; their Coulomb torques are written into f."""
        held = [i for i, s in enumerate(self._modes) if s == 0]
        stops = [0.0 if s else -v / self._dt for s, v in zip(self._modes, qd, strict=True)]
        if len(held) == len(rhs):
            a = stops
        else:
            load = [r - y - _dot(row, stops) for r, y, row in zip(rhs, f, M, strict=True)]
            rows, diagonal = [list(row) for row in M], list(self._diagonal)
            for i in held:
                for row in rows:
                    row[i] = 0.0
                rows[i] = [0.0] * len(rhs)
                diagonal[i], load[i] = 1.0, stops[i]
            a = self._solve(rows, diagonal, load)
        for i in held:
            f[i] = rhs[i] - _dot(M[i], a) - self._diagonal[i] * a[i]
        return a

    def relax(
        self, M: Sequence[Sequence[float]], rhs: list[float], qd: Sequence[float]
    ) -> tuple[list[float], list[float]]:
        """Minimise one joint at a time until nothing changes: slow, and it always converges."""
        dt = self._dt
        a, f = [-v / dt for v in qd], [0.0] * len(rhs)
        for _ in range(_SWEEPS):
            change = 0.0
            for i, row in enumerate(M):
                _, high, low = self._table[i]
                pivot = row[i] + self._diagonal[i]
                rest = rhs[i] - _dot(row, a) + row[i] * a[i]
                f[i] = min(max(rest + pivot * qd[i] / dt, low), high)
                new = (rest - f[i]) / pivot
                change = max(change, abs(new - a[i]) / (1 + abs(new)))
                a[i] = new
            if change < _TOLERANCE:
                break
        for i, (v, x) in enumerate(zip(qd, a, strict=True)):
            end = v + dt * x
            inside = self._table[i][2] < f[i] < self._table[i][1]
            self._modes[i] = 0 if inside else (1 if end > 0 else -1)
        return a, f


def _dot(row: Sequence[float], x: Sequence[float]) -> float:
    return sum([m * y for m, y in zip(row, x, strict=True)])
