"""The strip keeps history: named entries, what is chosen, undo and redo, plan files, and the past played."""

from __future__ import annotations

import json
import math
import urllib.error
import urllib.request
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

import pytest

from interfaces.runtime.plan import parse_plan
from robots import puma560
from tests.interfaces.live_rig import Child
from tests.interfaces.station.opened import NOTICE, Page, paged, station, until
from tests.interfaces.station.test_station import moved, same, scheduled

BARS = """[...document.querySelectorAll('.move')].map((bar) => bar.getAttribute('aria-label').split(',')[0])"""


@pytest.fixture
def page(browser: Any, server: Child) -> Iterator[Page]:
    with paged(browser, station(server)) as opened:
        yield opened.open()


def plan(page: Page, pose: str, seconds: float, speed: float = 0.5) -> str:
    """Schedule a move; its number."""
    page.page.evaluate(
        """([pose, seconds, speed]) => { const { session } = station;
        const [target, execute_at] = [{ type: 'joints', q: session.welcome.poses[pose] }, session.now + seconds];
        window.given = session.order({ type: 'move', target, speed, execute_at }, pose); }""",
        [pose, seconds, speed],
    )
    page.wait("given.outcome?.receipt?.status === 'accepted'")
    number = str(page.get("given.outcome.receipt.command_id"))
    until(lambda: number in scheduled(page))
    return number


def entries(page: Page) -> list[str]:
    """What stands on the strip, one after the other; a machine that is busy makes several of one jog."""
    return [name for name, _ in groupby(name.split(" ", 2)[2] for name in page.get(BARS))]


def says(page: Page, button: str, words: str) -> None:
    """What a button that can't do anything now says when it's used."""
    page.wait(f"document.querySelector({button!r}).getAttribute('aria-disabled') === 'true'")
    page.page.locator(button).click(force=True)
    page.wait(f"{NOTICE}.toLowerCase().includes({words!r})")
    page.page.keyboard.press("Escape")


def clear(page: Page) -> None:
    """Take everything out of the plan that's still to come."""
    page.page.evaluate("station.session.order({ type: 'stop' })")
    until(lambda: scheduled(page) == {})


def test_each_jog_has_an_entry_with_a_name_that_everyone_sees(browser: Any, server: Child, page: Page) -> None:
    page.take_control().rest()
    with paged(browser, station(server)) as second:
        second.open()
        for label in ("Joint 1 up", "Joint 1 down", "Tool along z, plus"):
            before = page.virtual
            button = page.page.locator(f"button[aria-label='{label}']")
            button.hover()
            page.page.mouse.down()
            page.until(lambda before=before: moved(page, 0.005, before))
            page.page.mouse.up()
            page.rest()
        for seen in (page, second):
            until(lambda seen=seen: entries(seen) == ["J1 +", "J1 −", "tool z +"])
        number = plan(page, "ready", 30)
        second.wait(f"station.session.reader.nameOf({number}, 0)?.label === 'ready'")
        second.page.click("#zoom-out")
        until(lambda: f"Move #{number} ready" in second.get(BARS))
    # Who comes later is told as well.
    with paged(browser, station(server)) as third:
        third.open()
        third.page.click("#zoom-out")
        until(lambda: "tool z +" in entries(third))
        assert third.get(f"station.session.reader.nameOf({number}, 0).label") == "ready"
    clear(page)


def test_a_chosen_move_stays_chosen(page: Page) -> None:
    page.take_control().rest()
    move = plan(page, "nominal" if page.virtual[1] > 1.2 else "ready", 60)
    page.page.click("#zoom-out")
    page.page.click("#zoom-out")
    bar = page.page.locator(f".move[data-id='{move}']")
    bar.press("Enter")
    begin = scheduled(page)[move][0]
    bar.press("Shift+ArrowRight")
    until(lambda: scheduled(page)[move][0] > begin + 0.5)
    plan(page, "stretch", 90)
    assert bar.get_attribute("aria-pressed") == "true"
    # Out of sight and back; taken out of the plan and back.
    for _ in range(4):
        page.page.click("#zoom-in")
    page.wait(f"document.querySelector(\".move[data-id='{move}']\") === null")
    page.page.click("#delete")
    until(lambda: move not in scheduled(page))
    says(page, "#delete", "isn't in the plan")
    page.page.click("#undo")
    until(lambda: move in scheduled(page))
    for _ in range(4):
        page.page.click("#zoom-out")
    page.wait(f"document.querySelector(\".move[data-id='{move}']\")?.ariaPressed === 'true'")
    clear(page)


