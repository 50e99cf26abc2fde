"""Write what is derived from definitions: of messages the script that checks them in pages; tables of documents.

`make generate` writes them, `python .ci/generate.py --check` says which are stale.
"""

from __future__ import annotations

import enum
import json
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from itertools import dropwhile, takewhile
from pathlib import Path
from typing import Any

from msgspec import inspect as kinds

from interfaces.messages.control import Role, may_send
from interfaces.messages.description import (
    BASE64,
    Described,
    FieldDescription,
    MessageDescription,
    alternatives,
    bounds,
    described,
    fallback,
    field_texts,
    is_nullable,
    words,
)
from interfaces.messages.fields import Party
from interfaces.recording.channels import CHANNELS
from interfaces.stream.codec import KINDS
from interfaces.val2 import forms
from interfaces.val2.monitor.commands import COMMANDS
from interfaces.val2.rows import Form

HOME = Path(__file__).resolve().parents[1]
SCRIPT = HOME / "interfaces" / "stream" / "static" / "protocol.js"
DOCUMENTS = tuple(HOME / "docs" / f"{name}.md" for name in ("protocol", "recording", "console", "val2"))
COMMAND = "make generate"


def messages() -> list[MessageDescription]:
    """The protocol's messages, as JSON has them."""
    return [described(kind)._replace(sender=kind.sender) for kind in KINDS]


def recorded() -> list[MessageDescription]:
    """The messages of a recording; one without a tag is called as its channel."""
    found = ((channel, described(kind)) for channel in CHANNELS for kind in channel.kinds)
    return [one if one.tag else one._replace(name=channel.topic) for channel, one in found]


def parts(message: MessageDescription) -> Iterator[MessageDescription]:
    """What has fields of its own within a message, innermost first, and the message."""
    for field in message.fields:
        for part in _within(field.type):
            yield from parts(part)
    yield message


def _within(kind: kinds.Type) -> Iterator[MessageDescription]:
    """What has fields of its own in a place, in lists and maps there, too."""
    for one in alternatives(kind):
        if isinstance(one, Described):
            yield described(one)
        for name in ("item_type", "item_types", "key_type", "value_type"):
            inner = getattr(one, name, ())
            for part in inner if isinstance(inner, tuple) else (inner,):
                yield from _within(part)


# The script.

