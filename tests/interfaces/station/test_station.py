"""The station of `vrs serve` in a real browser: what it shows, and what it does."""

from __future__ import annotations

import os
import re
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from tests.interfaces.live_rig import Child
from tests.interfaces.pages import accessible
from tests.interfaces.station.opened import Page, paged, station, until

TOOL = "station.drag.tool()"
HOLDS = "station.session.holds"


@pytest.fixture
def page(browser: Any, server: Child) -> Iterator[Page]:
    with paged(browser, station(server)) as opened:
        yield opened.open()


def test_a_page_has_one_socket_of_each_kind(browser: Any, server: Child) -> None:
    with paged(browser, station(server)) as page:
        opened: list[str] = []
        page.page.on("websocket", lambda socket: opened.append(socket.url.rpartition("/")[2]))
        page.open()
        # The server may let the page in when its picture is there already.
        page.get(
            "(({ session }) => { const { welcome } = session; session.welcome = null; "
            "session.begin(welcome, performance.now() / 1000); })(station)"
        )
        page.page.wait_for_timeout(500)
        assert opened.count("meshcat") == 1, opened


def moved(page: Page, by: float, since: list[float]) -> bool:
    """Whether both robots have moved."""
    return all(max(abs(a - b) for a, b in zip(q, since, strict=True)) > by for q in (page.virtual, page.real))


def test_the_page_is_there_soon(server: Child) -> None:
    with urllib.request.urlopen(station(server), timeout=20) as answer:
        assert answer.status == 200
    ticks = os.sysconf("SC_CLK_TCK")
    with open(f"/proc/{server.process.pid}/stat", encoding="ascii") as file:
        used = file.read().rpartition(")")[2].split()
    # On a machine with nothing else to do that's the time which it takes.
    assert (int(used[11]) + int(used[12])) / ticks < 5.0


def test_the_page_is_a_file_and_lets_no_script_run_but_the_servers(server: Child) -> None:
    base = station(server)
    with urllib.request.urlopen(base, timeout=20) as answer:
        html, tag = answer.read().decode(), answer.headers["ETag"]
        policy = answer.headers["Content-Security-Policy"]
    again = urllib.request.Request(base, headers={"If-None-Match": tag})
    with pytest.raises(urllib.error.HTTPError) as unchanged:
        urllib.request.urlopen(again, timeout=20)
    unchanged.value.close()
    assert unchanged.value.code == 304
    rules = dict(rule.split(" ", 1) for rule in policy.split("; "))
    assert [rules[key] for key in ("default-src", "script-src", "style-src")] == ["'none'", "'self'", "'self'"]
    assert not re.search(r"<script(?![^>]* src=)|<style| on[a-z]+=| style=", html)
    parts = re.findall(r'(?:src|href)="(/[^"]+)"', html)
    assert len(parts) >= 4
    for part in parts:
        with urllib.request.urlopen(base.rstrip("/") + part, timeout=20) as answer:
            assert answer.read()


def test_a_page_that_is_used_keeps_to_its_policy(browser: Any, server: Child) -> None:
    with paged(browser, station(server)) as page:
        page.page.add_init_script(
            "window.against = []; addEventListener('securitypolicyviolation', (e) => against.push(e.blockedURI))"
        )
        page.open().take_control()
        plan(page, "nominal" if page.virtual[1] > 1.2 else "ready", 30)
        for tab in page.get("[...document.querySelectorAll('[role=tab]')].map((one) => one.id)"):
            page.page.click("#" + tab)
        page.page.click("#tab-terminal")
        page.wait("station.terminal !== null && station.terminal.text.endsWith('\\n.')")
        page.page.click("#theme")
        # What xterm.js writes as styles counts: without them characters stand in no columns.
        row = "getComputedStyle(document.querySelector('#terminal-screen .xterm-rows'))"
        page.wait(f"{row}.fontFamily.startsWith('ui-monospace') && {row}.color === 'rgb(231, 236, 243)'")
        assert page.get("against") == []