CORRECTIONS = "station.session.state.corrections"


def undo(page: Page, wanted: dict[int, list[float]], corrections: int, button: str = "#undo") -> None:
    """Take the newest command back, or redo it, until that is planned, or the virtual robot was put right."""
    page.page.click(button)
    page.until(lambda: same(scheduled(page), wanted) or page.get(CORRECTIONS) != corrections)


def test_undo_is_redone(page: Page) -> None:
    page.take_control()
    # What was commanded before the virtual robot was put right can't be taken back or redone: then once more.
    for _ in range(4):
        page.rest()
        known = page.get(CORRECTIONS)
        first = plan(page, "nominal" if page.virtual[1] > 1.2 else "ready", 60)
        before = scheduled(page)
        second = plan(page, "stretch", 80)
        whole = scheduled(page)
        undo(page, before, known)
        undo(page, {}, known)
        for wanted in (before, whole):
            if page.get(CORRECTIONS) == known:
                undo(page, wanted, known, "#redo")
        if page.get(CORRECTIONS) == known:
            break
        clear(page)
    assert same(scheduled(page), whole)
    assert sorted((first, second)) == sorted(whole)
    page.page.click("#tab-receipts")
    told = page.page.locator("#receipts")
    until(lambda: f"#{second} Redo" in told.text_content())
    for move in (first, second):
        moved_to = told.locator("li", has_text=f"#{move} Move")
        until(lambda row=moved_to: row.get_attribute("data-status") in ("accepted", "postponed"))
    page.page.click("#redo")
    page.wait(f"{NOTICE}.includes('nothing to redo')")
    clear(page)


def test_what_the_hand_is_told_stands_on_everybodys_strip(browser: Any, server: Child, page: Page) -> None:
    page.take_control().rest()
    with paged(browser, station(server)) as second:
        second.open()
        page.page.click("#hand-close")
        for seen in (page, second):
            until(lambda seen=seen: seen.page.locator(".grip").count() == 1)
            assert "Close the hand, 0:" in (seen.page.locator(".grip").get_attribute("aria-label") or "")
        page.shoot("grip")
        page.page.click("#hand-open")
        until(lambda: second.page.locator(".grip").count() == 2)
    page.page.click("#give")