HEAD = """// Generated from the definitions of messages by `{command}`: don't edit.
// What may come into a page (docs/protocol.md), and what checks it there: a function a message, a line a field.

/** The ends of whole numbers and of real ones: JSON has no infinity. */
const WHOLE = 2 ** 63;
const REAL = Number.MAX_VALUE;

/** A message that can't be taken. */
class Misfit extends Error {{}}

function fail(where, wanted) {{
  throw new Misfit(`${{where}} isn't ${{wanted}}`);
}}

// Each looks at what stands in a place, and gives it back.

function whole(x, low, high, where) {{
  if (!Number.isInteger(x) || x < low || x > high) fail(where, `a whole number from ${{low}} to ${{high}}`);
  return x;
}}

function real(x, low, high, where) {{
  if (typeof x !== "number" || !(x >= low && x <= high)) fail(where, `a number from ${{low}} to ${{high}}`);
  return x;
}}

function text(x, least, most, where) {{
  if (typeof x !== "string" || x.length < least || (x.length > most && [...x].length > most))
    fail(where, `a text of ${{least}} to ${{most}} characters`);
  return x;
}}

function like(x, pattern, where) {{
  return typeof x === "string" && pattern.test(x) ? x : fail(where, `a text like ${{pattern}}`);
}}

function flag(x, where) {{
  return typeof x === "boolean" ? x : fail(where, "true or false");
}}

/** One of some words; `newer`, where it's given, stands for any other. */
function word(x, known, where, newer) {{
  if (known.has(x)) return x;
  return newer !== undefined && typeof x === "string" ? newer : fail(where, `one of ${{[...known].join(", ")}}`);
}}

function list(x, least, most, where, check) {{
  if (!Array.isArray(x) || x.length < least || x.length > most) fail(where, `an array of ${{least}} to ${{most}}`);
  if (check !== undefined) for (const one of x) check(one);
  return x;
}}

function numbers(x, least, most, low, high, where) {{
  list(x, least, most, where);
  for (const one of x) real(one, low, high, where);
  return x;
}}

function tuple(x, where, ...checks) {{
  list(x, checks.length, checks.length, where);
  for (let i = 0; i < checks.length; i++) checks[i](x[i]);
  return x;
}}

function map(x, where, check) {{
  if (typeof x !== "object" || x === null || Array.isArray(x)) fail(where, "a map");
  if (check !== undefined) for (const one of Object.values(x)) check(one);
  return x;
}}
"""
LEASED = """
/** Types of messages that bear the epoch of the lease under which they're sent. */
export const LEASED = new Set({});
"""
TAIL = """
const told = new Set();

/**
 * Check a message, and fill in what was left out.
 * @param {{object}} message as it came, parsed; it's changed in place
 * @param {{(problem: string) => void}} tell is told, once for each, what can't be taken
 * @returns {{?object}} the message; null for one of a type that isn't known, or that can't be taken
 */
export function check(message, tell = console.warn) {{
  try {{
    map(message, "a message");
    const checkIt = CHECKS.get(message.type);
    if (checkIt === undefined) return null;
    checkIt(message);
    return message;
  }} catch (problem) {{
    if (!(problem instanceof Misfit)) throw problem;
    if (!told.has(problem.message)) tell(problem.message);
    told.add(problem.message);
    return null;
  }}
}}

/** As `check`, of a frame as it came. */
export function decode(frame, tell = console.warn) {{
  let message = null;
  try {{
    message = JSON.parse(frame);
  }} catch {{
    // What is no JSON is no map, either.
  }}
  return check(message, tell);
}}
"""


def script(found: Iterable[MessageDescription]) -> str:
    """The module that checks what comes into a page."""
    known = list(found)
    coming = [one for one in known if one.sender in {Party.SERVER, Party.EITHER}]
    checks = _each(coming)
    choices = {choice.cls: choice for part in checks for field in part.fields for choice in _choices(field.type)}
    pieces = [HEAD.format(command=COMMAND)]
    pieces += [f"const {_set(one)} = new Set({json.dumps(words(one))});" for one in choices.values()]
    pieces += [_check(part) for part in checks]
    rows = "\n".join(f"  [{json.dumps(message.tag)}, {_function(message)}]," for message in coming)
    pieces.append(f"\nconst CHECKS = new Map([\n{rows}\n]);")
    sent = [one for one in known if one.sender not in {Party.SITE, Party.ROBOT} and one not in coming]
    leased = [one.tag for one in sent if any(field.name == "epoch" for field in one.fields)]
    pieces.append(LEASED.format(json.dumps(leased)))
    return "\n".join(pieces) + TAIL.format()


def _each(found: Iterable[MessageDescription]) -> list[MessageDescription]:
    """Messages and their parts, each once, what is needed first."""
    return list({part.name: part for message in found for part in parts(message)}.values())


def _choices(kind: kinds.Type) -> Iterator[kinds.EnumType]:
    for one in alternatives(kind):
        if isinstance(one, kinds.EnumType):
            yield one
        for name in ("item_type", "item_types", "value_type"):
            inner = getattr(one, name, ())
            for part in inner if isinstance(inner, tuple) else (inner,):
                yield from _choices(part)


