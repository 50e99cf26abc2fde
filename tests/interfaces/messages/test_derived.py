"""What is derived from the definitions: nothing is stale, and a field that is added is everywhere at once."""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from random import Random
from types import ModuleType
from typing import Any

import msgspec
import pytest
from msgspec import inspect as kinds

from interfaces.messages import control
from interfaces.messages.control import Role
from interfaces.messages.description import Described, alternatives, described, type_of
from interfaces.messages.fields import Party
from interfaces.recording.channels import CHANNELS, RecordingChannel
from interfaces.stream import Encoding, codec, decode, encode
from interfaces.stream.codec import KINDS, TYPES, sent_by
from tests.interfaces.stream.drawn import plain
from tests.interfaces.stream.fuzzer import Fuzzer
from tests.interfaces.stream.make_vectors import PATH
from tests.interfaces.stream.same import same
from vrs.errors import InvalidValueError

HOME = Path(__file__).resolve().parents[3]
MESSAGES = json.loads(PATH.read_text(encoding="utf-8"))["messages"]


def loaded(path: Path) -> ModuleType:
    """A file as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[path.stem] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


generate = loaded(HOME / ".ci" / "generate.py")


class Script:
    """The generated script in a browser."""

    def __init__(self, page: Any, source: str) -> None:
        self.page = page
        page.route(
            "http://vrs.test/**", lambda route: route.fulfill(content_type="text/html", body="<!doctype html>")
        )
        page.goto("http://vrs.test/")
        page.add_script_tag(content=f"{source}\nwindow.decode = decode;", type="module")
        page.wait_for_function("window.decode !== undefined")

    def decode(self, frame: str) -> tuple[Any, list[str]]:
        """What the script makes of a frame, and what it says of it."""
        call = "(frame) => { const said = []; return [decode(frame, (text) => said.push(text)), said]; }"
        message, said = self.page.evaluate(call, frame)
        return message, said

    def takes(self, frames: list[str]) -> list[bool]:
        """Whether it takes each of them."""
        found: list[bool] = self.page.evaluate(
            "(frames) => frames.map((frame) => decode(frame, () => {}) !== null)", frames
        )
        return found


@pytest.fixture(scope="module")
def script(browser: Any) -> Iterator[Script]:
    page = browser.new_page()
    yield Script(page, generate.SCRIPT.read_text(encoding="utf-8"))
    page.close()


def test_nothing_is_stale() -> None:
    assert [path.name for path in generate.stale()] == [], f"run `{generate.COMMAND}`"


def test_what_is_stale_is_named_with_the_command_that_mends_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert generate.main(["--check"]) == 0
    monkeypatch.setattr(control.State, "sender", Party.ROBOT)
    assert generate.main(["--check"]) == 1
    told = capsys.readouterr().out
    assert "interfaces/stream/static/protocol.js" in told
    assert "run `make generate`" in told


def test_the_document_has_a_table_of_every_message_made_of_its_definition() -> None:
    document = generate.DOCUMENTS[0].read_text(encoding="utf-8")
    rows = [line for table in generate.MARKED.finditer(document) for line in table[0].splitlines()]
    assert [tag for tag in TYPES if not any(row.startswith(f"| `{tag}` |") for row in rows)] == []
    fields = [field.name for kind in KINDS for field in described(kind).fields]
    assert [name for name in fields if not any(f"`{name}`" in row for row in rows)] == []


def test_pages_take_a_word_of_a_newer_server_for_the_one_that_stands_for_it(script: Script) -> None:
    for sent, taken in (("overruled", "overruled"), ("overcame", "other")):
        frame = json.dumps({"type": "outcome", "number": 1, "made_at": 2.5, "refusal": "no", "code": sent})
        message, said = script.decode(frame)
        assert (message["code"], said) == (taken, [])
    message, said = script.decode(frame.replace('"overcame"', "5"))
    assert message is None
    assert said


# A field that is added.

ADDED = '''
from typing import Annotated

from msgspec import Meta

from interfaces.messages import control
from interfaces.messages import recording


class State(control.State, frozen=True, omit_defaults=True, gc=False, eq=False, tag="state"):
    """The real robot, warm."""

    warmth: Annotated[float, Meta(ge=-50, le=150)] = 20.0
    """Of the motors, as {0} has it [°C]."""


class Event(recording.RunEvent, frozen=True):
    """An event, warm."""

    warmth: Annotated[float, Meta(ge=-50, le=150)] = 20.0
    """Of the motors [°C]."""
'''


@pytest.fixture
def newer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """Definitions with a field more, in the place of those that are in force."""
    path = tmp_path / "newer_messages.py"
    path.write_text(ADDED.replace("{0}", "`Hello`"), encoding="utf-8")
    module: Any = loaded(path)
    newer_kinds = tuple(module.State if kind is control.State else kind for kind in KINDS)
    monkeypatch.setattr(codec, "KNOWN", frozenset(newer_kinds))
    for where in (codec, generate):
        monkeypatch.setattr(where, "KINDS", newer_kinds)
    monkeypatch.setattr("tests.interfaces.stream.drawn.KINDS", newer_kinds)
    yield module
    del sys.modules[path.stem]


def state_of(kind: Any, **more: Any) -> Any:
    """A state, by the golden vector."""
    text = next(one["json"] for one in MESSAGES if one["name"] == "state")
    known = msgspec.structs.asdict(msgspec.json.decode(text, type=control.State, dec_hook=codec.rich))
    return kind(**known, **more)


@pytest.mark.parametrize("encoding", Encoding)
def test_a_field_that_is_added_crosses_and_older_peers_pass_over_it(newer: Any, encoding: Encoding) -> None:
    frame = encode(state_of(newer.State, warmth=35.5), encoding)
    assert b"warmth" in frame
    assert decode(frame, encoding, allowed=newer.State).warmth == 35.5
    without = encode(state_of(newer.State), encoding)
    assert b"warmth" not in without
    assert decode(without, encoding, allowed=newer.State).warmth == 20.0
    older = msgspec.json if encoding is Encoding.JSON else msgspec.msgpack
    assert "warmth" not in older.decode(frame, type=control.State, dec_hook=codec.rich).__struct_fields__


def test_a_field_that_is_added_is_in_the_schema_of_recordings(newer: Any) -> None:
    events = next(channel for channel in CHANNELS if channel.topic == "/events")
    before, after = (
        json.loads(RecordingChannel("/events", events.schema, some, ()).json_schema(some))["properties"]
        for some in (events.arm, (newer.Event,))
    )
    assert after == {**before, "warmth": {"type": "number", "minimum": -50.0, "maximum": 150.0}}


def test_a_field_that_is_added_is_checked_in_the_page(newer: Any, browser: Any) -> None:
    source = generate.script(generate.messages())
    check = 'm.warmth === undefined ? 20.0 : real(m.warmth, -50, 150, "state.warmth")'
    assert f"m.warmth = {check}; // Of the motors" in source
    page = Script(browser.new_page(), source)
    frames = [encode(state_of(newer.State, **more), Encoding.JSON).decode() for more in ({}, {"warmth": 35.5})]
    assert [page.decode(frame)[0]["warmth"] for frame in frames] == [20, 35.5]
    found, said = page.decode(frames[1].replace("35.5", "151"))
    assert found is None
    assert said == ["state.warmth isn't a number from -50 to 150"]


def test_a_field_that_is_added_is_in_the_documents_table(newer: Any) -> None:
    text = "before\n<!-- fields: state -->\nold\n<!-- end -->\nafter"
    found = generate.document(text, generate.messages())
    assert found.startswith("before\n<!-- fields: state -->\n\n| `state` | | |\n")
    assert (
        "\n| `warmth` | real from −50 to 150 (20) | Of the motors, as `hello` has it [°C] |\n\n<!-- end -->\nafter"
        in found
    )
    stored = generate.document("<!-- fields: Event -->\n<!-- end -->", [described(newer.Event)])
    assert "| `warmth` | real from −50 to 150 (20) | Of the motors [°C] |" in stored


def test_a_documents_tables_say_who_may_send_what_and_what_words_mean() -> None:
    text = "<!-- roles -->\n<!-- end -->\n<!-- words: ProblemCode -->\n<!-- end -->"
    found = generate.document(text, generate.messages())
    assert "\n| `admin` | the same, and `take-over`, `give-control` |\n\n<!-- end -->" in found
    assert "\n| `version` | No common version of the protocol |\n" in found
    with pytest.raises(KeyError, match="warp"):
        generate.document("<!-- fields: warp -->\n<!-- end -->", generate.messages())


def test_tables_of_recordings_name_topics_and_parts_and_what_is_left_out() -> None:
    text = "".join(f"<!-- {what} -->\n<!-- end -->\n" for what in ("topics", "fields: begin", "fields: begin.late"))
    found = generate.document(text, generate.recorded())
    assert "\n| `/timeline` | `arcs` | mobile | A part of the whole timeline" in found
    assert "\n| `/real/joints` | `vrs.RealJoints` | arm | Joints of the real robot as measured |\n" in found
    late = "| `late` | `begin.late` (absent) | How the engine stood; absent where nothing had been commanded yet |"
    assert f"\n{late}\n" in found
    assert "\n| `begin.late` | | |\n|---|---|---|\n| `newest` | count |" in found
    samples = generate.document("<!-- fields: /real/joints -->\n<!-- end -->", generate.recorded())
    assert "\n| `play` | real | Where its timeline is played [s] |\n" in samples
    with pytest.raises(StopIteration):
        generate.document("<!-- fields: begin.warp -->\n<!-- end -->", generate.recorded())


def test_a_field_that_is_added_is_drawn(newer: Any) -> None:
    drawn = [plain(newer.State, Random(seed)).get("warmth") for seed in range(40)]
    assert None in drawn
    assert {-50.0, 150.0} <= set(drawn)


# The script and the codec agree.


def lacking(kind: kinds.Type, value: Any) -> Iterator[str]:
    """Fields that a message, or a part of it, doesn't have."""
    for one in alternatives(kind):
        if isinstance(one, Described) and isinstance(value, dict):
            told = described(one)
            if told.tag in {"", value.get(told.tag_field)}:
                yield from (field.name for field in told.fields if field.name not in value)
                for field in told.fields:
                    yield from lacking(field.type, value.get(field.name))
        for item in value if isinstance(value, list) and hasattr(one, "item_type") else ():
            yield from lacking(one.item_type, item)