def test_what_the_page_may_not_do_isnt_done(page: Page) -> None:
    # What is evaluated from outside may evaluate texts itself; what the page does later may not.
    page.page.evaluate("""() => {
        window.ran = [];
        const say = (how) => `ran.push("${how}")`;
        setTimeout(() => {
            try { (0, eval)(say("eval")); } catch {}
            try { new Function(say("function"))(); } catch {}
            const inline = document.createElement("script");
            inline.textContent = say("script");
            document.head.append(inline);
            const handled = document.createElement("button");
            handled.setAttribute("onclick", say("attribute"));
            document.body.append(handled);
            handled.click();
            ran.push("all tried");
        });
    }""")
    page.wait("ran.includes('all tried')")
    assert page.get("ran") == ["all tried"]
    # The browser says of each what stood against it.
    assert len([text for text in page.errors if "Content Security Policy" in text]) == len(page.errors) > 0
    page.errors.clear()


def test_a_jog_moves_both_robots(page: Page) -> None:
    page.take_control().rest()
    before = page.virtual
    button = page.page.locator("button[aria-label='Joint 1 up']")
    button.hover()
    page.page.mouse.down()
    page.until(lambda: moved(page, 0.05, before))
    page.shoot("jog")
    page.page.mouse.up()
    page.rest()
    between = page.virtual
    assert between[0] > before[0] + 0.05
    assert between[1:] == pytest.approx(before[1:], abs=1e-6)
    page.page.keyboard.down("a")
    page.until(lambda: moved(page, 0.05, between))
    page.page.keyboard.up("a")
    page.rest()
    assert page.virtual[0] < between[0] - 0.05
    between = page.virtual
    button.focus()
    page.page.keyboard.down("Enter")
    page.until(lambda: moved(page, 0.05, between))
    page.page.keyboard.up("Enter")
    page.rest()
    stick = page.page.locator(".stick").bounding_box()
    height = page.get(TOOL)[2]
    page.page.mouse.move(stick["x"] + 52, stick["y"] + 52)
    page.page.mouse.down()
    start = page.virtual
    # Not far: on a busy machine the tool would be at the end of its reach before the next look.
    page.page.mouse.move(stick["x"] + 52, stick["y"] + 66, steps=4)
    page.until(lambda: moved(page, 0.02, start))
    page.page.mouse.up()
    page.rest()
    assert page.get(TOOL)[2] == pytest.approx(height, abs=0.02)
    assert "Steering" in page.page.locator("#receipts").text_content()


def test_stop_stops(page: Page) -> None:
    page.take_control()
    for stop in (
        lambda: page.page.keyboard.press("Space"),
        lambda: page.page.click("#stop"),
        lambda: page.page.locator("#stop").press("Enter"),
    ):
        page.page.fill("#speed", "10")
        target = "ready" if page.virtual[1] < 1.2 else "nominal"
        start = page.virtual
        page.page.click(f"[data-pose={target}]")
        page.until(lambda start=start: moved(page, 0.02, start))
        stop()
        page.wait("document.getElementById('alert').textContent === 'Stopping'")
        page.shoot("stop")
        page.rest()
        asked = page.get(f"station.session.welcome.poses.{target}")
        assert max(abs(a - b) for a, b in zip(page.virtual, asked, strict=True)) > 0.1
        page.page.evaluate("document.activeElement.blur()")


def test_the_tool_goes_where_it_is_dragged(page: Page) -> None:
    page.take_control()
    page.page.fill("#speed", "60")
    page.page.click("[data-pose=nominal]")
    page.wait("station.session.timeline.end > station.session.now")
    page.rest()
    page.wait("!document.getElementById('handle').hidden")
    pane = page.page.locator("#pane").bounding_box()
    start = page.get(TOOL)
    at = page.get(f"station.drag.project({TOOL})")
    x, y = pane["x"] + at["x"], pane["y"] + at["y"]
    camera = page.get("station.scene.viewer.camera.position.toArray()")
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x - 70, y - 45, steps=6)
    target = page.get("station.drag.target")
    assert target is not None
    page.shoot("drag")
    page.page.mouse.up()
    assert sum((a - b) ** 2 for a, b in zip(target, start, strict=True)) ** 0.5 > 0.05
    page.wait("station.drag.target === null")
    page.rest()
    assert page.get(TOOL) == pytest.approx(target, abs=0.005)
    real = page.get("station.chain.toolAt(station.session.state.q)")
    assert real == pytest.approx(target, abs=0.005)
    assert page.get("station.scene.viewer.camera.position.toArray()") == pytest.approx(camera)