def _set(choice: kinds.EnumType) -> str:
    """What the script calls the words of a choice: `LinkLoss` is LINK_LOSS there."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", choice.cls.__name__).upper()


def _function(message: MessageDescription) -> str:
    return f"check{message.name}"


def _check(message: MessageDescription) -> str:
    label = message.tag or message.name
    sender = f"{message.sender}: " * bool(message.sender)
    about = re.sub(rf"^{sender}", "", message.text)
    lines = [f"\n/** {sender}{about} */", f"function {_function(message)}(m) {{"]
    if message.is_array:
        least = sum(field.required for field in message.fields)
        most = "Infinity" if message.is_open else len(message.fields)
        lines.append(f'  list(m, {least}, {most}, "{label}");')
    else:
        lines.append(f'  map(m, "{label}");')
    if message.tag:
        at, tag = f"m.{message.tag_field}", json.dumps(message.tag)
        lines.append(f'  if ({at} !== undefined && {at} !== {tag}) fail("{label}", {tag});')
    for number, field in enumerate(message.fields):
        at = f"m[{number}]" if message.is_array else f"m.{field.name}"
        first, *more = _field_check(field, at, f"{label}.{field.name}").split("\n")
        lines += [f"  {first}{f' // {field.text}' * bool(field.text)}", *(f"  {line}" for line in more)]
    return "\n".join([*lines, "  return m;", "}"])


def _field_check(field: FieldDescription, at: str, where: str) -> str:
    """What checks a field, and fills it in where it's left out."""
    check = _place_check(field.type, at, where)
    missing = f"{at} === undefined" + f" || {at} === null" * field.null_is_absence
    if field.required:
        return f"if ({at} !== null) {check};" if field.nullable else f"{check};"
    if "[" in at:
        # An array that ends before stays as it is.
        return f"if (!({missing})) {check};"
    if isinstance(field.default, dict):
        return f"{at} = {_place_check(field.type, f'{missing} ? {json.dumps(field.default)} : {at}', where)};"
    default = re.sub(r"[A-Za-z_]\w*", r"m.\g<0>", field.computed) or json.dumps(field.default)
    nothing = f"{at} === null ? null : " * (field.nullable and not field.null_is_absence)
    return f"{at} = {missing} ? {default} : {nothing}{check};"


def _place_check(kind: kinds.Type, at: str, where: str) -> str:
    """What checks what stands in a place, and gives it back."""
    *others, last = alternatives(kind)
    if not others:
        return _one_check(last, at, where)
    tries = [f"{_looks_like(one, at)} ? {_one_check(one, at, where)}" for one in (*others, last)]
    return "\n  : ".join([*tries, f'fail({json.dumps(where)}, "of a kind that is known")'])


def _looks_like(kind: kinds.Type, at: str) -> str:
    """Whether what stands there can only be this one of several."""
    match kind:
        case kinds.BoolType():
            return f'typeof {at} === "boolean"'
        case kinds.IntType():
            return f"Number.isInteger({at})"
        case kinds.FloatType():
            return f'typeof {at} === "number"'
        case kinds.StrType() | kinds.EnumType() | kinds.LiteralType():
            return f'typeof {at} === "string"'
        case kinds.ListType() | kinds.VarTupleType() | kinds.TupleType():
            return f"Array.isArray({at})"
    tag, tag_field = getattr(kind, "tag", None), getattr(kind, "tag_field", None)
    return (
        f'typeof {at} === "object" && {at} !== null' if tag is None else f"{at}?.{tag_field} === {json.dumps(tag)}"
    )


def _one_check(kind: kinds.Type, at: str, where: str) -> str:
    place = json.dumps(where)
    match kind:
        case kinds.IntType():
            return f"whole({at}, {_ends(kind)}, {place})"
        case kinds.FloatType():
            return f"real({at}, {_ends(kind)}, {place})"
        case kinds.StrType(least, pattern=str(pattern)):
            begin = f"^(?=.{{{least}}})" if least else "^"
            return f"like({at}, /{pattern.replace(chr(92) + 'A', begin).replace(chr(92) + 'Z', '$')}/, {place})"
        case kinds.StrType():
            return f"text({at}, {_sizes(kind)}, {place})"
        case kinds.BoolType():
            return f"flag({at}, {place})"
        case kinds.EnumType():
            newer = f", {json.dumps(fallback(kind))}" * (fallback(kind) is not None)
            return f"word({at}, {_set(kind)}, {place}{newer})"
        case kinds.ListType(kinds.FloatType() as item) | kinds.VarTupleType(kinds.FloatType() as item):
            return f"numbers({at}, {_sizes(kind)}, {_ends(item)}, {place})"
        case kinds.ListType(item) | kinds.VarTupleType(item):
            return f"list({at}, {_sizes(kind)}, {place}, {_item_check(item, where)})"
        case kinds.TupleType((kinds.FloatType() as item, *others) as items) if all(o == item for o in others):
            return f"numbers({at}, {len(items)}, {len(items)}, {_ends(item)}, {place})"
        case kinds.TupleType(items):
            checks = ", ".join(_item_check(item, where) for item in items)
            return f"tuple({at}, {place}, {checks})"
        case kinds.DictType(_, item):
            return f"map({at}, {place}, {_item_check(item, where)})"
    return f"{_function(described(kind))}({at})"


