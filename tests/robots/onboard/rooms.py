"""A flat world of walls and pillars: exact distances along rays, exact distances from a robot's rectangle."""

from __future__ import annotations

import math

import numpy as np

from robots.onboard.avoidance import Outline, SonarMount

IPR = Outline(front=0.30, rear=0.22, half_width=0.225)
"""45 × 52 cm, the axle 4 cm behind the middle."""


def ring(outline: Outline, count: int = 16) -> tuple[SonarMount, ...]:
    """Sonars all round, each on the outline."""
    mounts = []
    for i in range(count):
        a = math.tau * i / count
        c, s = math.cos(a), math.sin(a)
        far = min(
            (outline.front if c > 0 else outline.rear) / abs(c) if abs(c) > 1e-9 else math.inf,
            outline.half_width / abs(s) if abs(s) > 1e-9 else math.inf,
        )
        mounts.append(SonarMount(far * c, far * s, math.remainder(a, math.tau)))
    return tuple(mounts)


class Room:
    """Segments (k, 4) and circles (x, y, r)."""

    def __init__(self, segments, circles=()):
        self.segments = np.asarray(segments, float).reshape(-1, 4)
        self.circles = np.asarray(circles, float).reshape(-1, 3)

    def distances(self, origins, angles):
        """Along rays, (n,); infinity where there's nothing."""
        d = np.stack([np.cos(angles), np.sin(angles)], -1)
        best = np.full(len(angles), np.inf)
        a, e = self.segments[:, :2], self.segments[:, 2:] - self.segments[:, :2]
        if len(a):
            to = a[None] - origins[:, None]
            cross = d[:, None, 0] * e[None, :, 1] - d[:, None, 1] * e[None, :, 0]
            with np.errstate(divide="ignore", invalid="ignore"):
                t = (to[..., 0] * e[None, :, 1] - to[..., 1] * e[None, :, 0]) / cross
                u = (to[..., 0] * d[:, None, 1] - to[..., 1] * d[:, None, 0]) / cross
            hit = (np.abs(cross) > 1e-12) & (t >= 0) & (u >= 0) & (u <= 1)
            best = np.minimum(best, np.where(hit, t, np.inf).min(1))
        if len(self.circles):
            to = origins[:, None] - self.circles[None, :, :2]
            b = (to * d[:, None]).sum(-1)
            root = b * b - (to**2).sum(-1) + self.circles[:, 2] ** 2
            t = -b - np.sqrt(np.maximum(root, 0))
            best = np.minimum(best, np.where((root >= 0) & (t >= 0), t, np.inf).min(1))
        return best

    def scan(self, mounts, posture, rng, *, half_cone=0.218, noise=0.01, misses=0.05, rays=9):
        """What sonars read: the nearest in the cone, with noise; some hear nothing."""
        x, y, theta = posture
        m = np.array([(s.x, s.y, s.angle) for s in mounts])
        c, s = math.cos(theta), math.sin(theta)
        origins = np.stack([x + c * m[:, 0] - s * m[:, 1], y + s * m[:, 0] + c * m[:, 1]], -1)
        spread = np.linspace(-half_cone, half_cone, rays)
        angles = (m[:, 2] + theta)[:, None] + spread
        r = self.distances(np.repeat(origins, rays, 0), angles.ravel()).reshape(-1, rays).min(1)
        r = np.clip(r + rng.normal(0, noise, len(r)), 0.1, 3.0)
        return np.where(rng.random(len(r)) < misses, 3.0, r)

    def gap(self, outline, posture):
        """Least distance from the robot's rectangle to anything [m], 0 where they touch or overlap."""
        x, y, theta = posture
        c, s = math.cos(theta), math.sin(theta)
        rotation = np.array([[c, -s], [s, c]])

        def local(p):
            return (p - (x, y)) @ rotation

        def outside(p):
            px = np.maximum(np.maximum(p[..., 0] - outline.front, -outline.rear - p[..., 0]), 0)
            return np.hypot(px, np.maximum(np.abs(p[..., 1]) - outline.half_width, 0))

        best = math.inf
        if len(self.segments):
            a, b = local(self.segments[:, :2]), local(self.segments[:, 2:])
            best = min(best, _boxes(a, b, outline))
        if len(self.circles):
            best = min(best, float((outside(local(self.circles[:, :2])) - self.circles[:, 2]).min()))
        return max(best, 0.0)


def _boxes(a, b, outline):
    """Least distance between segments and the rectangle."""
    low = np.array([-outline.rear, -outline.half_width])
    high = np.array([outline.front, outline.half_width])
    d = b - a
    with np.errstate(divide="ignore", invalid="ignore"):
        t1, t2 = (low - a) / d, (high - a) / d
    flat = np.abs(d) < 1e-12
    between = (a >= low) & (a <= high)
    enter = np.where(flat, np.where(between, -np.inf, np.inf), np.minimum(t1, t2)).max(1)
    leave = np.where(flat, np.where(between, np.inf, -np.inf), np.maximum(t1, t2)).min(1)
    if ((enter <= leave) & (leave >= 0) & (enter <= 1)).any():
        return 0.0
    best = math.inf
    for corner in [(x, y) for x in (low[0], high[0]) for y in (low[1], high[1])]:
        t = np.clip(((corner - a) * d).sum(1) / np.maximum((d * d).sum(1), 1e-18), 0, 1)
        best = min(best, float(np.hypot(*(a + t[:, None] * d - corner).T).min()))
    for ends in (a, b):
        px = np.maximum(np.maximum(ends[:, 0] - high[0], low[0] - ends[:, 0]), 0)
        best = min(best, float(np.hypot(px, np.maximum(np.abs(ends[:, 1]) - high[1], 0)).min()))
    return best


def box(x, y, width, height, angle=0.0):
    """Four walls."""
    c, s = math.cos(angle), math.sin(angle)
    corners = [
        (x + c * u - s * v, y + s * u + c * v)
        for u, v in (
            (width / 2, height / 2),
            (-width / 2, height / 2),
            (-width / 2, -height / 2),
            (width / 2, -height / 2),
        )
    ]
    return [(*corners[i], *corners[(i + 1) % 4]) for i in range(4)]
