"""The reader in JavaScript, in a real browser, on the golden vectors: the same joints, the same clock."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import interfaces.stream
from interfaces.messages import Compact
from interfaces.messages.compact import CompactDecoder
from tests.interfaces.stream.make_vectors import PATH
from vrs.errors import InvalidValueError

STATIC = Path(interfaces.stream.__file__).parent / "static"
VECTORS: dict[str, Any] = json.loads(PATH.read_text(encoding="utf-8"))
NAMES = {"vrs.js": "decode, evaluate, segmentsOf, Timeline, Reader, ClockSync", "compact.js": "CompactReader"}
PLAY = """({ steps, lost, doubled }) => {
  const asked = [], reader = new vrs.Reader((m) => asked.push(m));
  const give = (text, now) => reader.receive(text, now);
  reader.follow(0);
  steps.forEach(({ now, messages }, step) => {
    const some = messages.filter((_, k) => !lost.includes(step));
    if (doubled) some.reverse();
    for (const text of some) { give(text, now); if (doubled) give(text, now); }
  });
  window.reader = reader;
  return { asked, edit: reader.edit, past: reader.past, behind: reader.behind };
}"""
SAMPLES = "(samples) => samples.map(({ t, derivative }) => reader.joints(t, derivative))"


def served(route: Any) -> None:
    """Answer a page's request for a script that stands beside the reader."""
    name = route.request.url.rpartition("/")[2]
    if name:
        route.fulfill(content_type="text/javascript", body=(STATIC / name).read_text(encoding="utf-8"))
    else:
        route.fulfill(content_type="text/html", body="<!doctype html>")


@pytest.fixture(scope="module")
def page(browser: Any) -> Iterator[Any]:
    seen: list[str] = []
    opened = browser.new_page()
    opened.on("pageerror", lambda error: seen.append(str(error)))
    opened.on("console", lambda said: seen.append(said.text))
    opened.route("http://vrs.test/**", served)
    opened.goto("http://vrs.test/")
    for file, names in NAMES.items():
        opened.add_script_tag(
            content=f'import {{ {names} }} from "/{file}"; window.vrs = {{ ...window.vrs, {names} }};',
            type="module",
        )
    opened.wait_for_function("Boolean(window.vrs?.Reader && vrs.CompactReader)")
    yield opened
    opened.close()
    assert seen == []


def test_segments_are_evaluated_to_the_bit(page: Any) -> None:
    found = page.evaluate(
        "(vectors) => vectors.map((v) => v.at.map((at) => vrs.evaluate(v, at.u, at.derivative)))",
        VECTORS["evaluations"],
    )
    assert found == [[at["value"] for at in vector["at"]] for vector in VECTORS["evaluations"]]


def test_segments_are_read_to_the_bit(page: Any) -> None:
    text = next(v["json"] for v in VECTORS["messages"] if v["name"] == "history")
    found = page.evaluate("(text) => vrs.segmentsOf(vrs.decode(text))", text)
    assert [segment["start"] for segment in found] == [2.5, 3.25, np.nextafter(3.35, 4)]
    assert [segment["commandId"] for segment in found] == [None, 7, 7]
    assert [segment["coefficients"] for segment in found] == [row[2] for row in json.loads(text)["segments"]]


@pytest.mark.parametrize("doubled", [False, True], ids=["once", "twice"])
def test_the_copy_has_the_engines_joints(page: Any, doubled: bool) -> None:
    stream = VECTORS["stream"]
    # Reversed, the parts of one step come before what they build on.
    done = page.evaluate(PLAY, {"steps": stream["steps"], "lost": [], "doubled": doubled})
    assert not done["behind"]
    assert done["past"] > 1.0
    if not doubled:
        asked = [json.loads(request) for step in stream["steps"] for request in step["asked"]]
        assert done["asked"] == asked
    found = page.evaluate(SAMPLES, stream["samples"])
    expected = [sample["value"] for sample in stream["samples"]]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


def test_what_is_lost_is_asked_for_again(page: Any) -> None:
    steps = VECTORS["stream"]["steps"]
    done = page.evaluate(PLAY, {"steps": steps, "lost": [5], "doubled": False})
    assert done["behind"]
    assert done["asked"][-1] == {"type": "want", "edit": done["edit"]}
    again = page.evaluate("() => { reader.send = (m) => (window.sent = m); reader.advance(100); return sent; }")
    assert again == done["asked"][-1]
    page.evaluate("({ messages }) => messages.forEach((text) => reader.receive(text, 101))", steps[5])
    found = page.evaluate(SAMPLES, VECTORS["stream"]["samples"])
    expected = [sample["value"] for sample in VECTORS["stream"]["samples"]]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    assert page.evaluate("() => { window.sent = null; reader.advance(1000); return [sent, reader.behind]; }") == [
        None,
        False,
    ]


def test_a_new_scene_costs_only_what_hasnt_passed(page: Any) -> None:
    # Before the stop, which drops what hasn't passed.
    page.evaluate(PLAY, {"steps": VECTORS["stream"]["steps"][:10], "lost": [], "doubled": False})
    sent = page.evaluate(
        """() => { const sent = [], old = reader.timeline; reader.send = (m) => sent.push(m);
        const { initial, start, segments } = old, edit = reader.edit + 5;
        const give = (message, now) => reader.receive(JSON.stringify({ robot: 'arm', ...message }), now);
        const scene = { type: 'scene', number: 1, initial, start, end: 9, segments: segments.length, edit, now: 1 };
        give(scene, 50); const index = reader.passed();
        const rows = segments.slice(index).map((s) => [s.duration, s.commandId, s.coefficients, s.start]);
        give({ type: 'history', edit, index, dof: 6, start: 0, segments: rows }, 51);
        const kept = segments[index - 1], end = kept.start + kept.duration;
        const same = segments.every((s, k) => s.start === reader.timeline.segments[k].start);
        return [sent, index, end, reader.past, reader.edit - edit, same]; }"""
    )
    (want, later), index, end, past, behind, same = sent
    assert want["index"] == index > 0
    assert end <= past
    assert behind == 0
    assert "index" not in later
    assert same


