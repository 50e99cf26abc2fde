"""What a message is made of, in words that suit every reader of it: schemas, scripts, documents, fuzzers.

Types are those of `msgspec.inspect`. What msgspec doesn't know stands there as it crosses, by `fields.CROSSING`.
"""

from __future__ import annotations

import ast
import inspect
import math
import re
import sys
from functools import cache
from typing import Any, NamedTuple

import msgspec
from msgspec import NODEFAULT
from msgspec import inspect as kinds

from interfaces.messages.fields import CROSSING, plain
from vrs.errors import InvalidValueError

BASE64 = r"\A(?:[A-Za-z0-9+/]{4})*(?:[A-Za-z0-9+/]{2}==|[A-Za-z0-9+/]{3}=)?\Z"
"""What bytes look like in JSON."""


class FieldDescription(NamedTuple):
    """A field of a message, or of a part of one."""

    name: str
    """As it stands on the wire."""
    type: kinds.Type
    """Without null."""
    nullable: bool
    """Whether null may stand there."""
    null_is_absence: bool
    """Whether null means that the field is left out."""
    required: bool
    default: Any
    """What stands for a field that is left out, in plain data; None where nothing does."""
    computed: str
    """What stands for it instead, of other fields, as in `edit - 1`; empty where that's a default."""
    text: str
    """Its docstring, on one line; empty where it has none."""


class MessageDescription(NamedTuple):
    """A message, or a part of one."""

    name: str
    """Of its class."""
    tag: str
    """What says which it is; empty where nothing does."""
    tag_field: str
    """Where that stands."""
    sender: str
    """Who sends it; empty for parts."""
    is_array: bool
    """Whether its fields stand in an array, without names."""
    is_open: bool
    """Whether newer peers may send more of them."""
    text: str
    """The docstring of its class, on one line."""
    fields: tuple[FieldDescription, ...]
    """In the order in which they're written."""


Described = kinds.StructType | kinds.DataclassType | kinds.NamedTupleType
"""Types with fields of their own."""


def described(kind: Any) -> MessageDescription:
    """Describe a class of messages, or of their parts.

    Args:
        kind: A Struct, a dataclass or a named tuple, or its type.

    Raises:
        InvalidValueError: If it has no fields.
    """
    return _described(kind.cls if isinstance(kind, Described) else kind)


def type_of(kind: Any) -> kinds.Type:
    """The type of a class of messages, with coefficients as JSON has them."""
    return kinds.type_info(kind)


@cache
def _described(kind: Any) -> MessageDescription:
    found = type_of(kind)
    if not isinstance(found, Described):
        raise InvalidValueError("kind", kind, "a class with fields")
    own: Any = found.cls
    tag = getattr(found, "tag", None)
    return MessageDescription(
        name=own.__name__,
        tag="" if tag is None else str(tag),
        tag_field=getattr(found, "tag_field", None) or "",
        sender=str(getattr(own, "sender", "")),
        is_array=isinstance(found, kinds.NamedTupleType) or getattr(found, "array_like", False),
        is_open=not isinstance(found, kinds.NamedTupleType),
        text=" ".join((inspect.getdoc(own) or "").split()),
        fields=tuple(_field(own, field) for field in found.fields),
    )


def _field(own: Any, field: kinds.Field) -> FieldDescription:
    members = alternatives(field.type)
    default = field.default if field.default_factory is NODEFAULT else field.default_factory()
    return FieldDescription(
        name=field.encode_name,
        type=members[0] if len(members) == 1 else kinds.UnionType(members),
        nullable=is_nullable(field.type),
        null_is_absence=not field.required and default is None,
        required=field.required,
        default=None if default is NODEFAULT else _plain_data(default),
        computed=getattr(own, "absent", {}).get(field.name, ""),
        text=next(filter(None, (field_texts(base).get(field.name, "") for base in own.__mro__)), ""),
    )


def is_nullable(kind: kinds.Type) -> bool:
    """Whether null may stand in a place."""
    return any(isinstance(one, kinds.NoneType) for one in getattr(kind, "types", ()))


def alternatives(kind: kinds.Type) -> tuple[kinds.Type, ...]:
    """What may stand in a place, as it crosses in JSON, without null.

    Bytes cross as base64 there, and where something else may stand, not at all.

    Raises:
        InvalidValueError: If nothing says how it crosses.
    """
    if isinstance(kind, kinds.UnionType):
        parts = [part for part in kind.types if not isinstance(part, kinds.BytesType)]
        return tuple(one for part in parts for one in alternatives(part))
    if isinstance(kind, kinds.NoneType):
        return ()
    if isinstance(kind, kinds.BytesType):
        least, most = (-(-size // 3) * 4 for size in (kind.min_length or 0, kind.max_length or sys.maxsize))
        return (kinds.StrType(least, most, BASE64),)
    if isinstance(kind, kinds.Metadata):
        return alternatives(kind.type)
    if isinstance(kind, kinds.CustomType):
        crossing = CROSSING.get(kind.cls)
        if crossing is None:
            raise InvalidValueError("field", kind.cls.__name__, "a type that `fields.CROSSING` knows")
        return alternatives(kinds.type_info(crossing))
    return (kind,)


def words(kind: kinds.EnumType | kinds.LiteralType) -> tuple[Any, ...]:
    """What may stand in the place of a choice."""
    if isinstance(kind, kinds.LiteralType):
        return kind.values
    return tuple(one.value for one in kind.cls)


def fallback(kind: kinds.EnumType) -> Any:
    """What stands for a word of a choice that isn't known, as from a newer peer; None where that's refused."""
    known = kind.cls._missing_("")
    return None if known is None else known.value


def bounds(kind: kinds.IntType | kinds.FloatType) -> tuple[float | None, float | None]:
    """Least and largest number, both included; None where nothing bounds it."""
    low, high = kind.ge, kind.le
    if kind.gt is not None:
        low = kind.gt + 1 if isinstance(kind, kinds.IntType) else _above(kind.gt)
    if kind.lt is not None:
        high = kind.lt - 1 if isinstance(kind, kinds.IntType) else -_above(-kind.lt)
    return low, high


def _above(number: float) -> float:
    return math.nextafter(number, math.inf)


def _plain_data(value: Any) -> Any:
    return msgspec.json.decode(msgspec.json.encode(value, enc_hook=plain))


@cache
def field_texts(kind: type) -> dict[str, str]:
    """The docstrings of a class's own fields or words, each on one line; none where its source isn't known."""
    return _texts_of(kind.__module__).get(kind.__name__, {})


@cache
def _texts_of(module: str) -> dict[str, dict[str, str]]:
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (KeyError, OSError, TypeError):
        return {}
    found: dict[str, dict[str, str]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            found[node.name] = dict(_own_texts(node))
    return found


def _own_texts(node: ast.ClassDef) -> Any:
    for field, text in zip(node.body, node.body[1:], strict=False):
        match field, text:
            case (
                ast.AnnAssign(target=ast.Name(name)) | ast.Assign(targets=[ast.Name(name)]),
                ast.Expr(value=ast.Constant(value=str(said))),
            ):
                yield name, re.sub(r"\s+", " ", said).strip()
