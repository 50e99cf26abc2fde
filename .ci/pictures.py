"""Makes the pictures of README and docs: `.venv/bin/python .ci/pictures.py [NAME ...]`, all of them without a name.

They are made of what a reader sees, in Chromium: the report of the tutorial's run, and the stations of both robots.
"""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

HOME: Final = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(HOME))
from tests.documented import written_files  # noqa: E402
from tests.interfaces.conftest import FLAGS  # noqa: E402
from tests.interfaces.live_rig import child  # noqa: E402
from tests.interfaces.station.opened import Page, paged, station  # noqa: E402

SIZE: Final = {"width": 1280, "height": 720}
LARGEST: Final = 150_000
"""Of a picture [bytes]."""


def report(browser: Any, scratch: Path) -> bytes:
    """The report of the tutorial's run over `wed`, at an instant at which both arms are under way."""
    (scratch / "plan.jsonl").write_text(written_files(HOME / "docs" / "tutorial.md")["plan.jsonl"])
    asked = ("demo", "--commands", "plan.jsonl", "--delay", "wed", "--seed", "6", "--out", "wed")
    subprocess.run([sys.executable, "-m", "interfaces.cli", *asked], cwd=scratch, check=True, capture_output=True)
    page = browser.new_context(viewport=SIZE, color_scheme="light").new_page()
    page.goto((scratch / "wed" / "report.html").as_uri())
    page.evaluate("const s = document.getElementById('time'); s.value = 3.4; s.dispatchEvent(new Event('input'))")
    page.evaluate("document.querySelector('.scene').scrollIntoView()")
    page.wait_for_timeout(2500)
    return page.screenshot()


def strip(browser: Any, _: Path) -> bytes:
    """A scheduled move on the arm's station, and the path to which the real arm is committed."""
    return _stationed(browser, ("--delay", "constant:1.2"), _schedule, "light")


def drive(browser: Any, _: Path) -> bytes:
    """The mobile robot among furniture, driven by keys."""
    return _stationed(browser, ("--delay", "constant:0.6", "--robot", "ipr", "--room", "furnished"), _drive, "dark")


def _stationed(browser: Any, given: tuple[str, ...], do: Callable[[Page], None], scheme: str) -> bytes:
    with (
        child("serve", "--link-loss", "hold", "--port", "0", *given) as server,
        paged(browser, station(server), viewport=SIZE, color_scheme=scheme) as page,
    ):
        page.open().take_control()
        page.page.wait_for_timeout(1500)
        page.page.evaluate("station.scene.pacing.set(0)")
        do(page)
        page.page.evaluate("station.scene.pacing.viewer.set_dirty()")
        page.page.wait_for_timeout(400)
        picture: bytes = page.page.screenshot()
        return picture


def _schedule(page: Page) -> None:
    for q, more in (([0.6, 1.0, -2.2, 0, 0.5, 0], {}), ([-0.9, 0.5, -1.6, 0.3, 0.9, 0], {"insertion": "append"})):
        target = {"type": "joints", "q": q}
        page.page.evaluate(
            "c => station.session.order(c)", {"type": "move", "target": target, "speed": 0.06, **more}
        )
    page.wait("station.session.state.q[0] > 0.2")


def _drive(page: Page) -> None:
    page.page.keyboard.down("ArrowUp")
    page.page.wait_for_timeout(3500)
    page.page.keyboard.down("ArrowRight")
    page.page.wait_for_timeout(1800)


PICTURES: Final[dict[str, Callable[[Any, Path], bytes]]] = {
    "report-wed": report,
    "station-strip": strip,
    "drive": drive,
}


def small(picture: bytes) -> bytes:
    """The same picture in few colours, as many as leave it below `LARGEST`."""
    from PIL import Image

    image = Image.open(io.BytesIO(picture)).convert("RGB")
    for colours in (256, 192, 128, 96, 64, 48, 32):
        found = io.BytesIO()
        image.quantize(colours, dither=Image.Dither.NONE).save(found, "png", optimize=True)
        if found.tell() <= LARGEST:
            break
    return found.getvalue()


def main(names: list[str]) -> None:
    """Make pictures."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as scratch:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        for name in names or PICTURES:
            (HOME / "docs" / "images" / f"{name}.png").write_bytes(small(PICTURES[name](browser, Path(scratch))))
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
