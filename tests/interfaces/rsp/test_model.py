"""Robot models: values that are checked, XMI that comes back the same, and files that are refused."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from interfaces.rsp.model import (
    Command,
    Effector,
    Element,
    Event,
    Filling,
    MemoryCommand,
    MemoryEvent,
    Module,
    Monitor,
    OnLoss,
    RobotModel,
    Scalar,
    Sensor,
    example,
    parse_model,
    read_model,
    write_model,
)
from robots.cubo import parameters
from vrs.errors import FormatError, InvalidValueError

TEXTS = st.from_regex(re.compile(r"[ -!#-&(-\[\]-~]{0,12}", re.ASCII), fullmatch=True)
WHOLE = [scalar for scalar in Scalar if scalar is not Scalar.F32]


@st.composite
def elements(draw: st.DrawFn, name: str, effectors: list[str], told: list[str]) -> Element:
    """An element that fits to those before it."""
    valued = {
        "type": draw(st.sampled_from(Scalar)),
        "count": draw(st.integers(1, 8)),
        "unit": draw(TEXTS),
        "scale": draw(st.sampled_from((1.0, 0.001, -2.5, 1e-9))),
        "binding": draw(TEXTS),
    }
    kinds = [Effector, Sensor, Command, Event, MemoryCommand, MemoryEvent]
    kind = draw(st.sampled_from(kinds + [Monitor] * bool(effectors) + [Module] * bool(told)))
    match kind.__name__:
        case "Effector":
            valued["type"] = draw(st.sampled_from(WHOLE))
            extra = {"filling": draw(st.sampled_from(Filling)), "on_loss": draw(st.sampled_from(OnLoss))}
            low = draw(st.sampled_from((-100.0, float("-inf"))))
            return Effector(name, **valued, **extra, low=low, stream=draw(st.sampled_from((0, 0, 1952))))
        case "Monitor":
            return Monitor(name, draw(st.sampled_from(effectors)))
        case "Module":
            return Module(name, tuple(draw(st.lists(st.sampled_from(told), min_size=1, unique=True))))
        case "MemoryCommand" | "MemoryEvent":
            return kind(name, size=draw(st.integers(1, 16_384)), binding=draw(TEXTS))
        case _:
            return kind(name, **valued)


@st.composite
def models(draw: st.DrawFn) -> RobotModel:
    """Models of any elements."""
    made: list[Element] = []
    for k in range(draw(st.integers(1, 12))):
        effectors = [e.name for e in made if isinstance(e, Effector) and not e.stream]
        told = [e.name for e in made if isinstance(e, Sensor | Monitor | Event)]
        made.append(draw(elements(f"{draw(st.sampled_from('abz'))}_{k}", effectors, told)))
    return RobotModel("robot", draw(st.integers(0, 65_535)), tuple(made), draw(st.integers(1, 255)))


@settings(max_examples=20, deadline=None)
@given(models())
def test_a_model_comes_back_from_xmi_the_same(model: RobotModel) -> None:
    data = write_model(model)
    assert parse_model(data) == model
    assert write_model(parse_model(data)) == data


def test_cubos_model_is_the_papers_robot() -> None:
    model = read_model(parameters.MODEL_FILE)
    kinds = [type(element).__name__ for element in model]
    assert kinds.count("Sensor") == 6
    assert len(set(kinds)) == 8
    assert len(model.elements) == 24
    assert write_model(model) == parameters.MODEL_FILE.read_bytes()


XMI = write_model(example())
BAD = {
    "nothing": (b"", "XML"),
    "not XML": (b"\x7fELF" + bytes(100), "XML"),
    "not a robot": (b"<a/>", "root must be a Robot"),
    "another text": (XMI.replace(b"UTF-8", b"UTF-16"), "UTF-8"),
    "not UTF-8": (XMI.replace(b"rover", b"r\xffver"), "UTF-8"),
    "a doctype": (XMI.replace(b"<rsp:Robot", b'<!DOCTYPE x [<!ENTITY a "b">]><rsp:Robot', 1), "DOCTYPE"),
    "another file": (XMI.replace(b'effector="left_wheel"', b'effector="file:///etc/passwd#//x"'), "effector"),
    "a reference out": (XMI.replace(b"effector=", b"href="), "href"),
    "an unknown kind": (XMI.replace(b"rsp:Sensor", b"rsp:Robot"), "xsi:type"),
    "an unknown attribute": (XMI.replace(b"count=", b"colour="), "colour"),
    "no name": (XMI.replace(b'name="position" ', b""), "position"),
    "twice": (XMI.replace(b'name="right_wheel"', b'name="left_wheel"'), "name"),
    "a number that's none": (XMI.replace(b'count="3"', b'count="three"'), "three"),
    "out of range": (XMI.replace(b'count="3"', b'count="0"'), "count of position"),
    "infinite": (XMI.replace(b'scale="0.001"', b'scale="inf"'), "scale"),
    "an unknown word": (XMI.replace(b'type="u8"', b'type="u7"'), "u7"),
    "an unknown member": (XMI.replace(b'members="position', b'members="nobody'), "nobody"),
    "a member that isn't told": (XMI.replace(b'members="position', b'members="ir_fire'), "sensing"),
    "text": (XMI.replace(b"<elements", b"words<elements", 1), "text"),
    "nested": (XMI.replace(b"/>", b"><elements/></elements>", 1), "doesn't belong"),
    "an instruction": (XMI.replace(b"<elements", b"<?run me?><elements", 1), "processing"),
    "cut": (XMI[:-40], "XML"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_isnt_a_model_is_one_clear_error(name: str) -> None:
    data, said = BAD[name]
    with pytest.raises(FormatError, match=said) as caught:
        parse_model(data, "file.xmi")
    assert str(caught.value).startswith("file.xmi: ")
    assert len(str(caught.value)) < 400


@given(st.integers(0, len(XMI) - 1), st.binary(min_size=1, max_size=3))
@settings(max_examples=60, deadline=None)
def test_a_changed_file_is_a_model_or_a_format_error(at: int, patch: bytes) -> None:
    data = XMI[:at] + patch + XMI[at + len(patch) :]
    with contextlib.suppress(FormatError):
        assert isinstance(parse_model(data), RobotModel)


def test_too_large_or_missing(tmp_path: Path) -> None:
    large = tmp_path / "large.xmi"
    large.write_bytes(b" " * 1_100_000)
    for path, said in ((large, "longer"), (tmp_path / "none", "can't be read")):
        with pytest.raises(FormatError, match=said):
            read_model(path)


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (lambda: Sensor("Upper"), "name"),
        (lambda: Sensor("class"), "name"),
        (lambda: Sensor("a__b"), "name"),
        (lambda: Sensor("x" * 49), "name"),
        (lambda: Sensor("a", type="i64"), "type of a"),
        (lambda: Sensor("a", count=1025), "count of a"),
        (lambda: Sensor("a", scale=0.0), "scale of a"),
        (lambda: Sensor("a", unit='"""'), "unit of a"),
        (lambda: MemoryEvent("a", binding="\\"), "binding of a"),
        (lambda: Effector("a", initial=0.5), "whole"),
        (lambda: Effector("a", low=5.0), "initial of a"),
        (lambda: Effector("a", low=float("nan")), "low of a"),
        (lambda: Effector("a", stream=20_000), "stream of a"),
        (lambda: MemoryCommand("a", size=0), "size of a"),
        (lambda: Module("a", ()), "members of a"),
        (lambda: RobotModel("a", 1, ()), "elements"),
        (lambda: RobotModel("a", 70_000, (Sensor("a"),)), "id"),
        (lambda: RobotModel("a", 1, (Monitor("m", "x"),)), "effector of m"),
        (lambda: RobotModel("a", 1, (Effector("x", stream=5), Monitor("m", "x"))), "effector of m"),
        (lambda: RobotModel("a", 1, tuple(Sensor(f"s{k}") for k in range(1025))), "elements"),
    ],
)
def test_elements_are_checked(made, said: str) -> None:
    with pytest.raises(InvalidValueError, match=said):
        made()