def scheduled(page: Page) -> dict[str, tuple[float, float]]:
    """Moves to come, as the plan has them."""
    moves = page.get(
        """(() => { const found = {}; const { timeline, now } = station.session;
        for (const { commandId, start, duration } of timeline.segments) if (commandId !== null && start > now) {
            const known = (found[commandId] ??= [start, start]); known[1] = start + duration; }
        return found; })()"""
    )
    return {name: tuple(span) for name, span in moves.items()}


def same(plan: dict[str, tuple[float, float]], other: dict[str, tuple[float, float]]) -> bool:
    return plan.keys() == other.keys() and all(plan[name] == pytest.approx(other[name], abs=1e-6) for name in plan)


def plan(page: Page, pose: str, seconds: float) -> str:
    """Schedule a move; its number."""
    known = scheduled(page)
    page.page.select_option("#when", "later")
    page.page.fill("#later", str(seconds))
    page.page.click(f"[data-pose={pose}]")
    until(lambda: len(scheduled(page)) > len(known))
    return next(name for name in scheduled(page) if name not in known)


@pytest.mark.slow
def test_a_scheduled_move_is_drawn_along_and_runs_then(page: Page) -> None:
    page.take_control().rest()
    page.page.fill("#speed", "30")
    first = plan(page, "ready" if page.virtual[1] < 1.2 else "nominal", 14)
    begin, end = scheduled(page)[first]
    bar = page.page.locator(f".move[data-id='{first}']")
    track = page.page.locator("#track").bounding_box()
    # The strip goes on while the hand comes: it's put to the left part of the bar.
    box = bar.bounding_box()
    x, y = box["x"] + 0.3 * box["width"], box["y"] + 20
    page.page.mouse.move(x, y)
    page.page.mouse.down()
    page.page.mouse.move(x + track["width"] / 10, y, steps=3)
    page.page.mouse.up()
    page.until(lambda: scheduled(page).get(first, (0, 0))[0] > begin + 1)
    shifted = scheduled(page)[first][0] - begin
    # A tenth of the strip is 3 s, and the hand takes its time.
    assert 1.5 < shifted < 12
    page.shoot("strip")
    bar.focus()
    for key in ("Shift+ArrowLeft", "ArrowRight", "ArrowRight"):
        page.page.keyboard.press(key)
    page.until(lambda: abs(scheduled(page)[first][0] - begin - shifted + 0.8) < 1e-3)
    begin, end = scheduled(page)[first]
    still = page.virtual
    page.wait(f"station.session.now > {begin - 1}")
    assert page.virtual == pytest.approx(still, abs=1e-6)
    page.wait(f"station.session.now > {end}")
    page.rest()
    assert max(abs(a - b) for a, b in zip(page.virtual, still, strict=True)) > 0.5


def test_scheduled_moves_are_split_taken_back_and_deleted(page: Page) -> None:
    page.take_control().rest()
    move = plan(page, "nominal" if page.virtual[1] > 1.2 else "ready", 40)
    page.page.click("#zoom-out")
    page.page.locator(f".move[data-id='{move}']").press("Enter")
    page.page.select_option("#via-place", "stretch")
    before = scheduled(page)
    page.page.click("#via")
    until(lambda: not same(scheduled(page), before))
    page.page.click("#tab-receipts")
    until(lambda: "By another place" in page.page.locator("#receipts li").first.text_content())
    page.page.click("#undo")
    page.until(lambda: same(scheduled(page), before))
    page.page.locator(f".move[data-id='{move}']").press("Delete")
    until(lambda: scheduled(page) == {})
    page.page.click("#tab-jog")
    move = plan(page, "stretch", 40)
    page.page.locator(f".move[data-id='{move}']").press("Enter")
    page.page.click("#delete")
    until(lambda: scheduled(page) == {})