@pytest.mark.parametrize("first", ["1e6", "reader.timeline.segments.length"], ids=["beyond the end", "wrong end"])
def test_an_edit_that_doesnt_fit_makes_it_begin_again(page: Any, first: str) -> None:
    steps = VECTORS["stream"]["steps"]
    page.evaluate(PLAY, {"steps": steps, "lost": [], "doubled": False})
    sent = page.evaluate(
        f"""() => {{ const sent = []; reader.send = (m) => sent.push(m);
        const change = {{ type: 'change', edit: reader.edit + 1, first: {first}, end: 3 }};
        reader.receive(JSON.stringify(change), 50); return sent; }}"""
    )
    assert sent == [{"type": "follow", "number": 2, "form": "segments"}]
    assert page.evaluate("() => reader.joints(0)") is None


def test_the_clock_is_pythons_and_never_runs_back(page: Any) -> None:
    found = page.evaluate(
        """(vectors) => { const sync = new vrs.ClockSync(); return vectors.map(({ trip, later }) => {
        sync.receive(...trip); const { offset, uncertainty } = sync.estimate(trip[3]);
        return [offset, uncertainty, sync.time(later), sync.uncertainty(later)]; }); }""",
        VECTORS["clock"],
    )
    names = ("offset", "uncertainty", "time", "mapped_uncertainty")
    expected = [[vector[name] for name in names] for vector in VECTORS["clock"]]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


def test_after_a_step_of_the_other_clock_mapped_time_goes_on(page: Any) -> None:
    times, late = page.evaluate(
        """() => { const sync = new vrs.ClockSync(), times = [];
        const none = [sync.time(0), sync.uncertainty(0) === Infinity, sync.estimate(0)];
        for (let k = 0; k < 400; k++) { const t = 0.1 * k, step = k < 200 ? 0 : -1;
          sync.receive(t, t + 50 + step, t + 50 + step, t + 0.01); sync.receive(t, NaN, t + 50, t + 0.01);
          for (let i = 2; i < 9; i++) times.push(sync.time(t + 0.01 * i)); }
        return [times, [...none, sync.time(40) - 40, sync.estimate(40)]]; }"""
    )
    assert np.all(np.diff(times) > 0)
    assert late[:3] == [None, True, None]
    assert late[4]["offset"] == pytest.approx(49.0, abs=0.006)
    # 20 s after a step of 1 s at 5 %: the map has caught up.
    assert late[3] == pytest.approx(49.0, abs=0.01)


READ_COMPACT = """(vectors) => { const reader = new vrs.CompactReader();
  return vectors.map(({ json }) => [reader.receive(JSON.parse(json)), reader.lacking]); }"""


def test_compact_frames_are_read_to_the_bit(page: Any) -> None:
    found = page.evaluate(READ_COMPACT, VECTORS["compact"])
    assert [lacking for _, lacking in found] == [vector["lacking"] for vector in VECTORS["compact"]]
    for (frames, _), vector in zip(found, VECTORS["compact"], strict=True):
        for frame in frames:
            frame["made_at"] = frame.pop("madeAt")
            frame["status"] = "predicted" if frame.pop("predicted") else "confirmed"
        assert frames == vector["frames"]


def test_compact_bytes_that_are_wrong_are_refused_as_in_python(page: Any) -> None:
    rng = np.random.default_rng(6)
    whole = [bytes.fromhex(vector["hex"]) for vector in VECTORS["compact"]]
    long = ("9" + "8" * (digits - 1) + "0" + "10" + "01040" + "000" for digits in (17, 18, 30))
    given = [bytes.fromhex(text + "0" * (len(text) % 2)) for text in long]
    for _ in range(3000):
        data = bytearray(whole[rng.integers(len(whole))])
        for _ in range(rng.integers(0, 3)):
            data[rng.integers(len(data))] = rng.integers(256)
        given.append(bytes(data[: rng.integers(2, len(data) + 1)] if rng.random() < 0.2 else data))
    found = page.evaluate(
        """(rows) => { let reader = new vrs.CompactReader(); return rows.map((q, k) => {
        if (k % 5 === 0) reader = new vrs.CompactReader();
        try { return reader.receive({ q }).map(({ number, t, q }) => [number, t, q]); }
        catch (error) { if (error instanceof RangeError) return error.message && "refused"; throw error; } }); }""",
        [base64.b64encode(data).decode() for data in given],
    )
    expected: list[Any] = []
    reader = CompactDecoder()
    for k, data in enumerate(given):
        reader = CompactDecoder() if k % 5 == 0 else reader
        try:
            frames = [b.frame for b in reader.receive(Compact(data))]
            expected.append([[frame.number, frame.t, frame.q.tolist()] for frame in frames])
        except InvalidValueError:
            expected.append("refused")
    assert found == expected
    assert expected.count("refused") > 300
    assert sum(bool(frames) and frames != "refused" for frames in expected) > 100