def _item_check(item: kinds.Type, where: str) -> str:
    """A function that checks what stands in a list or a map."""
    check = _place_check(item, "x", where)
    if isinstance(item, Described):
        return _function(described(item))
    return f"(x) => {'x === null ? x : ' * is_nullable(item)}{check}"


def _ends(kind: kinds.IntType | kinds.FloatType) -> str:
    low, high = bounds(kind)
    largest = sys.float_info.max
    return ", ".join(map(_literal, (-largest if low is None else low, largest if high is None else high)))


def _literal(number: float) -> str:
    """A number, as scripts write it."""
    if abs(number) >= 2**62:
        return "-" * (number < 0) + ("WHOLE" if isinstance(number, int) else "REAL")
    return re.sub(r"0{6,}$", lambda zeros: f"e{len(zeros[0])}", repr(number).removesuffix(".0"))


def _sizes(kind: Any) -> str:
    least, most = kind.min_length or 0, "Infinity" if kind.max_length is None else kind.max_length
    return f"{least}, {most}"


# The documents' tables.

MARKED = re.compile(
    r"<!-- (commands|fields|messages|roles|topics|words|language)(?:: ([\w $#./=-]+))? -->\n.*?<!-- end -->", re.S
)
Names = dict[str, str]
"""What a document calls what has a table of its own there, by the name of its class."""


def document(text: str, found: Iterable[MessageDescription]) -> str:
    """A document with its tables as the definitions have them.

    `fields: report.plan` is a table of what stands in a field, `fields: receipt = outcome.receipt` one with a name,
    and `messages: order.command` one of all that may stand in a field. `language: functions ABS` is a table of the
    functions from ABS on, as far as the first one of the document's next such table.

    Raises:
        KeyError: If it asks for a table of something that isn't there.
    """
    known = list(found)
    tables = {name: part for part in [*_each(known), *known] for name in (part.name, part.tag) if name}
    tags = {part.name: part.tag for part in _each(known) if part.tag}
    choices = {one.cls.__name__: one.cls for part in _each(known) for field in part.fields
               for one in alternatives(field.type) if isinstance(one, kinds.EnumType)}  # fmt: skip

    def found_at(path: str) -> list[MessageDescription]:
        first, *inner = path.split(".")
        return _inside(tables[first], inner) if inner else [tables[first]]

    names: Names = {}
    parts_of_language = [said for what, said in MARKED.findall(text) if what == "language"]
    for what, said in MARKED.findall(text):
        name, _, path = said.rpartition(" = ")
        if what == "fields":
            *_, part = found_at(path)
            names[part.name] = name or part.tag or path

    def table(match: re.Match[str]) -> str:
        what, name = match[1], match[2]
        if what == "roles":
            rows = _roles_table(known)
        elif what == "commands":
            rows = _commands_table()
        elif what == "language":
            rows = _language_table(name, parts_of_language)
        elif what == "words":
            rows = _words_table(choices[name])
        elif what == "fields":
            *_, part = found_at(name.rpartition(" = ")[2])
            rows = _fields_table(names[part.name], part, tags, names)
        elif what == "topics":
            rows = _topics_table(tags)
        else:
            rows = _messages_table([one for path in name.split() for one in found_at(path)], tags, names)
        head = f"<!-- {what}{f': {name}' if name else ''} -->"
        # A table is one to Markdown between blank lines.
        return "\n".join([head, "", *rows, "", "<!-- end -->"])

    return MARKED.sub(table, text)