def test_what_the_strips_buttons_cant_do_now_they_say(page: Page) -> None:
    notice = "document.getElementById('notice').textContent"

    def says(button: str, words: str) -> None:
        assert page.page.locator(button).get_attribute("aria-disabled") == "true"
        page.page.locator(button).click(force=True)
        page.wait(f"{notice}.toLowerCase().includes({words!r})")
        page.page.keyboard.press("Escape")

    says("#undo", "take control first")
    says("#delete", "take control first")
    page.take_control().rest()
    says("#via", "choose a move")
    move = plan(page, "nominal" if page.virtual[1] > 1.2 else "ready", 40)
    page.page.click("#zoom-out")
    page.page.locator(f".move[data-id='{move}']").press("Enter")
    page.wait("!document.getElementById('delete').ariaDisabled")
    page.page.click("#delete")
    until(lambda: scheduled(page) == {})


def test_one_looks_back_while_the_robot_goes_on(page: Page) -> None:
    page.take_control().rest()
    rest = page.virtual
    page.page.fill("#speed", "100")
    page.page.click("[data-pose=zero]")
    page.until(lambda: moved(page, 0.3, rest))
    page.rest()
    track = page.page.locator("#track").bounding_box()
    page.page.mouse.move(track["x"] + 0.39 * track["width"], track["y"] + 90)
    page.page.mouse.down()
    page.page.mouse.move(track["x"] + 5, track["y"] + 90, steps=3)
    page.page.mouse.up()
    shown = page.get("station.cursor")
    assert shown < page.get("station.session.now") - 5
    assert "Confirmed" in page.page.locator("#badge").text_content()
    assert "another time" in page.page.locator("#banner").text_content()
    drawn = "station.scene.node('vrs', '%s', 'body', '6').position.toArray()"
    then = page.get(f"station.chain.links(station.session.timeline.joints({shown})).at(-1).slice(12, 15)")
    assert page.get(drawn % "virtual") == pytest.approx(then, abs=1e-9)
    page.page.select_option("#when", "now")
    before = page.virtual
    # Nobody steers by a picture of another time; a move that is planned is one's own business.
    up = page.page.locator("button[aria-label='Joint 1 up']")
    assert up.get_attribute("title") == "You look at another time: press Live to steer."
    up.click(delay=200, force=True)
    page.wait("document.getElementById('notice').textContent.includes('press Live to steer')")
    page.page.evaluate("document.activeElement.blur()")
    page.page.keyboard.press("q", delay=200)
    assert page.virtual == pytest.approx(before, abs=1e-9)
    page.page.click("[data-pose=nominal]")
    page.until(lambda: moved(page, 0.3, before))
    assert page.get("station.cursor") == shown
    page.shoot("past")
    assert page.get(drawn % "virtual") == pytest.approx(then, abs=1e-9)
    page.page.click("#live")
    page.rest()
    now = page.get("station.chain.links(station.session.timeline.joints(station.session.now)).at(-1).slice(12, 15)")
    for twin in ("virtual", "real"):
        until(lambda twin=twin: page.get(drawn % twin) == pytest.approx(now, abs=2e-3))
    assert page.page.locator("#banner").is_hidden()