@pytest.mark.slow
def test_a_plan_is_saved_and_loaded(page: Page, tmp_path: Path) -> None:
    page.take_control().rest()
    says(page, "#save", "nothing is planned")
    first = "nominal" if page.virtual[1] > 1.2 else "ready"
    plan(page, first, 40, 0.3)
    plan(page, "stretch", 60, 0.7)
    was = sorted(scheduled(page).values())
    with page.page.expect_download() as download:
        page.page.click("#save")
    path = tmp_path / "saved.jsonl"
    download.value.save_as(path)
    assert download.value.suggested_filename.endswith(".jsonl")
    saved = parse_plan(path.read_bytes(), "saved.jsonl", puma560.model())
    assert [motion.command.speed for motion in saved.motions] == [0.3, 0.7]
    poses = puma560.model().poses
    for motion, pose in zip(saved.motions, (first, "stretch"), strict=True):
        assert motion.command.target.q == pytest.approx(poses[pose], abs=1e-9)
    page.page.set_input_files("#plan-file", path)
    page.page.click("#load-append")
    until(lambda: len(scheduled(page)) == 4)
    spans = sorted(scheduled(page).values())
    # As far apart as they were, and as long, behind what was planned.
    assert spans[:2] == [pytest.approx(span, abs=1e-6) for span in was]
    assert spans[2][0] > was[1][1]
    assert spans[3][0] - spans[2][0] == pytest.approx(was[1][0] - was[0][0], abs=1e-6)
    page.page.set_input_files("#plan-file", path)
    page.page.wait_for_selector("#load-replace")
    page.accessible()
    page.page.click("#load-replace")
    until(
        lambda: len(scheduled(page)) == 1 or (len(scheduled(page)) == 2 and sorted(scheduled(page).values()) != was)
    )
    clear(page)
    # What doesn't fit the robot is refused, with its line, before anything is given.
    page.refused = True
    wrong = tmp_path / "wrong.jsonl"
    good = path.read_text(encoding="utf-8").splitlines()[1]
    wrong.write_text(f'{good}\n{{"issue": 1, "move": [1, 2]}}\n', encoding="utf-8")
    page.page.set_input_files("#plan-file", wrong)
    page.wait(f"{NOTICE}.includes('rong.jsonl:2: move must be 6 finite joint values')")
    assert page.page.locator("dialog[aria-label='Load a plan']").count() == 0
    assert scheduled(page) == {}
    page.page.click("#give")
    page.wait("!station.session.holds")
    says(page, "#load", "take control first")


NEWEST = "station.session.orders.entries.at(-1).outcome?.receipt"
PATH = """(count) => { const { timeline } = station.session;
    const ids = [...new Set(timeline.segments.map(({ commandId }) => commandId))].slice(-count);
    const { start } = timeline.segments.find(({ commandId }) => commandId === ids[0]);
    const times = Array.from({ length: 200 }, (_, k) => start + (k * (timeline.end - start)) / 199);
    return [timeline.end - start, times.map((t) => timeline.joints(t))]; }"""
"""How long the newest commands' moves take, and places on their way."""


def path(page: Page, count: int) -> tuple[float, list[list[float]]]:
    """What `PATH` says, once the page knows the newest."""
    page.wait(f"Math.abs(station.session.timeline.end - {NEWEST}?.end) < 1e-9")
    found: tuple[float, list[list[float]]] = page.page.evaluate(PATH, count)
    return found


def round_a_corner(page: Page) -> tuple[float, list[list[float]]]:
    """Plan a move by a via, and one that passes its end; their path."""
    move = plan(page, "nominal" if page.virtual[1] > 1.2 else "ready", 60, 0.3)
    page.page.click("#zoom-out")
    page.page.click("#zoom-out")
    page.page.locator(f".move[data-id='{move}']").press("Enter")
    page.page.select_option("#via-place", "stretch")
    page.page.click("#via")
    page.wait(f"{NEWEST}?.reason.includes('goes by a via')")
    page.page.evaluate("""() => station.session.order({ type: 'move', insertion: 'append', speed: 0.4,
        deviation: 0.1, target: { type: 'joints', q: [0.3, 1.2, -2.2, 0, 0.5, 0] } }, 'corner')""")
    page.wait(f"{NEWEST}?.reason.includes('passes the via within')")
    return path(page, 2)


def test_a_plan_with_a_via_and_a_rounded_corner_takes_the_same_path_once_loaded(page: Page, tmp_path: Path) -> None:
    page.take_control()
    # Where the virtual robot is put right, so is what is planned: then once more.
    for _ in range(4):
        page.rest()
        known = page.get(CORRECTIONS)
        lasted, was = round_a_corner(page)
        with page.page.expect_download() as download:
            page.page.click("#save")
        saved = tmp_path / "saved.jsonl"
        download.value.save_as(saved)
        clear(page)
        page.page.set_input_files("#plan-file", saved)
        page.page.click("#load-append")
        page.wait("station.polite === '3 moves are planned'")
        lasts, found = path(page, 3)
        if page.get(CORRECTIONS) == known:
            break
        page.page.evaluate("station.announce('')")
        clear(page)
    assert lasts == pytest.approx(lasted, abs=1e-6)
    assert max(math.dist(*pair) for pair in zip(found, was, strict=True)) < 1e-6
    clear(page)


