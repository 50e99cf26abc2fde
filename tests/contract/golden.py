"""Golden results of the table of commands: `python -m tests.contract.golden [WORD …]` makes golden.json anew.

Words select cases whose names hold one of them (`demo`, `recording`, `"reproduce kim2006"`), and `wire`; without
words everything is made. A result is compared in full where the machine computes as the one did that made it
(`arithmetic`), and in structure elsewhere.
"""

from __future__ import annotations

import hashlib
import json
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from tests.contract.cases import ALL, Case
from tests.contract.doors import DATA, VRS, arithmetic, directory, run
from tests.contract.session import RARE, sessions
from tests.contract.shapes import merged, shape

GOLDEN: Final = DATA / "golden.json"
WIRE: Final = DATA / "wire.json"
LONG: Final = 6000
"""Texts beyond that are kept as digests [characters]."""
PROGRESS: Final = re.compile(r"\d:\d\d:\d\d$")
"""The end of a progress bar's line: how long things took."""


def result(case: Case, place: Path) -> dict[str, Any]:
    """Run a case in an empty directory and say what came of it."""
    directory(place)
    commands = []
    for line in case.lines:
        done = run(VRS, *line, cwd=place, stdin=case.stdin)
        said: dict[str, Any] = {"vrs": " ".join(line), "status": done.status}
        if done.status == 2:
            said["errors"] = [line for line in done.errors.splitlines() if not PROGRESS.search(line)]
        said["out"] = kept(done.out.encode(), case, json_too=True)
        commands.append(said)
    files = {
        str(path.relative_to(place)): kept(path.read_bytes(), case, json_too=path.suffix == ".json")
        for path in sorted(place.rglob("*"))
        if path.is_file() and path.relative_to(place).parts[0] not in ("data", ".home")
    }
    return {"commands": commands, "files": files}


def kept(data: bytes, case: Case, *, json_too: bool) -> Any:
    """What of an output or a file is kept: short text as lines, a JSON document's digests by key, else a digest."""
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return {"digest": _digest(data)}
    for pattern, instead in case.left_out.items():
        text = re.sub(pattern, instead, text, flags=re.DOTALL)
    if json_too and text.startswith(("{", "[")):
        documents = _documents(text)
        if documents:
            return {"digest": _digest(text.encode()), "keys": _by_key(documents), "shape": _shape(documents)}
    return text.splitlines() if len(text) <= LONG else {"digest": _digest(text.encode())}


def _documents(text: str) -> list[Any]:
    """The JSON documents of a text: one, or one a line; none if it isn't JSON."""
    try:
        return [json.loads(text)]
    except ValueError:
        pass
    try:
        return [json.loads(line) for line in text.splitlines()]
    except ValueError:
        return []


def _by_key(documents: list[Any]) -> dict[str, str]:
    """A digest for each key of the first two levels, so that a difference says where it is."""
    found = {}
    for document in documents[:1] if len(documents) == 1 else []:
        for key, value in document.items() if isinstance(document, dict) else []:
            if isinstance(value, dict) and value:
                found |= {f"{key}.{inner}": _digest(_canonical(one)) for inner, one in value.items()}
            else:
                found[key] = _digest(_canonical(value))
    return found


def _shape(documents: list[Any]) -> str:
    """A digest of the structure: it's the same whatever the numbers are."""
    text = json.dumps(shape(documents)).replace('"integer"', '"number"')
    return _digest(text.encode())


def _canonical(value: Any) -> bytes:
    return json.dumps(value, sort_keys=True).encode()


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def structure(result: dict[str, Any]) -> dict[str, Any]:
    """What of a result is the same on a machine that rounds otherwise: statuses, files, shapes of JSON."""

    def bare(value: Any) -> Any:
        return value.get("shape") if isinstance(value, dict) else None

    commands = [
        {"vrs": said["vrs"], "status": said["status"], "out": bare(said["out"])} for said in result["commands"]
    ]
    return {"commands": commands, "files": {name: bare(value) for name, value in result["files"].items()}}


def differences(found: Any, past: Any, where: str = "") -> Iterator[str]:
    """Where a result isn't what it was, a line a place."""
    if isinstance(found, dict) and isinstance(past, dict):
        for key in sorted(found.keys() | past.keys()):
            yield from differences(found.get(key), past.get(key), f"{where} › {key}" if where else key)
    elif isinstance(found, list) and isinstance(past, list) and len(found) == len(past):
        for index, (one, other) in enumerate(zip(found, past, strict=True), 1):
            yield from differences(one, other, f"{where} {index}")
    elif found != past:
        yield f"{where}: {found!r}, not {past!r}"


def golden() -> dict[str, Any]:
    """What golden.json holds."""
    found: dict[str, Any] = json.loads(GOLDEN.read_text(encoding="utf-8"))
    return found


def make(words: list[str]) -> None:
    """Make the golden results whose names hold a word, or all."""
    before = golden() if words and GOLDEN.exists() else {"arithmetic": None, "cases": {}}
    with tempfile.TemporaryDirectory() as place:
        here = arithmetic(directory(Path(place)))
    if before["arithmetic"] not in (None, here):
        sys.exit(
            f"this machine computes otherwise ({here}, not {before['arithmetic']}): make all anew, without words"
        )
    cases: dict[str, Any] = before["cases"]
    for name, case in ALL.items():
        if words and not any(word in name for word in words):
            continue
        with tempfile.TemporaryDirectory() as place:
            cases[name] = result(case, Path(place))
        kept = {"arithmetic": here, "cases": {name: cases[name] for name in ALL if name in cases}}
        GOLDEN.write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        print(name, flush=True)  # noqa: T201
    if not words or "wire" in words:
        WIRE.write_text(json.dumps(_wire(), indent=1, sort_keys=True) + "\n", encoding="utf-8")
        print("wire")  # noqa: T201


def _wire() -> dict[str, Any]:
    """Hold the sessions twice: what is told hangs on the time a little, too."""
    held = []
    for _ in range(2):
        with tempfile.TemporaryDirectory() as place:
            held.append(sessions(Path(place)))
    one, other = held
    for session, found in one.items():
        for role, kinds in found["shapes"].items():
            for kind in kinds:
                kinds[kind] = {**RARE.get(kind, {}), **merged(kinds[kind], other[session]["shapes"][role][kind])}
    return one


if __name__ == "__main__":
    make(sys.argv[1:])