def test_a_second_one_watches_until_control_is_given(browser: Any, server: Child, page: Page) -> None:
    page.take_control().rest()
    with paged(browser, station(server)) as second:
        second.open()
        assert "has control" in second.page.locator("#control-pill").text_content()
        assert second.page.locator("#take").is_hidden()
        # STOP works for who has control alone, and is there for nobody else.
        assert second.page.locator("#stop").is_hidden()
        assert page.page.locator("#stop").is_visible()
        second.shoot("watching")
        before = page.virtual
        second.page.evaluate("window.said = []; station.on('problem', (problem) => said.push(problem.text))")
        second.page.click("[data-pose=ready]", force=True)
        up = second.page.locator("button[aria-label='Joint 1 up']")
        assert "has control" in up.get_attribute("title")
        up.click(delay=300, force=True)
        second.page.keyboard.press("q", delay=300)
        # A page that pretends to have control is refused by the server.
        second.page.evaluate(
            """window.pretended = station.session.orders.give({type: 'move',
            target: {type: 'joints', q: station.session.welcome.poses.zero}}, '1', performance.now() / 1000, '')"""
        )
        second.wait("pretended.outcome !== null && pretended.outcome.refusal.startsWith('no lease')")
        until(lambda: len(second.get("said")) >= 2)
        second.page.keyboard.press("Space")
        second.wait("document.getElementById('alert').textContent.includes(\"can't stop the robot\")")
        time.sleep(0.3)
        assert page.virtual == pytest.approx(before, abs=1e-9)
        assert page.get(HOLDS)
        page.page.click("#give")
        second.wait("!document.getElementById('take').hidden")
        assert second.page.locator("#stop").is_visible()
        second.take_control()
        page.wait("document.getElementById('stop').hidden")
        page.wait("document.getElementById('control-pill').textContent.includes('has control')")
        second.page.click("[data-pose=ready]" if before[1] < 1.2 else "[data-pose=nominal]")
        page.until(lambda: moved(page, 0.05, before))
        assert not page.get(HOLDS)


@pytest.mark.parametrize(("scheme", "width", "height"), [("light", 1280, 720), ("dark", 1920, 1080)])
def test_everyone_can_use_it(browser: Any, server: Child, scheme: str, width: int, height: int) -> None:
    with paged(browser, station(server), viewport={"width": width, "height": height}, color_scheme=scheme) as page:
        page.open().take_control().rest()
        plan(page, "nominal" if page.virtual[1] > 1.2 else "ready", 30)
        page.shoot(scheme)
        for tab in ("jog", "receipts", "network"):
            page.page.click(f"#tab-{tab}")
            accessible(page.page)
        assert page.get("document.documentElement.dataset.theme") == scheme
        size = "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
        assert page.get(size) == [width, height]
        page.page.click("#tab-jog")
        panels = page.page.locator("#tab-panels")
        assert panels.evaluate(
            "(box) => box.scrollHeight <= box.clientHeight && box.scrollWidth <= box.clientWidth"
        )
        stop = page.page.locator("#stop").bounding_box()
        assert (stop["x"] + stop["width"], stop["y"]) == (width, 0)
        page.page.click("#theme")
        assert page.get("document.documentElement.dataset.theme") != scheme
        page.page.keyboard.press("Space")


def test_a_message_that_cant_be_taken_is_said_once_and_the_page_lives(page: Page) -> None:
    number, said = page.get("""() => {
        const [{ session }, said] = [station, []];
        const bad = JSON.stringify({ ...session.state, q: ["0"] });
        const warn = console.warn;
        console.warn = (text) => said.push(text);
        for (const frame of [bad, bad, "{", '{"type":"warp"}']) session.hear(frame);
        console.warn = warn;
        return [session.state.number, said];
    }""")
    assert said == ["state.q isn't a number from -1000000000 to 1000000000", "a message isn't a map"]
    page.wait(f"station.session.state.number > {number}")
    assert page.errors == []


def test_strangers_are_turned_away(server: Child) -> None:
    base = station(server).rstrip("/")
    port = base.rpartition(":")[2]
    for name, value in (
        ("Origin", "http://evil.example"),
        ("Host", "evil.example"),
        ("Host", f"localhost.evil:{port}"),
    ):
        for path in ("/", "/station/station.js"):
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(urllib.request.Request(base + path, headers={name: value}), timeout=5)
            refused.value.close()
            assert refused.value.code == 403
    for path in ("/elsewhere", "/station/../page.py", "/station/index.html", "/station/x.js"):
        with pytest.raises(urllib.error.HTTPError) as missing:
            urllib.request.urlopen(base + path, timeout=5)
        missing.value.close()
        assert missing.value.code == 404
    for path, origin in (("ws", "http://evil.example"), ("elsewhere", base), ("", base)):
        with (
            pytest.raises(InvalidStatus),
            connect(f"ws://127.0.0.1:{port}/{path}", origin=origin, subprotocols=["vrs.1.json"]),
        ):
            pass
