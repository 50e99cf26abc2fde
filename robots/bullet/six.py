"""Six symmetric linear equations, written out: between PyBullet's calls, NumPy and LAPACK cost three times more."""

from __future__ import annotations

from collections.abc import Sequence


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
