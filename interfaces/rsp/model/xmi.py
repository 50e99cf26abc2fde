"""Robot models as XMI: read with pyecore against the metamodel `rsp.ecore`, then checked as values.

A file is looked through before pyecore sees it. DOCTYPEs, references to other files and anything that isn't in the
metamodel are refused, so that a model reads nothing but itself.
"""

from __future__ import annotations

import math
import re
from dataclasses import fields
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any, Final
from xml.parsers import expat

from interfaces.rsp.model.elements import (
    KINDS,
    MOST_ELEMENTS,
    Element,
    Filling,
    Module,
    Monitor,
    OnLoss,
    RobotModel,
    Scalar,
    stated,
)
from interfaces.system import read_within
from vrs.errors import FormatError, InvalidValueError

LARGEST: Final = 1_048_576
"""Largest file [byte]."""
NAMESPACE: Final = "urn:vrs-teleop:rsp:1"
_METAMODEL: Final = Path(__file__).with_name("rsp.ecore")
_XMI: Final = "http://www.omg.org/XMI"
_XSI: Final = "http://www.w3.org/2001/XMLSchema-instance"
_BY_NAME: Final = {kind.__name__: kind for kind in KINDS}
_TYPE: Final = f"{_XSI} type"
_ROOT: Final = {"name", "id", "buffers", f"{_XMI} version"}
_ENUMS: Final = {"type": "Scalar", "filling": "Filling", "on_loss": "OnLoss"}
"""Attributes that are literals of an enumeration of the metamodel."""
_WORDS: Final = {
    "effector": re.compile(r"[a-z0-9_]+"),
    "members": re.compile(r"[a-z0-9_ ]+"),
    "type": re.compile("|".join(Scalar)),
    "filling": re.compile("|".join(Filling)),
    "on_loss": re.compile("|".join(OnLoss)),
}
"""What some attributes may hold: references are names in the same file."""


@cache
def _metamodel() -> Any:
    """The metamodel as an EPackage."""
    from pyecore.resources import URI, ResourceSet

    return ResourceSet().get_resource(URI(str(_METAMODEL))).contents[0]


def read_model(path: Path) -> RobotModel:
    """Read a robot model from an XMI file.

    Raises:
        FormatError: If it can't be read, isn't a model of the metamodel, or its elements don't fit together.
    """
    return parse_model(read_within(path, LARGEST), str(path))


def parse_model(data: bytes, where: str = "model") -> RobotModel:
    """Read a robot model from XMI.

    Args:
        data: UTF-8.
        where: What it's called in errors.

    Raises:
        FormatError: As `read_model`.
    """
    _look_through(data, where)
    try:
        return _model(_loaded(data))
    except InvalidValueError as error:
        raise FormatError(where, str(error)) from None


def write_model(model: RobotModel) -> bytes:
    """A robot model as XMI, UTF-8; the same model gives the same bytes."""
    from pyecore.resources.xmi import XMIResource

    package = _metamodel()
    robot = package.getEClassifier("Robot")(name=model.name, id=model.id)
    if model.buffers != 16:
        robot.buffers = model.buffers
    made: dict[str, Any] = {}
    for element in model:
        made[element.name] = node = package.getEClassifier(type(element).__name__)()
        _fill(node, element, package)
        robot.elements.append(node)
    for element in model:
        if isinstance(element, Monitor):
            made[element.name].effector = made[element.effector]
        elif isinstance(element, Module):
            made[element.name].members.extend(made[member] for member in element.members)
    stream = BytesIO()
    resource = XMIResource(_place(stream))
    resource.append(robot)
    resource.save()
    return stream.getvalue()


def _place(stream: BytesIO) -> Any:
    """A stream as what pyecore reads from and writes to."""
    from pyecore.resources import URI

    class Place(URI):  # type: ignore[misc]
        def create_instream(self) -> BytesIO:
            return stream

        def create_outstream(self) -> BytesIO:
            return stream

        def close_stream(self) -> None:
            return

    return Place("model.xmi")


