"""Installs a checkout, or its wheel, with what it depends on, each by its hash: `python .ci/install.py -e . dev`.

pip takes hashes in a constraints file for an order to ask for one of everything: of a checkout, which has none,
and of requirements without `==`. So pip resolves by constraints.txt, and installs nothing; what it found is then
installed by version and hash, from wheels alone; then the project, without dependencies, by a build tool of these.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Final

HOME: Final = Path(__file__).resolve().parents[1]
PIP: Final = (sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check")


def canonical(name: str) -> str:
    """A package's name as all its spellings are compared."""
    return re.sub(r"[-_.]+", "-", name).lower()


def pinned(text: str) -> dict[str, str]:
    """Versions by canonical names, of lines `name==version`."""
    found = re.findall(r"(?m)^([\w.-]+)==([^\s\\;]+)", text)
    return {canonical(name): version for name, version in found}


def hashed(text: str) -> dict[str, list[str]]:
    """The hashes of each package's files, by `name==version`."""
    entries = re.split(r"(?m)^(?=[\w.-]+==)", text)
    return {
        f"{name}=={version}": re.findall(r"sha256:[0-9a-f]{64}", entry)
        for entry in entries
        for name, version in pinned(entry).items()
    }


def wanted(extras: list[str]) -> list[str]:
    """What the project asks for, with extras, and what builds it."""
    found = tomllib.loads((HOME / "pyproject.toml").read_text(encoding="utf-8"))
    optional = found["project"]["optional-dependencies"]
    more = [requirement for extra in extras for requirement in optional[extra]]
    return [*found["project"]["dependencies"], *more, *found["build-system"]["requires"]]


def locked(resolved: dict[str, str], known: dict[str, list[str]]) -> str:
    """A requirements file of what was resolved, with hashes.

    Raises:
        SystemExit: If something has none.
    """
    missing = [f"{name}=={version}" for name, version in resolved.items() if not known.get(f"{name}=={version}")]
    if missing:
        sys.exit(f"no hashes of {', '.join(missing)}: pin them in constraints.txt, then make hashes")
    return "".join(
        f"{name}=={version} {' '.join(f'--hash={one}' for one in known[f'{name}=={version}'])}\n"
        for name, version in resolved.items()
    )


def main() -> None:
    """Install."""
    parser = argparse.ArgumentParser()
    parser.add_argument("-e", dest="editable", action="store_true", help="the checkout as it is, not a copy")
    parser.add_argument("what", type=Path, help="the checkout's directory, or a wheel")
    parser.add_argument("extras", nargs="*")
    asked = parser.parse_args()
    constraints = str(HOME / "constraints.txt")
    look = [*PIP, "--dry-run", "--report", "-", "-c", constraints, *wanted(asked.extras)]
    report = json.loads(subprocess.run(look, check=True, stdout=subprocess.PIPE).stdout)
    resolved = {
        canonical(one["metadata"]["name"]): one["metadata"]["version"] for one in report["install"]
    }  # fmt: skip
    if resolved:
        known = hashed((HOME / "hashes.txt").read_text(encoding="ascii"))
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "locked.txt"
            file.write_text(locked(resolved, known), encoding="ascii")
            strict = "--require-hashes", "--no-deps", "--only-binary", ":all:"
            subprocess.run([*PIP, *strict, "-r", str(file)], check=True)
    own = ["--no-deps", "--no-index", "--no-build-isolation", *(["-e"] if asked.editable else []), str(asked.what)]
    subprocess.run([*PIP, *own], check=True)


if __name__ == "__main__":
    main()
