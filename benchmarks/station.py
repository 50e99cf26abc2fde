"""The operator station: how soon a page is there, many at once, how long a page's thread is held up, its memory.

`python -m benchmarks station`; VRS_STATION_MINUTES: how long a page is open (30), VRS_STATION_PARTS: its parts.
Pages are other processes on the same machine: one in Chromium, the others as a server sees them (`visitors`).
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from benchmarks.steady import served
from interfaces import connect
from interfaces.messages import ViewForm
from robots import puma560
from vrs import Insertion, JointTarget, MotionCommand, Receipt
from vrs.model import Array

MINUTES = float(os.environ.get("VRS_STATION_MINUTES", "30"))
PARTS = os.environ.get("VRS_STATION_PARTS", "load pages tasks memory").split()
PAGES = 30
SECONDS = 20.0
LOADS = 7
VISITORS = Path(__file__).with_name("visitors.py")
FLAGS = (
    "--no-sandbox", "--disable-quic", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
)  # fmt: skip
HOLD = "--link-loss", "hold"
"""A robot that halts on a busy machine would end the motion that's looked at."""
HOME = puma560.model().poses["nominal"]
READY = "document.getElementById('station')?.dataset.ready === '' && station.session.link === 'live'"
_TURNS = """() => { const rows = window.turns ??= [];
const look = () => { const { elements } = station.scene.node('vrs', 'virtual', 'body', '1').matrix;
rows.push([station.session.now, Math.atan2(elements[1], elements[0])]); requestAnimationFrame(look); };
requestAnimationFrame(look); }"""
_LOADED = """() => { const parts = performance.getEntriesByType("resource");
const [page] = performance.getEntriesByType("navigation");
const painted = performance.getEntriesByName("first-contentful-paint")[0];
return [painted.startTime / 1e3, Math.max(...parts.map((one) => one.responseEnd)) / 1e3,
    parts.reduce((sum, one) => sum + one.transferSize, page.transferSize), parts.length + 1]; }"""
_TRACED = "toplevel", "devtools.timeline"
_TASK, _CALL = "ThreadControllerImpl::RunTask", "FunctionCall"
_LONG = 50.0
"""A task that's longer holds people up [ms]."""
_SHOWN = 12


def holds(page: Any, expression: str) -> None:
    """Wait until something is so in a page, whose policy doesn't allow Playwright's own waiting."""
    end = time.monotonic() + 60.0
    while not page.evaluate(expression):
        assert time.monotonic() < end, expression
        time.sleep(0.02)


@contextlib.contextmanager
def browser_page(url: str) -> Iterator[Any]:
    """A page in Chromium that's live."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=list(FLAGS))
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        page.goto(url)
        holds(page, READY)
        holds(page, "station.session.state !== null")
        yield page
        browser.close()


@contextlib.contextmanager
def visitors(port: int, count: int) -> Iterator[subprocess.Popen[str]]:
    """So many pages in another process."""
    command = [sys.executable, str(VISITORS), str(port), str(count)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stdout.readline() == "open\n"
        yield process
        process.stdin.close()


def frames_of(process: subprocess.Popen[str]) -> list[list[tuple[float, float]]]:
    """What has come to each of the pages since this was asked last."""
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write("\n")
    process.stdin.flush()
    found: list[list[tuple[float, float]]] = json.loads(process.stdout.readline())
    return found


def load() -> None:
    """How much a page that nobody has seen yet loads, and how soon something of it is seen, and it's live."""
    from playwright.sync_api import sync_playwright

    with served(*HOLD) as (port, _), sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path="/usr/bin/chromium", args=list(FLAGS))
        rows = []
        for _ in range(LOADS + 1):
            page = browser.new_page(viewport={"width": 1280, "height": 720})
            page.goto(f"http://127.0.0.1:{port}/")
            holds(page, READY)
            rows.append([page.evaluate("performance.now()") / 1e3, *page.evaluate(_LOADED)])
            page.close()
        browser.close()
    # The first one comes while the robot does.
    live, painted, ready, size, files = np.median(np.array(rows[1:]), axis=0)
    print(f"a page: {size / 1e3:.0f} kB in {files:.0f} files; load {os.getloadavg()[0]:.1f}")
    print(f"    first paint after {painted:.2f} s, all of it there after {ready:.2f} s, live after {live:.2f} s")