def _fill(node: Any, element: Element, package: Any) -> None:
    """Set those attributes of a node that aren't at their defaults."""
    for name, value in stated(element):
        if name in _ENUMS:
            setattr(node, name, package.getEClassifier(_ENUMS[name]).getEEnumLiteral(value.value))
        elif name not in ("effector", "members"):
            setattr(node, name, value)


def _look_through(data: bytes, where: str) -> None:
    """Refuse what isn't plain elements and attributes of the metamodel."""
    parser = expat.ParserCreate("UTF-8", " ")
    stack: list[str] = []
    count = 0

    def refuse(problem: str) -> None:
        raise FormatError(where, f"line {parser.CurrentLineNumber}: {problem}")

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if not stack:
            if tag != f"{NAMESPACE} Robot":
                refuse(f"its root must be a Robot of {NAMESPACE}")
            allowed: set[str] = _ROOT
        elif len(stack) == 1 and tag == "elements":
            kind = _BY_NAME.get(attributes.get(_TYPE, "").partition(":")[2])
            if kind is None:
                refuse(f"an element's xsi:type must be one of {', '.join(f'rsp:{name}' for name in _BY_NAME)}")
                return
            allowed = {_TYPE, *(item.name for item in fields(kind))}
        else:
            refuse(f"{tag} doesn't belong there")
            return
        for name, value in attributes.items():
            if name not in allowed:
                refuse(f"{name.split()[-1]} isn't an attribute of it")
            if name in _WORDS and not _WORDS[name].fullmatch(value):
                refuse(f"{name} can't be {value[:60]!r}")
        if count > MOST_ELEMENTS + 1:
            refuse(f"it has more than {MOST_ELEMENTS} elements")
        stack.append(tag)

    def text(words: str) -> None:
        if words.strip():
            refuse("there's text outside of attributes")

    def processing(*_: str) -> None:
        refuse("it has processing instructions")

    def declared(_: str, encoding: str | None, __: int) -> None:
        if encoding is not None and encoding.lower() != "utf-8":
            refuse("its encoding must be UTF-8")

    def doctype(*_: object) -> None:
        refuse("it has a DOCTYPE")

    parser.StartElementHandler, parser.EndElementHandler = start, lambda _: stack.pop()
    parser.CharacterDataHandler, parser.ProcessingInstructionHandler = text, processing
    parser.StartDoctypeDeclHandler, parser.XmlDeclHandler = doctype, declared
    try:
        data.decode("utf-8")
        parser.Parse(data, True)
    except UnicodeDecodeError:
        raise FormatError(where, "isn't UTF-8") from None
    except expat.ExpatError as error:
        raise FormatError(where, f"isn't XML: {error}") from None


def _loaded(data: bytes) -> Any:
    """The root of the model as pyecore has it."""
    from pyecore.resources import ResourceSet
    from pyecore.resources.xmi import XMIResource

    package = _metamodel()
    resources = ResourceSet()
    resources.metamodel_registry[package.nsURI] = package

    resource = XMIResource(_place(BytesIO(data)))
    resource.resource_set = resources
    try:
        resource.load()
    except Exception as error:  # noqa: BLE001 - pyecore and lxml raise whatever they meet
        raise InvalidValueError("model", f"{type(error).__name__}: {error}"[:200], "one of the metamodel") from None
    return resource.contents[0]


def _model(robot: Any) -> RobotModel:
    return RobotModel(robot.name, robot.id, tuple(map(_element, robot.elements)), robot.buffers)


def _element(node: Any) -> Element:
    kind = _BY_NAME[node.eClass.name]
    found: dict[str, Any] = {}
    for item in fields(kind):
        if not node.eIsSet(item.name):
            continue
        value = getattr(node, item.name)
        if item.name == "members":
            value = tuple(member.name for member in value)
        elif item.name == "effector":
            value = value.name
        elif item.name in _ENUMS:
            value = str(value)
        elif isinstance(value, float) and math.isnan(value):
            raise InvalidValueError(item.name, value, "a number")
        found[item.name] = value
    missing = {"name", *({"effector", "members"} & {item.name for item in fields(kind)})} - set(found)
    if missing:
        raise InvalidValueError(kind.__name__, f"no {', '.join(sorted(missing))}", "complete")
    return kind(**found)