def read(frame: str) -> Any:
    """A frame as the codec's own types have it."""
    kind: Any = type_of(TYPES[json.loads(frame)["type"]])
    return msgspec.json.decode(frame, type=kind.cls, dec_hook=codec.rich)


COMING = [
    one["json"] for one in MESSAGES if TYPES[json.loads(one["json"])["type"]].sender in ("Server", "Either side")
]


@pytest.mark.parametrize("frame", COMING, ids=lambda frame: json.loads(frame)["type"])
def test_the_script_fills_in_what_the_codec_does(script: Script, frame: str) -> None:
    message, said = script.decode(frame)
    assert said == []
    given = json.loads(frame)
    kind = TYPES[given["type"]]
    assert list(lacking(type_of(kind), message)) == []
    assert [name for name in given if not holds(message[name], given[name])] == []
    asked, filled = (
        decode(text.encode(), Encoding.JSON, allowed=kind, largest=1 << 20) for text in (frame, json.dumps(message))
    )
    assert same(asked, filled)


def holds(filled: Any, given: Any) -> bool:
    """Whether what was given is still there, and as it was."""
    if isinstance(given, dict):
        return all(holds(filled[name], value) for name, value in given.items())
    if isinstance(given, list):
        return len(filled) == len(given) and all(map(holds, filled, given))
    return bool(filled == given)