def test_on_a_phone_all_tools_are_there_without_scrolling(page: Page) -> None:
    for width, height in ((390, 844), (844, 390)):
        page.page.set_viewport_size({"width": width, "height": height})
        # Whether what stands in the middle of each is its own, and nothing hides it.
        hidden = """[...document.querySelectorAll(".tools :is(button, select)")].filter((tool) => {
            const { left, top, width, height } = tool.getBoundingClientRect();
            return !tool.contains(document.elementFromPoint(left + width / 2, top + height / 2));
        }).map((tool) => tool.id)"""
        assert page.get(hidden) == []
        assert page.get("document.querySelector('#pane').getBoundingClientRect().height") >= height / 2
        track, tick = (page.page.locator(name).first.bounding_box() for name in ("#track", ".tick"))
        assert tick["y"] + tick["height"] <= track["y"] + track["height"]


def test_what_reads_plans_says_what_is_wrong(server: Child) -> None:
    def post(data: bytes) -> tuple[int, dict[str, Any]]:
        try:
            with urllib.request.urlopen(station(server) + "plan?name=a.jsonl", data, timeout=20) as answer:
                return answer.status, json.loads(answer.read())
        except urllib.error.HTTPError as refused:
            with refused:
                return refused.code, json.loads(refused.read())

    move = b'{"issue": 1, "execute": 2, "move": {"pose": "ready"}, "speed": 0.5, "motion": "line"}\n'
    status, found = post(move)
    assert (status, found["title"]) == (200, "a")
    (command,) = found["commands"]
    assert (command["type"], command["motion"], command["execute_at"]) == ("move", "line", 2.0)
    for data, why in (
        (b"", "holds no move"),
        (move + b"{", "a.jsonl:2: "),
        (b'{"issue": 1, "move": [999, 0, 0, 0, 0, 0]}', "a.jsonl:1: "),
        (move + b'{"issue": 1, "payload": {"mass_kg": 1}}', "a payload can't be taken"),
        (move * 501, "the page takes up to 500"),
        (b" " * (4 * 1024 * 1024 + 1), "up to 4194304 bytes"),
    ):
        status, found = post(data)
        assert status == 400
        assert why in found["problem"], found


def test_the_past_is_played_and_the_space_bar_is_still_stop(page: Page) -> None:
    page.take_control().rest()
    says(page, "#play", "look back first")
    page.wait("station.session.now > 8")
    page.page.evaluate("document.activeElement.blur()")
    for rate in ("0.5", "1", "2"):
        page.page.select_option("#rate", rate)
        page.page.evaluate("document.activeElement.blur(); station.cursor = station.session.now - 5")
        since = page.get("[station.cursor, performance.now() / 1000]")
        page.page.keyboard.press("k")
        page.wait(f"station.cursor > {since[0]} + 0.8 * {rate}")
        page.page.keyboard.press("k")
        cursor, at = page.get("[station.cursor, performance.now() / 1000]")
        # On a busy machine the page may be held up; it never runs ahead.
        assert cursor - since[0] <= float(rate) * (at - since[1]) + 1e-6
        page.page.wait_for_timeout(300)
        assert page.get("station.cursor") == cursor
    # Twice as fast it comes up with now, and is live.
    page.page.click("#play")
    page.wait("document.getElementById('play').ariaLabel === 'Pause'")
    page.page.evaluate("document.activeElement.blur()")
    page.page.keyboard.press("Space")
    page.wait("document.getElementById('alert').textContent === 'Stopping'")
    assert page.get("document.getElementById('play').ariaLabel") == "Pause"
    page.wait("station.cursor === null")
    assert page.page.locator("#live").get_attribute("aria-pressed") == "true"
    assert page.page.locator("#banner").is_hidden()
