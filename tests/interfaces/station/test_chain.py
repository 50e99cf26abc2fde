"""Links by screws, in Python and in the page, against the model's own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import interfaces.station
from interfaces.station.chain import described, place, screws
from robots import load, puma560
from robots.robot import Gripper, Robot
from vrs.errors import InvalidValueError
from vrs.model import Array

MODEL = puma560.model()
TOOL = (0.01, -0.02, 0.056)
MODULE = Path(interfaces.station.__file__).parent / "static" / "chain.js"


def postures() -> Array:
    rng = np.random.default_rng(5)
    return rng.uniform(MODEL.limits.q_min, MODEL.limits.q_max, (40, 6))


def robot(model: Any) -> Robot:
    return Robot("arm", model, devices=(Gripper(TOOL),))


def test_the_screws_place_every_link() -> None:
    home, S = screws(MODEL)
    for q in postures():
        np.testing.assert_allclose(place(home, S, q), MODEL.links(q), atol=1e-12)


class Sliding:
    """A turn about y away from the origin, then a slide along the turned x."""

    name = "sliding"
    limits = MODEL.limits

    def links(self, q: Array) -> Array:
        X = np.tile(np.eye(4), (len(q) + 1, 1, 1))
        c, s = np.cos(q[0]), np.sin(q[0])
        X[1:, :3, :3] = [[c, 0, s], [0, 1, 0], [-s, 0, c]]
        X[1:, :3, 3] = np.array([0.3, 0, 0.2]) - X[1, :3, :3] @ [0.3, 0, 0.2]
        for k in range(2, len(X)):
            X[k, :3, 3] += X[1, :3, 0] * q[1:k].sum()
        return X


def test_a_joint_may_slide() -> None:
    home, S = screws(Sliding())  # type: ignore[arg-type]
    np.testing.assert_allclose(S[0, :3], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(S[1], [0, 0, 0, 1, 0, 0], atol=1e-12)
    q = np.linspace(0.5, -0.8, 6)
    np.testing.assert_allclose(place(home, S, q), Sliding().links(q), atol=1e-12)


class Bent(Sliding):
    def links(self, q: Array) -> Array:
        X = super().links(q)
        X[2:, 2, 3] += q[0] ** 2
        return X


def test_what_is_no_chain_is_refused() -> None:
    with pytest.raises(InvalidValueError, match="chain of revolute"):
        screws(Bent())  # type: ignore[arg-type]


def test_the_page_places_them_alike(browser: Any) -> None:
    page = browser.new_page()
    source = MODULE.read_text(encoding="utf-8")
    page.add_script_tag(content=f"{source}\nwindow.Chain = Chain;", type="module")
    page.wait_for_function("window.Chain !== undefined")
    q = postures()
    found = page.evaluate(
        "([robot, all]) => { const c = new Chain(robot); return all.map((q) => [c.links(q), c.toolAt(q)]); }",
        [described(robot(MODEL)), q.tolist()],
    )
    page.close()
    for joints, (links, tool) in zip(q, found, strict=True):
        expected = np.asarray(MODEL.links(joints))
        drawn = np.array(links).reshape(-1, 4, 4).transpose(0, 2, 1)
        np.testing.assert_allclose(drawn, expected, atol=1e-12)
        np.testing.assert_allclose(tool, expected[-1, :3, :3] @ np.array(TOOL) + expected[-1, :3, 3], atol=1e-12)


def test_speeds_are_the_models() -> None:
    assert described(robot(replace(MODEL, tool_speed=0.2)))["tool_speed"] == 0.2


def test_a_page_shows_messages_where_the_robot_has_a_display() -> None:
    assert [described(load(name))["display"] for name in ("ipr", "cubo")] == [True, False]