def test_the_script_computes_what_is_left_out(script: Script) -> None:
    change = {"type": "change", "edit": 4, "first": 0, "end": 2.5}
    computed = [script.decode(json.dumps({**change, **more}))[0] for more in ({}, {"base": 1, "tail_start": 2})]
    assert [(one["base"], one["tail_start"], one["segments"]) for one in computed] == [(3, 2.5, []), (1, 2, [])]
    pulses = ({"now": 2.5}, {"now": 2.5, "past": 1}, {"now": 2.5, "past": None})
    assert [script.decode(json.dumps({"type": "pulse", "edit": 1, **more}))[0]["past"] for more in pulses] == [
        2.5,
        1,
        None,
    ]


def test_the_script_takes_what_the_codec_takes(script: Script) -> None:
    frames, seen = [], set()
    fuzz = Fuzzer(Encoding.JSON, None, [frame.encode() for frame in COMING], Random(5))
    while len(frames) < 3000:
        frame = canonical(fuzz.mutated())
        if frame is not None and frame not in seen:
            seen.add(frame)
            frames.append(frame)
    expected = [taken(frame) for frame in frames]
    found = script.takes(frames)
    assert sum(one is True for one in expected) > 500
    assert sum(one is False for one in expected) > 500
    differ = [frame for frame, a, b in zip(frames, expected, found, strict=True) if a is not None and a is not b]
    assert differ == []


