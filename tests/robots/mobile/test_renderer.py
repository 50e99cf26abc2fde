"""What the renderer draws is what rays through the middles of pixels meet first."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robots.base import upright
from robots.mobile.renderer import SKY, Renderer
from robots.solids import LinkShape
from vrs.model import Array

WIDTH, HEIGHT, VIEW, NEAR, FAR = 48, 36, 1.2, 0.2, 8.0


def triangles(rng: np.random.Generator, m: int) -> Array:
    """Some around the origin, of all sizes, many of them partly behind a camera there, (m, 3, 3)."""
    size = rng.uniform(0.2, 4.0, (m, 1, 1))
    return rng.uniform(-4.0, 4.0, (m, 1, 3)) + size * rng.normal(size=(m, 3, 3))


def met(corners: Array, X_WC: Array) -> tuple[Array, Array]:
    """How far along the line of sight each pixel's ray meets each triangle from its front, else infinity, (k, m);
    and how near to an edge it comes, as the smallest share of a corner."""
    focus = 0.5 * WIDTH / math.tan(0.5 * VIEW)
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH].reshape(2, -1) + 0.5
    rays = np.column_stack([np.ones(rows.size), (0.5 * WIDTH - columns) / focus, (0.5 * HEIGHT - rows) / focus])
    a, b, c = np.moveaxis((corners - X_WC[:3, 3]) @ X_WC[:3, :3], 1, 0)
    shares = np.linalg.solve(np.stack([a, b, c], axis=-1)[None], rays[:, None, :, None])[..., 0]
    distance = 1.0 / shares.sum(axis=-1)
    front = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0.0
    inside = (shares >= 0.0).all(axis=-1) & front & (distance >= NEAR) & (distance <= FAR)
    return np.where(inside, distance, np.inf), np.abs(shares * distance[..., None]).min(axis=-1)


@pytest.mark.parametrize("seed", range(12))
def test_each_pixel_shows_what_its_ray_meets_first(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners, X_WC = triangles(rng, 80), np.eye(4)
    X_WC[:3, :3], X_WC[:3, 3] = upright(0.0, 0.0, rng.uniform(-3.0, 3.0))[:3, :3], rng.uniform(-1.0, 1.0, 3)
    colours = rng.uniform(0.2, 0.9, (len(corners), 3))
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    renderer = Renderer()
    renderer.add(LinkShape("all", corners.reshape(-1, 3), faces, colours[0], colours))
    picture = renderer.draw(X_WC, width=WIDTH, height=HEIGHT, view=VIEW, near=NEAR, far=FAR).reshape(-1, 3)
    distance, edge = met(corners, X_WC)
    first, shown = distance.min(axis=1), distance.argmin(axis=1)
    # A shade of its triangle's colour: the same for all its pixels, and no other's.
    for k in np.unique(shown[np.isfinite(first)]):
        mine = picture[np.isfinite(first) & (shown == k) & (edge > 1e-6).all(axis=1)].astype(float)
        light = mine / (255.0 * colours[k])
        assert np.ptp(light, axis=1).max(initial=0.0) < 0.03
        assert (mine == mine[:1]).all()
    clear = (edge > 1e-6).all(axis=1) & (np.abs(distance - FAR) > 1e-6).all(axis=1)
    assert (picture[clear & np.isinf(first)] == SKY).all()
    assert np.isfinite(first).mean() > 0.05


def test_what_is_placed_elsewhere_is_drawn_there_and_what_is_away_is_not() -> None:
    corners = np.array([[3.0, 1.0, -1.0], [3.0, -1.0, -1.0], [3.0, 0.0, 1.0]])
    red = np.array([[0.8, 0.1, 0.1]])
    renderer = Renderer()
    figure = renderer.add(LinkShape("one", corners, np.array([[0, 1, 2]]), red[0], red))
    eye = {"width": WIDTH, "height": HEIGHT, "view": VIEW, "near": NEAR, "far": FAR}
    ahead, turned = np.eye(4), upright(0.0, 0.0, 0.3)

    def columns() -> Array:
        return np.flatnonzero((renderer.draw(ahead, **eye) != SKY).any(axis=-1).any(axis=0))

    straight = columns()
    renderer.place(figure, turned)
    assert columns().mean() == pytest.approx(straight.mean() - 0.5 * WIDTH * math.tan(0.3) / math.tan(0.6), abs=1.5)
    renderer.place(figure, None)
    assert len(columns()) == 0


def test_a_picture_of_nothing_is_sky() -> None:
    assert (Renderer().draw(np.eye(4), width=16, height=4, view=1.0, near=0.1, far=9.0) == SKY).all()