def _inside(message: MessageDescription, inner: list[str]) -> list[MessageDescription]:
    """What may stand in a field of a field of a message, and so on."""
    found = [message]
    for name in inner:
        found = list(_within(next(field.type for field in found[-1].fields if field.name == name)))
    return found


def _topics_table(tags: dict[str, str]) -> list[str]:
    rows = ["| topic | message | robot | |", "|---|---|---|---|"]
    for channel in CHANNELS:
        for kind in channel.kinds:
            one = described(kind)
            of = "mobile" if kind not in channel.arm else "any" if kind in channel.mobile else "arm"
            rows.append(_row(f"`{channel.topic}`", f"`{one.tag or channel.schema}`", of, _told(one.text, tags)))
    return rows


def _commands_table() -> list[str]:
    """The monitor's commands: * beside a program that runs, too; + ours."""
    rows = ["| command | does |", "|---|---|"]
    for one in COMMANDS.values():
        marks = " +" * one.ours + " *" * (not one.idle)
        rows.append(_row(" ".join(f"`{usage}`" for usage in one.usage) + marks, one.help))
    return rows


def _language_table(part: str, parts: list[str]) -> list[str]:
    """A part of VAL-II's table: a kind of words, and of which the first one is where they have several tables."""
    kind, _, first = part.partition(" ")
    firsts = [one.partition(" ")[2] for one in parts if one.startswith(f"{kind} ")]
    match kind:
        case "instructions":
            rows = _section(forms.INSTRUCTIONS, first, firsts)
            return _forms_table(rows, "where", _place)
        case "functions":
            return _forms_table(_section(forms.FUNCTIONS, first, firsts), "gives", lambda row: GIVEN[row.gives])
        case "switches":
            cells = [(f"`{one.name}`", "on" if one.default else "off", one.help, one.origin)
                     for one in forms.SWITCHES.values()]  # fmt: skip
            return _table(("switch", "at first", "does", "from"), cells)
        case "parameters":
            cells = [(f"`{one.name}`", f"{one.default:g} {one.unit}", f"{one.low:g} to {one.high:g} {one.unit}",
                      one.help, one.origin) for one in forms.PARAMETERS.values()]  # fmt: skip
            return _table(("parameter", "at first", "range", "is", "from"), cells)
        case "within":
            return _table(("word", "is"), [(f"`{word}`", said) for word, said in forms.WORDS.items()])
        case "formats":
            return _table(("item", "does"), [(f"`/{item}`", said) for item, said in forms.FORMATS.items()])
        case "unavailable" | "passed":
            words = forms.PASSED if kind == "passed" else forms.UNAVAILABLE
            return _table(("word", "why"), [(f"`{word}`", said) for word, said in sorted(words.items())])
    raise KeyError(kind)


GIVEN = {"real": "number", "truth": "number", "string": "string", "frame": "transformation", "location": "joints"}
"""What a function of VAL-II's comes to, by what its row has."""


def _section(known: dict[str, Form], first: str, firsts: list[str]) -> list[Form]:
    """Rows from one on, as far as another one that a table begins with."""
    found = dropwhile(lambda row: row is not known[first], known.values())
    return [next(found), *takewhile(lambda row: row.name not in firsts, found)]


def _forms_table(rows: list[Form], title: str, told: Callable[[Form], str]) -> list[str]:
    cells = [(f"`{row.usage}`".replace("|", r"\|"), row.help.replace("|", r"\|"), told(row), row.origin)
             for row in rows]  # fmt: skip
    return _table(("written", "does", title, "from"), cells)


def _place(row: Form) -> str:
    """Where an instruction may stand: * after DO while a program runs, too."""
    return "program" if "program" in row.tags else "program, DO" + " *" * ("beside" in row.tags)


def _table(titles: Iterable[str], cells: Iterable[Iterable[str]]) -> list[str]:
    head = _row(*titles)
    return [head, re.sub("[^|]+", "---", head), *(_row(*some) for some in cells)]