class Arm:
    """The robot as a program commands it, and when its first joint was where."""

    def __init__(self, robot: Any, port: int) -> None:
        self.robot, self.port = robot, port
        self.viewer = robot.viewer(rate=10.0, form=ViewForm.SEGMENTS)

    def move(self, first: float, speed: float) -> Receipt:
        """Turn the first joint there [rad], as soon as the robot may be commanded; what becomes of it."""
        target = HOME.copy()
        target[0] = first
        command = MotionCommand(JointTarget(target), speed=speed, insertion=Insertion.REPLACE)
        for _ in range(40):
            issued = self.robot.designer.issue(command, wait=5.0)
            if issued.receipt is not None and issued.receipt.execute_at is not None:
                return issued.receipt
            # A robot that halted, on a busy machine, goes on only when it's told to.
            self.robot.resume()
            time.sleep(0.25)
        raise AssertionError(issued)

    def sweep(self) -> tuple[float, float]:
        """Begin to turn the first joint at a steady speed for a long time; from when to when it does [s]."""
        rest = self.move(-2.6, 1.0)
        self.wait(rest.end + 0.2)
        sweep = self.move(2.6, 0.06)
        return sweep.execute_at + 1.0, sweep.end - 1.0

    def wait(self, t: float) -> None:
        """Wait for a time of the session [s]."""
        time.sleep(max(t - self.robot.now(), 0.0))

    def ages(self, frames: list[tuple[float, float]], begin: float, end: float) -> Array:
        """How old the frames were when they came [s].

        Args:
            frames: When each came, by the session's clock [s], and where the first joint was in it [rad].
            begin: From when on the first joint turned steadily [s].
            end: Until when it did [s].
        """
        t = np.linspace(begin, end, 20_000)
        turned = self.viewer.timeline.sample(t)[:, 0]
        came, first = np.array(frames).T
        inside = (came > begin + 1.0) & (came < end)
        return np.asarray(came[inside] - np.interp(first[inside], turned, t))


def edits(arm: Arm, begin: float, until: float) -> Array:
    """How long an edit takes from its order to its receipt [s]; ten a second are made and taken back."""
    took = []
    aside = HOME.copy()
    aside[5] += 0.2
    command = MotionCommand(JointTarget(aside), insertion=Insertion.APPEND)
    designer = arm.robot.designer
    arm.wait(begin)
    while arm.robot.now() < until:
        for edit in (partial(designer.issue, command, wait=5.0), partial(designer.undo, wait=5.0)):
            start = time.perf_counter()
            edit()
            took.append(time.perf_counter() - start)
            time.sleep(0.05)
    return np.array(took)


def told(name: str, ages: Array, frames: int) -> None:
    """Print a row of ages."""
    p50, p95, p99 = np.quantile(ages, (0.5, 0.95, 0.99)) * 1e3
    rate = frames / SECONDS
    print(f"{name}: a frame's age median {p50:.0f} ms, p95 {p95:.0f}, p99 {p99:.0f} ms; {rate:.0f} frames/s")


def measure(arm: Arm, server: psutil.Process, count: int, page: Any = None) -> Array:
    """Measure so many pages beside one in a browser, if there's one; how long edits took meanwhile [s]."""
    with visitors(arm.port, count) if count else contextlib.nullcontext() as others:
        begin, end = arm.sweep()
        if others is not None:
            frames_of(others)
        if page is not None:
            page.evaluate("turns.length = 0")
        busy = server.cpu_times()
        took = edits(arm, begin, begin + SECONDS)
        spent = server.cpu_times()
        if page is not None:
            rows = page.evaluate("turns.splice(0)")
            changed = [row for k, row in enumerate(rows) if k == 0 or row[1] != rows[k - 1][1]]
            told(f"the page in the browser, {count} beside it", arm.ages(changed, begin, end), len(changed))
        if others is not None:
            apart = arm.robot.now() - time.monotonic()
            found = [[(came + apart, first) for came, first in one] for one in frames_of(others)]
            each = [arm.ages(one, begin, end) for one in found]
            told(f"{count} pages", np.concatenate(each), int(np.mean([len(one) for one in found])))
            print(f"    the worst page's p95 {max(float(np.quantile(one, 0.95)) for one in each) * 1e3:.0f} ms")
        used = (spent.user + spent.system - busy.user - busy.system) / SECONDS
        print(f"    server {100 * used:.0f} % of a core; load {os.getloadavg()[0]:.1f}", flush=True)
    return took


def pages() -> None:
    """Many pages, and what edits cost with and without them, in turns; then one in a browser, alone and not."""
    with served(*HOLD) as (port, server), connect(f"127.0.0.1:{port}") as robot:
        robot.acquire()
        arm = Arm(robot, port)
        costs: dict[int, list[Array]] = {0: [], PAGES: []}
        for _ in range(2):
            for count, took in costs.items():
                took.append(measure(arm, server, count))
        for count, took in costs.items():
            p50, p99 = np.quantile(np.concatenate(took), (0.5, 0.99)) * 1e3
            print(f"{count} pages: an edit, there and back, median {p50:.1f} ms, p99 {p99:.1f} ms", flush=True)
        with browser_page(f"http://127.0.0.1:{port}/") as page:
            page.evaluate(_TURNS)
            for count in (0, PAGES - 1):
                measure(arm, server, count, page)


