"""The line map as a value: the paper's matrices, files, and rays against brute force."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.onboard.gsp_map import (
    GspMap,
    Lines,
    cast_lines,
    injection,
    load_map,
    paper_covariance,
    read_map,
    save_map,
)
from vrs.errors import FormatError, InvalidValueError

POSES = np.array([[1.0, 2.0, 0.0], [3.0, 1.0, 1.2], [0.0, 4.0, -2.0]])
SPANS = np.array([[-1.0, 1.5], [-0.5, 0.5], [-2.0, 1.0]])
LINES = Lines.of(POSES, SPANS, np.full((3, 2), 1e-4), [40, 12, 60])


def made() -> GspMap:
    A = np.random.default_rng(1).standard_normal((6, 6))
    return GspMap.of("hall", LINES, A @ A.T * 1e-4)


@given(st.floats(-10, 10))
def test_R_keeps_the_error_along_the_normal_and_the_angle(theta: float) -> None:
    R = injection(theta)[0]
    along, normal = (
        np.array([math.cos(theta), math.sin(theta), 0]),
        np.array([-math.sin(theta), math.cos(theta), 0]),
    )
    assert np.abs(R @ along).max() < 1e-12
    assert np.abs(R @ normal - normal).max() < 1e-12
    assert np.array_equal(R @ (0, 0, 1), (0, 0, 1))
    # Eq. (6) with the rotation the right way round, global to feature frame, and back.
    c, s = math.cos(theta), math.sin(theta)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    assert np.abs(turn.T @ np.diag([0, 1, 1]) @ turn - R).max() < 1e-12


def test_the_papers_covariance() -> None:
    Xi = paper_covariance([4, 10], 0.02, 3.0)
    assert np.allclose(Xi[0], np.diag([0.005, 0.005, 3.0 / 64]))
    assert np.allclose(Xi[1], np.diag([0.002, 0.002, 0.003]))
    with pytest.raises(InvalidValueError, match="counts"):
        paper_covariance([0], 1.0, 1.0)


def test_the_papers_covariance_is_that_of_least_squares_on_evenly_spaced_points() -> None:
    sigma, spacing, n = 0.01, 0.05, 40
    rng, x = np.random.default_rng(0), 0.05 * (np.arange(n) - (n - 1) / 2)
    fits = np.array([np.polyfit(x, sigma * rng.standard_normal(n), 1) for _ in range(4000)])
    Xi = paper_covariance([n], sigma**2, 12 * sigma**2 / spacing**2)[0]
    assert fits[:, 1].var() == pytest.approx(Xi[1, 1], rel=0.1)
    assert fits[:, 0].var() == pytest.approx(Xi[2, 2], rel=0.1)


def test_a_map_reads_back_exactly(tmp_path: Path) -> None:
    known = made()
    save_map(known, tmp_path / "hall.json")
    again = load_map(tmp_path / "hall.json")
    assert again.name == "hall"
    for name in ("poses", "spans", "variances", "counts"):
        assert np.array_equal(getattr(again.lines, name), getattr(known.lines, name))
    assert np.array_equal(again.covariance, known.covariance)
    assert np.array_equal(again.P, POSES)
    assert np.allclose(again.L, [2.5, 1.0, 3.0])
    assert again.R.shape == (3, 3, 3)
    assert len(read_map(GspMap.of("", Lines.none()).to_json()).lines) == 0


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_what_is_no_map_is_one_clear_error(data: st.DataObject) -> None:
    document = json.loads(made().to_json())
    key = data.draw(st.sampled_from(sorted(document.keys() - {"name"})))
    document[key] = data.draw(
        st.one_of(st.none(), st.text(max_size=5), st.integers(-3, 3), st.lists(st.floats(), max_size=4))
    )
    with pytest.raises(FormatError, match="plan"):
        read_map(json.dumps(document), "plan")


@pytest.mark.parametrize("text", ["", "[]", "{", '{"schema": 3}', "[" * 5000])
def test_so_is_other_text(text: str) -> None:
    with pytest.raises(FormatError):
        read_map(text)


def test_rays_end_at_the_first_segment() -> None:
    rng = np.random.default_rng(4)
    ends = rng.uniform(-3, 3, (12, 2, 2))
    origins, angles = rng.uniform(-3, 3, (60, 2)), rng.uniform(-3, 3, 60)
    ways = np.column_stack([np.cos(angles), np.sin(angles)])
    found = cast_lines(ends, origins, ways)
    share = np.linspace(0, 1, 8001)[:, None]
    for origin, way, r in zip(origins, ways, found, strict=True):
        best = math.inf
        for a, b in ends:
            # Points of the segment that lie on the ray, to the comb's width.
            local = a + share * (b - a) - origin
            along, off = local @ way, np.abs(local @ (-way[1], way[0]))
            hit = along[(off < 8e-4) & (along > 0)]
            best = min(best, float(hit.min()) if len(hit) else math.inf)
        assert (math.isinf(best) and math.isinf(r)) or r == pytest.approx(best, abs=2e-2)
    assert np.isinf(cast_lines(np.zeros((0, 2, 2)), origins, ways)).all()


def test_lines_move_as_a_rigid_body() -> None:
    moved = LINES.moved((0.5, -1.0, 0.7))
    c, s = math.cos(0.7), math.sin(0.7)
    assert np.allclose(moved.ends, LINES.ends @ np.array([[c, s], [-s, c]]) + (0.5, -1.0))