def _listed(words: Iterable[str]) -> str:
    return ", ".join(f"`{word}`" for word in words)


def _fields_table(name: str, message: MessageDescription, tags: dict[str, str], names: Names) -> list[str]:
    rows = [f"| `{name}` | | |", "|---|---|---|"]
    for field in message.fields:
        told = _told(field.text or _words_told(field.type), tags, "absent" if field.null_is_absence else "null")
        rows.append(_row(f"`{field.name}`", _what(field, names), told))
    return rows


def _words_told(kind: kinds.Type) -> str:
    """What the words of a choice mean, where something says so."""
    found = [one for one in alternatives(kind) if isinstance(one, kinds.EnumType)]
    texts = [(one.value, field_texts(choice.cls).get(one.name, "")) for choice in found for one in choice.cls]
    return "; ".join(f"`{word}`: {_begun(text.removesuffix('.'))}" for word, text in texts if text)


def _begun(text: str) -> str:
    """A text that goes on where it stands."""
    return text if text[1:2].isupper() else text[:1].lower() + text[1:]


def _messages_table(found: list[MessageDescription], tags: dict[str, str], names: Names) -> list[str]:
    rows = ["| message | fields | |", "|---|---|---|"]
    for message in found:
        fields = "; ".join(f"`{field.name}` {_what(field, names)}" for field in message.fields)
        rows.append(
            _row(f"`{message.tag}`", "see below" if message.name in names else fields, _told(message.text, tags))
        )
    return rows


def _row(*cells: str) -> str:
    return "|" + "".join(f" {cell} |" if cell else " |" for cell in cells)


def _told(text: str, tags: dict[str, str], none: str = "absent") -> str:
    """A docstring as documents have it: messages have other names there, and what is None is left out, or null."""
    text = re.sub(r"`(\w+)`", lambda match: f"`{tags.get(match[1], match[1])}`", text).removesuffix(".")
    return re.sub(r"\bNone\b", lambda match: none if match.start() else none.capitalize(), text)


def _words_table(kind: type[enum.Enum]) -> list[str]:
    texts = field_texts(kind)
    return [
        "| word | |",
        "|---|---|",
        *(_row(f"`{one.value}`", _told(texts.get(one.name, ""), {})) for one in kind),
    ]


def _roles_table(known: list[MessageDescription]) -> list[str]:
    rows, before = ["| role | may send |", "|---|---|"], set[str]()
    for role in (Role.VIEWER, Role.OPERATOR, Role.ADMIN):
        may = [m.tag for m in known if m.tag != "hello" and may_send(role, Party(m.sender))]
        new = ", ".join(f"`{tag}`" for tag in may if tag not in before)
        rows.append(f"| `{role}` | {'the same, and ' if before else ''}{new} |")
        before |= set(may)
    return rows


def _what(field: FieldDescription, names: Names | None = None) -> str:
    """A field's type, its range and its default, for people."""
    what = " or ".join(dict.fromkeys(_one_what(one, names or {}) for one in alternatives(field.type)))
    what += " or null" * (field.nullable and not field.null_is_absence)
    return what if field.required else f"{what} ({_default(field)})"


def _default(field: FieldDescription) -> str:
    """What stands for a field that is left out, for people."""
    if field.computed:
        return re.sub(r"[A-Za-z_]\w*", r"`\g<0>`", field.computed).replace("-", "−")
    match field.default:
        case None:
            return "absent"
        case "":
            return "empty"
        case [] | {}:
            return "none"
        case float(number):
            return _figure(number)
        case default if any(isinstance(one, kinds.EnumType) for one in alternatives(field.type)):
            return f"`{default}`"
        case default:
            return json.dumps(default, ensure_ascii=False).replace(".0", "")


TERMS = {(1, 2**63 - 1): "number", (0, 2**63 - 1): "count", (-(2**63), 2**63 - 1): "integer"}
"""Ranges of integers that have a name."""


