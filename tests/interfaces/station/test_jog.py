"""Jogging with precision: what is shown, typed, stepped, drawn and saved; units and keys of any robot."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest

from interfaces.val2.values import VAL2, Transformation
from tests.interfaces.live_rig import Child, child
from tests.interfaces.pages import accessible
from tests.interfaces.station.opened import Page, paged, station
from tests.interfaces.station.test_notices import told
from tests.interfaces.station.test_station import moved

CRANE = "tests.interfaces.own_arm:ROBOT"
"""Three joints, of which the second is prismatic."""
TOOL = "station.chain.toolAt(station.session.timeline.joints(station.session.timeline.end))"
LAST = "station.session.orders.entries.at(-1)"


@pytest.fixture
def page(browser: Any, server: Child) -> Iterator[Page]:
    with paged(browser, station(server)) as opened:
        opened.open().take_control().rest()
        opened.page.fill("#speed", "100")
        yield opened


def bent(page: Page) -> list[float]:
    """Both robots in a place whence tool and joints can go all ways; its joints."""
    q = [0.1, 0.6, -2.4, 0.2, 0.9, -0.1]
    page.get(f"station.jog.go({{ target: {{ type: 'joints', q: {q} }} }}, 'bent')")
    page.wait(f"{LAST}.outcome?.receipt?.status === 'accepted'")
    page.rest()
    return page.virtual


def shown(page: Page, name: str) -> float:
    """What a field shows."""
    return float(page.page.input_value(f"#jog-{name}").replace("−", "-"))


def test_what_is_shown_is_the_tool_in_the_base_frame_by_wheres_angles(page: Page) -> None:
    q = bent(page)
    X = np.array(page.get(f"station.chain.links({q}).at(-1)")).reshape(4, 4).T
    tool = X[:3, :3] @ np.array(page.get("station.chain.tool")) + X[:3, 3]
    expected = [*(1000 * tool), *VAL2.numbers(Transformation(X))[3:]]
    page.until(lambda: abs(shown(page, "x") - expected[0]) < 0.06)
    assert [shown(page, name) for name in "xyzOAT"] == pytest.approx(expected, abs=0.06)
    assert [shown(page, f"J{k}") for k in range(1, 7)] == pytest.approx(np.degrees(q), abs=0.06)


def test_the_hand_is_opened_and_closed(page: Page) -> None:
    for button, opening in (("#hand-close", 0), ("#hand-open", "inf")):
        page.page.click(button)
        page.wait(f"{LAST}.command?.type === 'grip' && {LAST}.outcome?.receipt?.status === 'accepted'")
        assert page.get(f"{LAST}.command.opening") == opening
    page.page.click("#give")
    page.wait("station.idle !== ''")
    page.page.click("#hand-close", force=True)
    told(page, "control", "#hand-close")


def test_the_virtual_hand_is_looked_back_at(page: Page) -> None:
    aside = """() => { const path = ["vrs", "virtual", "body", "6", "hand", "1"];
        const { object } = station.scene.viewer.scene_tree.find(path);
        object.updateMatrix();
        return object.matrix.elements[12]; }"""

    def is_at(place: float) -> bool:
        return bool(abs(page.get(aside) - place) < 1e-4)

    page.page.click("#hand-open")
    page.page.wait_for_timeout(1000)
    opened, t = page.get(aside), page.get("station.session.now")
    page.page.click("#hand-close")
    page.page.wait_for_timeout(1000)
    closed, later = page.get(aside), page.get("station.session.now")
    assert closed < opened - 0.01
    for then, place in ((t, opened), (later, closed), (t, opened)):
        page.page.evaluate("t => (station.cursor = t)", then)
        page.until(partial(is_at, place))
    # What is told meanwhile is shown when the page is live again.
    page.page.click("#hand-open")
    page.page.evaluate("t => (station.cursor = t)", later)
    page.page.wait_for_timeout(1000)
    assert is_at(closed)
    page.page.evaluate("station.cursor = null")
    page.until(lambda: is_at(opened))


def test_angles_are_wheres_at_every_turn(page: Page) -> None:
    rng = np.random.default_rng(3)
    turns = rng.uniform([-180, -90, -180], [180, 90, 180], (30, 3)).tolist()
    for o, a, t in [*turns, [90, -90, 30], [90, 90, -40]]:
        X = VAL2.transformation(0.0, 0.0, 0.0, o, a, t).X
        found, angles = page.page.evaluate(
            """async ([angles, X]) => { const { anglesOf, turned } = await import("/station/chain.js");
            return [turned(angles), anglesOf(X)]; }""",
            [[o, a, t], X.T.ravel().tolist()],
        )
        np.testing.assert_allclose(np.array(found).reshape(4, 4).T, X, atol=1e-12)
        assert angles == pytest.approx(VAL2.numbers(Transformation(X))[3:], abs=1e-6)


def test_typed_targets_are_gone_to_and_wrong_ones_say_what_is_allowed(page: Page) -> None:
    q = bent(page)
    page.page.fill("#jog-J1", "12,5")
    page.page.fill("#jog-J4", "−20")
    page.page.press("#jog-J4", "Enter")
    page.until(lambda: moved(page, 0.1, q))
    page.rest()
    goal = [math.radians(12.5), *q[1:3], math.radians(-20), *q[4:]]
    assert page.virtual == pytest.approx(goal, abs=1e-6)
    # What is done isn't typed any more: the field shows what is.
    page.wait("Object.keys(station.jog.typed).length === 0")
    start = page.get(TOOL)
    height = round(1000 * start[2]) + 30
    page.page.fill("#jog-z", str(height))
    page.page.click("#go-pose")
    page.wait(f"{LAST}.outcome?.receipt?.status === 'accepted'")
    assert page.get(f"[{LAST}.command.motion, {LAST}.command.speed]") == ["line", 1]
    page.rest()
    assert page.get(TOOL) == pytest.approx([*start[:2], height / 1000], abs=1e-6)
    orders = page.get("station.session.orders.entries.length")
    for name, text, words in (("J2", "abc", "J2 takes a number from"), ("J2", "400", "°"), ("x", "", "mm")):
        page.page.fill(f"#jog-{name}", text)
        page.page.press(f"#jog-{name}", "Enter")
        told(page, words, f"#jog-{name}")
        assert page.page.locator(f"#jog-{name}").get_attribute("aria-invalid") == "true"
        assert page.page.input_value(f"#jog-{name}") == text, "what was typed stays to be mended"
        page.page.press(f"#jog-{name}", "Escape")
    page.shoot("typed")
    assert page.get("station.session.orders.entries.length") == orders
    # Where the arm can't go, the server says why, and what was typed stays.
    page.page.fill("#jog-x", "5000")
    page.page.press("#jog-x", "Enter")
    page.wait(f"{LAST}.outcome?.receipt?.status === 'rejected'")
    page.wait("document.getElementById('notice').textContent !== ''")
    assert page.page.input_value("#jog-x") == "5000"


def test_a_press_is_a_step_by_button_and_key(page: Page) -> None:
    q = bent(page)
    page.page.select_option("#jog-step", "1")
    up = page.page.locator("button[aria-label='Joint 2 up']")
    for _ in range(3):
        up.click()
    page.page.evaluate("document.activeElement.blur()")
    page.page.keyboard.press("a")
    page.until(lambda: moved(page, 0.03, q))
    page.rest()
    step = math.radians(1)
    assert page.virtual == pytest.approx([q[0] - step, q[1] + 3 * step, *q[2:]], abs=1e-6)
    start, turn = page.get(TOOL), page.get("station.chain.links(station.session.timeline.joints(1e9)).at(-1)")
    page.page.select_option("#jog-step", "10")
    for label in ("Tool along x, plus", "Tool along x, plus", "Tool along z, minus"):
        page.page.click(f"button[aria-label='{label}']")
    page.until(lambda: page.get(TOOL)[2] < start[2] - 0.009)
    page.rest()
    assert page.get(TOOL) == pytest.approx([start[0] + 0.02, start[1], start[2] - 0.01], abs=1e-6)
    after = page.get("station.chain.links(station.session.timeline.joints(1e9)).at(-1)")
    assert after[:12] == pytest.approx(turn[:12], abs=1e-6)
    # A turn is about the tool's point.
    here = page.get(TOOL)
    page.page.click("button[aria-label='Tool: turn z, plus']")
    page.wait(f"{LAST}.outcome?.receipt?.status === 'accepted'")
    page.rest()
    assert page.get(TOOL) == pytest.approx(here, abs=1e-6)
    R, S = (np.array(X).reshape(4, 4).T[:3, :3] for X in (after, page.get(
        "station.chain.links(station.session.timeline.joints(1e9)).at(-1)")))  # fmt: skip
    c, s = math.cos(math.radians(10)), math.sin(math.radians(10))
    np.testing.assert_allclose(S, np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ R, atol=1e-6)


def test_a_joints_bar_is_drawn_and_moves_when_it_is_let_go(page: Page) -> None:
    q = bent(page)
    bar = page.page.locator("input[aria-label='Joint 1, drawn']").bounding_box()
    y = bar["y"] + bar["height"] / 2
    low, high = (page.get(f"station.session.welcome.limits.{name}[0]") for name in ("q_min", "q_max"))
    page.page.mouse.move(bar["x"] + bar["width"] * (q[0] - low) / (high - low), y)
    page.page.mouse.down()
    page.page.mouse.move(bar["x"] + 0.75 * bar["width"], y, steps=5)
    assert page.virtual == pytest.approx(q, abs=1e-6)
    asked = shown(page, "J1")
    page.page.mouse.up()
    page.until(lambda: moved(page, 0.1, q))
    page.rest()
    assert math.degrees(page.virtual[0]) == pytest.approx(asked, abs=0.06)
    assert asked > 40
    assert page.virtual[1:] == pytest.approx(q[1:], abs=1e-6)
    # Keys move the robot again: the bar was let go.
    between = page.virtual
    page.page.keyboard.down("a")
    page.until(lambda: moved(page, 0.02, between))
    page.page.keyboard.up("a")
    page.rest()


@pytest.mark.slow
def test_poses_are_saved_for_all_gone_to_and_deleted(browser: Any, server: Child, page: Page) -> None:
    q = bent(page)
    page.wait("station.jog.q !== null")
    page.page.click("#pose-save")
    told(page, "a pose's name has 1 to 24 characters", "#pose-save")
    page.page.fill("#pose-name", "ready")
    page.page.press("#pose-name", "Enter")
    told(page, "there's a pose ready", "#pose-name")
    page.page.fill("#pose-name", "over the table")
    page.page.click("#pose-save")
    saved = page.page.locator("[data-pose='over the table']")
    saved.wait_for()
    page.page.click("[data-pose=ready]")
    page.until(lambda: moved(page, 0.3, q))
    page.rest()
    saved.click()
    page.until(lambda: page.virtual == pytest.approx(q, abs=1e-6))
    for _ in range(2):
        accessible(page.page)
        page.page.click("#theme")
    # Another browser has it, and sees it go.
    with paged(browser, station(server)) as other:
        theirs = other.open().page.locator("[data-pose='over the table']")
        theirs.wait_for()
        page.page.click("[aria-label='Delete pose over the table']")
        saved.wait_for(state="detached")
        theirs.wait_for(state="detached")


def test_a_robot_of_three_joints_one_of_them_prismatic(browser: Any) -> None:
    with (
        child("serve", "--robot", CRANE, "--link-loss", "hold", "--port", "0") as server,
        paged(browser, station(server)) as page,
    ):
        page.open().take_control().rest()
        assert "keys Q to E up, A to D down" in page.page.locator("#panel-jog .head").first.text_content()
        assert page.page.locator(".joint").count() == 3
        page.until(lambda: page.page.input_value("#jog-J2") == "200.0")
        assert page.page.locator("#jog-J2").get_attribute("aria-label") == "Joint 2 in mm"
        page.page.fill("#jog-J2", "900")
        page.page.press("#jog-J2", "Enter")
        told(page, "J2 takes a number from 0.0 to 500.0 mm", "#jog-J2")
        page.page.fill("#jog-J2", "250")
        page.page.press("#jog-J2", "Enter")
        page.until(lambda: page.virtual[1] == pytest.approx(0.25, abs=1e-6))
        page.page.evaluate("document.activeElement.blur()")
        page.page.select_option("#jog-step", "5")
        page.page.evaluate("document.activeElement.blur()")
        page.rest()
        page.page.keyboard.press("s")
        page.until(lambda: page.virtual[1] == pytest.approx(0.245, abs=1e-6))
        page.shoot("crane")


def test_every_joint_up_to_twelve_has_keys_of_its_own(page: Page) -> None:
    keys = page.page.evaluate(
        """async () => [...(await import("/station/jog.js")).KEYS].map(([code, what]) => [code, what.join(" ")])"""
    )
    assert len({code for code, _ in keys}) == len({what for _, what in keys}) == len(keys) == 36
    wanted = {f"joint {k} {sign}" for k in range(12) for sign in (1, -1)}
    assert wanted <= {what for _, what in keys}
    # The space bar is STOP's.
    assert "Space" not in {code for code, _ in keys}


def test_without_control_every_control_says_why(page: Page) -> None:
    page.page.select_option("#jog-step", "5")
    page.page.click("#give")
    page.wait("document.getElementById('go-joints').ariaDisabled === 'true'")
    for name in ("#go-joints", "#go-pose", "button[aria-label='Joint 1 up']", "input[aria-label='Joint 1, drawn']"):
        assert "Take control first" in page.page.locator(name).get_attribute("title")
    page.page.click("#go-pose", force=True)
    told(page, "you don't have control", "#go-pose")
    page.page.locator("button[aria-label='Joint 1 up']").click(force=True)
    told(page, "you don't have control", "button[aria-label='Joint 1 up']")
