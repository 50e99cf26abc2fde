"""Picture and sound by RTP to who isn't a browser: who may watch, what is seen and heard, and when it ends."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed, InvalidStatus

from interfaces import pipes
from interfaces.media import CameraConfig, camera, live
from interfaces.media.messages import Taken
from interfaces.media.peers import VideoTrack
from tests.interfaces.live_rig import until
from tests.interfaces.media.test_voice import needs_program
from tests.interfaces.media.watching import EPOCH, KEY, LENS, Page, Viewer, site

SURE = {"session": KEY, "epoch": str(EPOCH)}


def wood(picture: np.ndarray[Any, np.dtype[np.uint8]]) -> bool:
    """Whether the middle of a picture is of wood."""
    r, _, b = picture[50:70, 70:90].mean(axis=(0, 1))
    return bool(0.35 * r < b < 0.62 * r)


@needs_program
def test_pictures_and_words_arrive_and_a_page_that_closes_takes_its_peer_along() -> None:
    async def session() -> None:
        async with site() as here:
            async with here.page() as page:
                viewer = await Viewer().watch(page)
                await until(lambda: len(viewer.pictures) >= 5 and len(viewer.levels) >= 25, 60.0)
                assert wood(viewer.pictures[-1])
                assert max(viewer.levels) == 0.0
                await page.say(do="speak", text="Hello!", **SURE)
                await page.hear("media", saying="Hello!")
                await until(lambda: max(viewer.levels[-5:]) > 1000)
                await page.hear("media", saying="")
                await until(lambda: max(viewer.levels[-10:]) == 0.0)
                await page.say(do="aim", pan=1.5, tilt=0.0, **SURE)
                await page.hear("media", pan=1.5)
                seen = len(viewer.pictures)
                await until(lambda: len(viewer.pictures) > seen + 2)
                assert not wood(viewer.pictures[-1])
                assert here.media.peers == 1
                assert here.media.camera.rate > 0
            await until(lambda: here.media.peers == 0)
            assert not here.media.camera.watchers
            await viewer.close()

    asyncio.run(session())


def test_who_wants_to_hears_the_room_as_loud_as_it_is_and_sees_it_from_above() -> None:
    async def session() -> tuple[float, float]:
        async with site() as here, here.page() as page, here.page() as other:
            facts = await page.hear("media")
            assert (facts["microphone"], facts["level"]) == (True, 70)
            viewer, quiet = await Viewer().watch(page), await Viewer().watch(other)
            await until(lambda: bool(viewer.pictures) and wood(viewer.pictures[-1]), 60.0)
            assert max(viewer.levels, default=0.0) == 0.0
            await page.say(do="choose", view="overhead", hears=True)
            await until(lambda: not wood(viewer.pictures[-1]), 60.0)
            await until(lambda: max(viewer.levels) > 1000)
            heard = len(viewer.levels)
            await until(lambda: len(viewer.levels) > heard + 60)
            assert wood(quiet.pictures[-1])
            await page.say(do="choose", view="robot", hears=False)
            await until(lambda: wood(viewer.pictures[-1]))
            await until(lambda: max(viewer.levels[-5:]) == 0.0)
            await page.say(do="choose", view="sideways")
            assert "robot, overhead, both" in (await page.hear("problem"))["text"]
            found = max(viewer.levels[heard:]), max(quiet.levels)
            await viewer.close()
            await quiet.close()
            return found

    loudest, others = asyncio.run(session())
    # 6 dB less at 2 m; 85 dB are a full sine, and a swell's top is 2/√¾ of its root mean square, which is over √½.
    full = 32767 * 10 ** ((76 - 6.02 - 85) / 20) / 2**0.5
    assert loudest == pytest.approx(full * 2 / 0.75**0.5, rel=0.1)
    assert others == 0.0


def test_who_may_come_in_and_what_is_answered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "MOST_PEERS", 1)

    async def refused(page: Page, **ask: Any) -> str:
        await page.say(**ask)
        return str((await page.hear("problem"))["text"])

    async def session() -> None:
        async with site() as here:
            for token in (None, "x" * 43, 5):
                async with here.page(token) as page:  # type: ignore[arg-type]
                    with pytest.raises(ConnectionClosed) as closed:
                        await page.hear("media")
                    assert closed.value.rcvd is not None
                    assert closed.value.rcvd.code == 4401
            with contextlib.suppress(InvalidStatus):
                async with here.page(origin="http://elsewhere.example"):
                    raise AssertionError("a page from elsewhere came in")
            assert (await here.still(None))[0] == 403
            async with here.page() as one, here.page() as other:
                facts = await one.hear("media")
                assert facts["video"]
                assert "only who has control" in await refused(one, do="aim", pan=0.1, tilt=0.0)
                assert "only who has control" in await refused(one, do="speak", text="Hi", session=KEY, epoch="6")
                assert "pan must be" in await refused(one, do="aim", pan=2.0, tilt=0.0, **SURE)
                assert "text must be" in await refused(one, do="show", text="", **SURE)
                assert "do must be" in await refused(one, do="dance", **SURE)
                assert (await here.still(view="sideways"))[0] == 400
                for text in ("[1]", '{"do":5}', "no JSON", "{}"):
                    await one.socket.send(text)
                    assert "known here" in (await one.hear("problem"))["text"]
                for offer in ("", "v=0", "v=0\r\nm=video 9 UDP/TLS/RTP/SAVPF 96\r\n", "\x00" * 100):
                    assert "no picture and sound" in await refused(one, do="watch", offer=offer)
                assert here.media.peers == 0
                viewer, late = Viewer(), Viewer()
                await viewer.watch(one)
                assert "1 watch already" in await refused(other, do="watch", offer=await late.offer())
                await one.say(do="leave")
                await until(lambda: here.media.peers == 0)
                await one.say(do="show", text="Please put the book on my top side!", **SURE)
                shown = await other.hear("media", message="Please put the book on my top side!")
                assert shown["saying"] == ""
                await one.say(do="clear", **SURE)
                await other.hear("media", message="")
                await viewer.close()
                await late.close()

    asyncio.run(session())


def test_a_site_whose_video_is_switched_off_says_so() -> None:
    async def session() -> None:
        async with site(CameraConfig(lens=LENS, video=False)) as here, here.page() as page:
            facts = await page.hear("media")
            assert (facts["video"], facts["missing"]) == (False, "")
            await page.say(do="watch", offer="v=0")
            assert "it's switched off here" in (await page.hear("problem"))["text"]

    asyncio.run(session())


def test_without_the_extra_there_are_single_pictures_and_a_camera_that_fails_is_started_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(live, "missing", lambda: "aiortc, av")
    monkeypatch.setattr(camera, "AGAIN", 0.2)
    commands = iter([(["/bin/false"], {})])
    real = pipes.module_process
    monkeypatch.setattr(pipes, "module_process", lambda *words: next(commands, None) or real(*words))

    async def session() -> None:
        async with site(CameraConfig(lens=LENS)) as here, here.page() as page:
            facts = await page.hear("media")
            assert (facts["video"], facts["missing"]) == (False, "aiortc, av")
            assert "[media]" in facts["voice"]
            await page.say(do="watch", offer="v=0")
            assert "isn't installed" in (await page.hear("problem"))["text"]
            still = asyncio.create_task(here.still())
            await page.hear("media", problem="the camera gives no pictures: its process ended")
            status, kind, data = await still
            assert (status, kind) == (200, "image/jpeg")
            assert wood(picture_of(data))
            assert not wood(picture_of((await here.still(view="overhead"))[2]))
            assert not here.media.camera.wanted
            await page.say(do="speak", text="Hello!", **SURE)
            await page.hear("media", saying="Hello!")

    asyncio.run(session())


def picture_of(data: bytes) -> np.ndarray[Any, np.dtype[np.uint8]]:
    """A JPEG's pixels."""
    import io

    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def test_who_is_slow_waits_for_a_whole_picture_and_keeps_nothing_long() -> None:
    def taken(number: int, *, key: bool = False) -> Taken:
        return Taken(number, str(number).encode(), key, b"", 0.0)

    async def session() -> list[int]:
        track = VideoTrack()
        for number in range(3):
            track.put(taken(number), 0.1 * number)
        track.put(taken(3, key=True), 0.3)
        for number in range(4, 37):
            track.put(taken(number, key=number == 30), 0.1 * number)
        found = []
        with contextlib.suppress(TimeoutError):
            while True:
                async with asyncio.timeout(0.05):
                    found.append(int(bytes(await track.recv())))
        track.stop()
        return found

    found = asyncio.run(session())
    assert found == list(range(30, 37))