def canonical(frame: bytes) -> str | None:
    """A frame as JavaScript would write it; None where it's no map with a type that is known."""
    try:
        root = _numbers(json.loads(frame))
        return json.dumps(root) if TYPES[root["type"]].sender in ("Server", "Either side") else None
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        return None


def _numbers(value: Any) -> Any:
    """Numbers as JavaScript has them: one kind, of 53 bits."""
    if isinstance(value, dict):
        return {name: _numbers(one) for name, one in value.items()}
    if isinstance(value, list):
        return [_numbers(one) for one in value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    if abs(value) > 2**53:
        raise ValueError
    return int(value) if value == int(value) else value


def taken(frame: str) -> bool | None:
    """Whether the codec takes it; None where fields don't fit each other, of which the script knows nothing."""
    try:
        read(frame)
    except msgspec.ValidationError as error:
        return None if error.__cause__ is not None and isinstance(error.__cause__, InvalidValueError) else False
    except msgspec.MsgspecError:
        return False
    return True


def test_what_cant_be_taken_is_said_once_and_harms_nothing(browser: Any) -> None:
    script = Script(browser.new_page(), generate.SCRIPT.read_text(encoding="utf-8"))
    bad = '{"type":"pulse","edit":-1,"now":0}'
    assert script.decode(bad) == (None, ["pulse.edit isn't a whole number from 0 to 9223372036854776000"])
    assert script.decode(bad) == (None, [])
    assert script.decode('{"type":"warp","number":1}') == (None, [])
    assert script.decode("{") == (None, ["a message isn't a map"])
    message, said = script.decode('{"type":"pulse","edit":1,"now":2.5,"newer":[1]}')
    assert (message["past"], said) == (2.5, [])


# Who may send what.


def test_roles_and_what_a_server_takes_follow_from_the_messages() -> None:
    assert {kind.sender for kind in KINDS} <= set(Party)  # type: ignore[attr-defined]
    may = {role: {kind for kind in KINDS if kind in sent_by(role).__args__} for role in Role}
    assert may[Role.VIEWER] < may[Role.OPERATOR] < may[Role.ADMIN]
    assert may[Role.ADMIN] - may[Role.OPERATOR] == {control.TakeOver, control.GiveControl}
    assert control.Hello not in may[Role.ADMIN]
    assert not may[Role.VIEWER] & {
        control.Acquire,
        control.Impair,
        control.Beat,
        control.RequestControl,
        control.Withdraw,
    }
