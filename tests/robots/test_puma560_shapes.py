"""The PUMA's shapes: closed, of plausible size, and in one piece in every pose."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
import trimesh

from robots import puma560
from robots.puma560.parameters import A2, D3, D4, FLANGE, PEDESTAL
from robots.puma560.shapes import shapes
from robots.solids import LinkShape
from vrs.errors import InvalidValueError
from vrs.model import Array

LINKS = range(7)


def mesh(shape: LinkShape) -> Any:
    return trimesh.Trimesh(shape.vertices, shape.faces, process=False)


@lru_cache
def bodies(link: int) -> tuple[Any, ...]:
    return tuple(mesh(shapes()[link]).split(only_watertight=False))


@lru_cache
def hulls(link: int) -> tuple[tuple[Array, Array], ...]:
    """Face planes (normals, offsets) of the convex hull of each body."""
    planes = []
    for body in bodies(link):
        hull = body.convex_hull
        planes.append((hull.face_normals, np.einsum("ij,ij->i", hull.face_normals, hull.triangles[:, 0])))
    return tuple(planes)


@lru_cache
def samples(link: int) -> Array:
    """Points of the solids of a link: surface corners drawn towards their body's centre."""
    points = []
    for body in bodies(link):
        centre = body.vertices.mean(axis=0)
        points += [centre + share * (body.vertices - centre) for share in (0.0, 0.25, 0.5, 0.75, 0.95, 1.0)]
    return np.concatenate(points)


def inside(points: Array, link: int) -> bool:
    return any(bool((points @ normals.T <= offsets + 1e-9).all(axis=1).any()) for normals, offsets in hulls(link))


def test_one_shape_for_each_frame_and_a_moderate_number_of_triangles() -> None:
    assert len(shapes()) == len(puma560.model().links(np.zeros(6)))
    assert sum(len(shape.faces) for shape in shapes()) <= 20_000


@pytest.mark.parametrize("link", LINKS)
def test_every_body_is_closed_and_faces_outwards(link: int) -> None:
    whole = mesh(shapes()[link])
    assert whole.is_watertight
    assert whole.is_winding_consistent
    for body in bodies(link):
        assert body.is_watertight
        assert body.volume > 1e-9


@pytest.mark.parametrize("link", LINKS)
def test_no_body_of_a_link_floats_free(link: int) -> None:
    parts = bodies(link)
    reached, waiting = {0}, [0]
    while waiting:
        i = waiting.pop()
        for j in set(range(len(parts))) - reached:
            if touch(link, i, j) or touch(link, j, i):
                reached.add(j)
                waiting.append(j)
    assert len(reached) == len(parts)


def touch(link: int, i: int, j: int) -> bool:
    """Whether a point of body i lies in body j."""
    body = bodies(link)[i]
    centre = body.vertices.mean(axis=0)
    points = np.concatenate([centre + s * (body.vertices - centre) for s in (0.0, 0.3, 0.6, 0.9, 1.0)])
    normals, offsets = hulls(link)[j]
    return bool((points @ normals.T <= offsets + 1e-9).all(axis=1).any())


def test_neighbouring_links_overlap_in_every_pose() -> None:
    model = puma560.model()
    rng = np.random.default_rng(560)
    draws = rng.uniform(model.limits.q_min, model.limits.q_max, (40, 6))
    for X in model.links(np.vstack([*model.poses.values(), draws])):
        for i in range(1, 7):
            X_BA = np.linalg.inv(X[i - 1]) @ X[i]
            assert inside(samples(i) @ X_BA[:3, :3].T + X_BA[:3, 3], i - 1), f"links {i - 1} and {i}"


def test_each_link_spans_its_lengths_on_the_right_side() -> None:
    low = [shape.vertices.min(axis=0) for shape in shapes()]
    high = [shape.vertices.max(axis=0) for shape in shapes()]
    assert low[0][2] == pytest.approx(-PEDESTAL)
    assert high[0][2] < 0
    # The upper arm reaches back from the elbow over the shoulder, outside the forearm's plane.
    assert -A2 - 0.25 < low[2][0] < -A2 - 0.05
    assert 0.03 < high[2][0] < 0.12
    assert D3 < low[2][2] < high[2][2] < D3 + 0.25
    # The forearm lies from behind the elbow to short of the wrist centre.
    assert -0.2 < low[3][2] < -0.05
    assert D4 - 0.15 < high[3][2] < D4
    # Its side towards the upper arm, −y, keeps off the upper arm's inner face.
    assert D3 - low[3][1] <= D3 + 0.048
    assert high[6][2] == pytest.approx(FLANGE, abs=0.003)
    for i in LINKS:
        assert (high[i] - low[i] > 0.01).all()


def test_the_arm_has_a_pumas_volume() -> None:
    volume = sum(abs(mesh(shape).volume) for shape in shapes()[1:])
    # 13 kg to 55 kg of moving parts at 0.5 to 1.5 kg per litre.
    assert 0.02 < volume < 0.08


def test_colours_are_given_for_every_triangle() -> None:
    for shape in shapes():
        assert shape.face_colours.shape == shape.faces.shape
        assert shape.face_colours.min() >= 0
        assert shape.face_colours.max() <= 1
    assert len(np.unique(np.concatenate([s.face_colours for s in shapes()]), axis=0)) >= 3


def test_shapes_are_values() -> None:
    shape = shapes()[0]
    assert not shape.vertices.flags.writeable
    assert not shape.faces.flags.writeable
    with pytest.raises(InvalidValueError, match="faces"):
        LinkShape("x", shape.vertices[:3], shape.faces, shape.colour, shape.face_colours)
    with pytest.raises(InvalidValueError, match="face_colours"):
        LinkShape("x", shape.vertices, shape.faces, shape.colour, shape.face_colours[:2])