_DEEDS: tuple[str, ...] = (
    "document.querySelector('[data-pose=ready]').click()",
    "document.querySelector('#tab-receipts').click()",
    "document.querySelector('[data-pose=nominal]').click()",
    "station.cursor = station.session.now - 3",
    "document.querySelector('#zoom-out').click()",
    "station.cursor = null",
    "document.querySelector('#zoom-in').click()",
    "document.querySelector('#undo').click()",
    "document.querySelector('#tab-jog').click()",
    "document.querySelector('#stop').click()",
    "window.dispatchEvent(new KeyboardEvent('keydown', { code: 'KeyQ', bubbles: true }))",
    "window.dispatchEvent(new KeyboardEvent('keyup', { code: 'KeyQ', bubbles: true }))",
)
"""What somebody does with a page, one after the other."""


def use(page: Any, seconds: float) -> None:
    """Do something with a page every second."""
    if not page.evaluate("station.session.holds"):
        page.click("#take")
        holds(page, "station.session.holds")
        page.select_option("#when", "append")
    end, turn = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        page.evaluate(_DEEDS[turn % len(_DEEDS)])
        turn += 1
        time.sleep(1.0)


def tasks() -> None:
    """How long tasks hold up the page's thread while it's used, in the processor's own time, by whose they are.

    By the clock they take what other programs leave them of the processor; and what draws waits for the picture,
    where no graphics card makes it.
    """
    with served(*HOLD) as (port, _), browser_page(f"http://127.0.0.1:{port}/") as page:
        browser = page.context.browser
        browser.start_tracing(page=page, categories=list(_TRACED))
        use(page, 60.0)
        events = json.loads(browser.stop_tracing())["traceEvents"]
    renderers = {
        (one["pid"], one["tid"])
        for one in events
        if one["name"] == "thread_name" and one["args"]["name"] == "CrRendererMain"
    }
    took = [one for one in events if one.get("tdur") and (one["pid"], one["tid"]) in renderers]
    whole = np.array([[one["tdur"], one["dur"]] for one in took if one["name"] == _TASK]) / 1e3
    long = np.count_nonzero(whole > _LONG, axis=0)
    print(f"tasks of a minute of use; load {os.getloadavg()[0]:.1f}")
    print(f"    longest {whole[:, 0].max():.0f} ms of the processor's time, {long[0]} over {_LONG:.0f} ms")
    print(f"    by the clock {whole[:, 1].max():.0f} ms, {long[1]} over {_LONG:.0f} ms")
    calls: dict[str, list[float]] = {}
    for one in took:
        if one["name"] == _CALL:
            data = one["args"]["data"]
            where = f"{data.get('functionName')} {data.get('url', '').split('/', 3)[-1]}:{data.get('lineNumber')}"
            calls.setdefault(where, []).append(one["tdur"] / 1e3)
    for name, times in sorted(calls.items(), key=lambda item: -max(item[1]))[:_SHOWN]:
        print(f"    longest {max(times):5.1f} ms, {len(times):5d} times, {sum(times):6.0f} ms in all, {name}")


def memory() -> None:
    """What a page that is used keeps, after its garbage was collected, and its server."""
    looks = []
    with served(*HOLD) as (port, server), browser_page(f"http://127.0.0.1:{port}/") as page:
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable")
        begin = time.monotonic()
        while time.monotonic() < begin + 60.0 * MINUTES:
            use(page, 60.0)
            session.send("HeapProfiler.collectGarbage")
            found = {one["name"]: one["value"] for one in session.send("Performance.getMetrics")["metrics"]}
            sites = [server, *server.children(recursive=True)]
            rss = sum(site.memory_info().rss for site in sites) / 2**20
            looks.append((time.monotonic() - begin, found["JSHeapUsedSize"] / 2**20, found["Nodes"], rss))
            print(
                "{:6.0f} s  heap {:.2f} MiB, {:.0f} nodes; server and robot {:.1f} MiB".format(*looks[-1]),
                flush=True,
            )
    # Before that the page fills its quarter of an hour of measurements.
    settled = np.array([look for look in looks if look[0] > 60.0 * MINUTES * 2 / 3])
    heap, nodes, rss = np.polyfit(settled[:, 0] / 60.0, settled[:, 1:], 1)[0]
    print(f"in the last third: heap {heap:+.3f} MiB a minute, nodes {nodes:+.1f}, server and robot {rss:+.2f} MiB")


def main() -> None:
    """Run what VRS_STATION_PARTS names."""
    for name in PARTS:
        {"load": load, "pages": pages, "tasks": tasks, "memory": memory}[name]()


if __name__ == "__main__":
    main()
