"""A mobile robot's page: each panel's style sheet dresses its own, and a refusal is said at the control."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.interfaces.live_rig import Child, child
from tests.interfaces.station.opened import Page, paged, station
from tests.interfaces.station.test_notices import told

SERVE = ("serve", "--robot", "ipr", "--link-loss", "hold", "--port", "0")
OWNERS = {
    "camera.css": ["camera"],
    "driving.css": ["drive", "plots", "floor"],
    "tasks.css": ["map", "jobs"],
    "plots.css": ["plots"],
}
"""The panels that each style sheet is for, beside the page's own."""
LEAKS = """(owners) => [...document.styleSheets].flatMap((sheet) => {
    const name = (sheet.href ?? "").split("/").at(-1);
    if (!(name in owners)) return [];
    const flat = (rules) => [...rules].flatMap((rule) => rule.selectorText ? [rule] : flat(rule.cssRules ?? []));
    return flat(sheet.cssRules).flatMap(({ selectorText }) => {
        const plain = selectorText.replace(/:not\\(:[a-z]+\\)/g, "")
            .replace(/::?(before|after|hover|active|focus[a-z-]*|disabled|empty)/g, "");
        return [...document.querySelectorAll(plain)].flatMap((one) => {
            const panel = one.closest(".panel")?.id.replace("panel-", "") ?? null;
            return panel === null || owners[name].includes(panel) ? [] : [`${name}: ${selectorText} in ${panel}`];
        });
    });
})"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Child]:
    with child(*SERVE, "--jobs", str(tmp_path_factory.mktemp("jobs") / "jobs.json")) as running:
        yield running


@pytest.fixture
def page(browser: Any, server: Child) -> Iterator[Page]:
    with paged(browser, station(server)) as opened:
        opened.open()
        opened.wait("Boolean(station.session.state.real && station.session.plan && station.session.tasks.loss)")
        yield opened


def test_a_panels_style_sheet_dresses_no_other_panel(page: Page) -> None:
    page.take_control()
    jobs = "[1, 2].map((number) => ({ do: 'wait', number, seconds: 1 }))"
    page.get(f"station.session.wish('task', {{ task: {{ jobs: {{ jobs: {jobs}, places: {{}} }} }} }})")
    page.page.click("#tab-jobs")
    page.wait("document.querySelectorAll('#jobs li').length === 2")
    page.shoot("jobs-planned")
    icon = page.page.locator("#jobs li:first-child .stage")
    dressed = icon.evaluate("(one) => { const { backgroundColor, cursor } = getComputedStyle(one); return"
                            " [backgroundColor, cursor]; }")  # fmt: skip
    assert dressed == ["rgba(0, 0, 0, 0)", "auto"]
    box = icon.bounding_box()
    assert box["height"] < 22
    assert sorted(set(page.page.evaluate(LEAKS, OWNERS))) == []


def test_what_is_refused_is_said_where_the_hand_is(page: Page) -> None:
    page.page.keyboard.press("Escape")
    if page.get("station.session.holds"):
        page.page.click("#give")
        page.wait("!station.session.holds")
    forward = "button[aria-label='Forward']"
    page.page.click("#tab-drive")
    page.page.click(forward, force=True)
    told(page, "you don't have control", forward)
    page.page.click("#tab-map")
    page.wait("Boolean(document.querySelector('.plan-things')?.getAttribute('d'))")
    page.page.click("#map")
    told(page, "take control first", "#map")
    page.page.fill("#goal-x", "1")
    page.page.fill("#goal-y", "1")
    page.page.click("#goal-go", force=True)
    told(page, "take control first", "#goal-go")
    page.shoot("mobile-refused")
    page.page.click("#tab-jobs")
    page.page.fill("#job-text", "nowhere")
    page.page.click("#job-add-it", force=True)
    told(page, "take control first", "#job-add-it")
    page.take_control()
    page.page.click("#job-add-it")
    told(page, "no place of this list", "#job-add-it")
    page.page.keyboard.press("Escape")
    page.wait("document.getElementById('notice').hidden")