def _one_what(kind: kinds.Type, names: Names) -> str:
    match kind:
        case kinds.IntType():
            low, high = bounds(kind)
            return TERMS.get((low, high)) or f"integer from {_figure(low)} to {_figure(high)}"
        case kinds.FloatType():
            return _real(kind)
        case kinds.StrType(pattern=str(pattern)):
            return "bytes" if pattern == BASE64 else "epoch"
        case kinds.StrType(least, most):
            return "text" if (least, most) == (None, 2000) else f"text of {least or 'up'} to {most} characters"
        case kinds.BoolType():
            return "boolean"
        case kinds.EnumType() | kinds.LiteralType():
            known = ", ".join(f"`{one}`" for one in words(kind))
            other = fallback(kind) if isinstance(kind, kinds.EnumType) else None
            return known if other is None else f"{known}; any other word counts as `{other}`"
        case kinds.ListType(item, least, most) | kinds.VarTupleType(item, least, most):
            if isinstance(item, kinds.FloatType) and (least, most) == (1, 64):
                return "joints"
            size = "" if least == most else f"{least} to " if least else "up to "
            return f"{size}{most or 'any number'} × {_several(item, names)}"
        case kinds.TupleType(items):
            return f"[{', '.join(_several(item, names) for item in items)}]"
        case kinds.NamedTupleType(_, fields):
            return f"[{', '.join(f'`{field.encode_name}`' for field in fields)}]"
        case kinds.DictType(_, item):
            return f"map of {_several(item, names)}"
        case kinds.AnyType():
            return "anything"
    inner = described(kind)
    if inner.name in names and not inner.is_array and not inner.tag:
        return f"`{names[inner.name]}`"
    if inner.is_array:
        return f"[{', '.join(f'`{field.name}`' for field in inner.fields)}]"
    if inner.tag:
        return f"`{inner.tag}`"
    fields = (f"`{field.name}`" + ("" if field.required else f" ({_default(field)})") for field in inner.fields)
    return "map of " + ", ".join(fields)


def _several(kind: kinds.Type, names: Names) -> str:
    found = list(dict.fromkeys(_one_what(one, names) for one in alternatives(kind)))
    return " or ".join([*found, *(["null"] if is_nullable(kind) else [])])


def _real(kind: kinds.FloatType) -> str:
    low, high = bounds(kind)
    if kind.gt is not None:
        return f"real > {_figure(kind.gt)}" + ("" if high in {None, 1e9} else f" up to {_figure(high)}")
    if (low, high) in {(None, None), (-1e9, 1e9), (-sys.float_info.max, sys.float_info.max)}:
        return "real"
    if high in {None, 1e9}:
        return f"real ≥ {_figure(low)}"
    return f"real from {_figure(low)} to {_figure(high)}"


def _figure(number: Any) -> str:
    size = abs(number)
    if size >= 1e4 and 10 ** (len(str(int(size))) - 1) == size:
        raised = str(len(str(int(size))) - 1).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))
        return ("−" if number < 0 else "") + f"10{raised}"
    return (str(number) if isinstance(number, int) else f"{number:g}").replace("-", "−")


# What is written, and what is stale.


def derived() -> dict[Path, str]:
    """Every file that has something derived, as it's to be."""
    found, stored = messages(), recorded()
    protocol, recording, console, language = DOCUMENTS
    return {
        SCRIPT: script(found),
        protocol: document(protocol.read_text(encoding="utf-8"), found),
        recording: document(recording.read_text(encoding="utf-8"), stored),
        console: document(console.read_text(encoding="utf-8"), ()),
        language: document(language.read_text(encoding="utf-8"), ()),
    }


def stale() -> list[Path]:
    """The files that aren't what the definitions say."""
    return [path for path, text in derived().items() if text != (path.read_text("utf-8") if path.exists() else "")]


def main(asked: list[str]) -> int:
    """Write what is stale, or with `--check` only name it."""
    for path in (found := stale()):
        if "--check" in asked:
            print(f"{path.relative_to(HOME)} isn't what the definitions say: run `{COMMAND}`")
        else:
            path.write_text(derived()[path], encoding="utf-8")
            print(f"wrote {path.relative_to(HOME)}")
    return int(bool(found) and "--check" in asked)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
