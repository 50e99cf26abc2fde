"""What this is made of: every version pinned with its hashes, and no licence that isn't one of those allowed."""

from __future__ import annotations

import importlib.util
import re
import tomllib
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Final

import pytest
from packaging.requirements import Requirement

HOME = Path(__file__).resolve().parents[1]
PROJECT = tomllib.loads((HOME / "pyproject.toml").read_text())
ALLOWED: Final = {
    "0BSD", "Apache-2.0", "BSD-2-Clause", "BSD-3-Clause", "CC0-1.0", "ISC", "MIT", "MIT-0", "MIT-CMU", "MPL-2.0",
    "PSF-2.0", "Unlicense", "ZPL-2.1", "Zlib",
}  # fmt: skip
"""By SPDX: permissive ones, and MPL-2.0, whose files are used as they are."""
SPELLED: Final = {
    "3-Clause BSD License": "BSD-3-Clause",
    "Apache 2.0": "Apache-2.0",
    "Apache License, Version 2.0": "Apache-2.0",
    "Apache Software License": "Apache-2.0",
    "BSD": "BSD-3-Clause",
    "BSD License": "BSD-3-Clause",
    "ISC License (ISCL)": "ISC",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
    "zlib/libpng License": "Zlib",
}
"""How packages say the same that don't say it by SPDX."""
READ: Final = {
    "docutils": "public domain and BSD; its one file under the GPL, an Emacs mode, isn't in the wheel",
    "eclipse-zenoh": "EPL-2.0 or Apache-2.0, as its LICENSE",
    "embreex": "BSD-2-Clause, as its LICENSE",
    "vhacdx": "MIT, as its LICENSE",
    "xacro": "BSD-3-Clause, as its LICENSE",
}
"""Packages that say none of these, whose licences were read."""


@pytest.fixture(scope="module")
def install() -> ModuleType:
    spec = importlib.util.spec_from_file_location("ci_install", HOME / ".ci" / "install.py")
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def everything() -> list[str]:
    project = PROJECT["project"]
    optional = [one for more in project["optional-dependencies"].values() for one in more]
    return [*project["dependencies"], *optional, *PROJECT["build-system"]["requires"]]


def installed(requirements: list[str]) -> dict[str, metadata.Distribution]:
    """The distributions that requirements bring, as far as they're installed, by name."""
    found: dict[str, metadata.Distribution] = {}

    def walk(text: str, extras: frozenset[str]) -> Iterator[None]:
        one = Requirement(text)
        if one.marker is None or any(one.marker.evaluate({"extra": extra}) for extra in extras | {""}):
            key = f"{one.name}[{','.join(sorted(one.extras))}]"
            if key not in seen:
                seen.add(key)
                try:
                    found[one.name] = metadata.distribution(one.name)
                except metadata.PackageNotFoundError:
                    return
                for more in found[one.name].requires or ():
                    yield from walk(more, frozenset(one.extras))

    seen: set[str] = set()
    for requirement in requirements:
        list(walk(requirement, frozenset()))
    return found


def stated(distribution: metadata.Distribution) -> list[str]:
    """The licences that a package says it has: all of them count."""
    said = distribution.metadata
    if expression := said.get("License-Expression"):
        return re.split(r"\s+AND\s+", expression.strip("()"))
    classifiers = [one.rpartition(" :: ")[2] for one in said.get_all("Classifier") or () if "License ::" in one]
    return classifiers or re.split(r"\s+AND\s+", said.get("License") or "")


def problem(name: str, licences: list[str]) -> str:
    """What is wrong with a package's licences; empty if nothing is."""
    for licence in licences:
        choices = [SPELLED.get(one, one.strip("()")) for one in re.split(r"\s+OR\s+", licence)]
        if not ALLOWED & set(choices) and name not in READ:
            return f"{name}: {licence.splitlines()[0][:60] if licence else 'says none'}"
    return ""


def test_t18_all_that_is_installed_has_a_licence_that_is_allowed() -> None:
    found = installed(everything())
    assert {"numpy", "websockets", "uvicorn"} <= set(found)
    assert [said for name, one in found.items() if (said := problem(name.lower(), stated(one)))] == []


@pytest.mark.parametrize(
    "licence", ["GPL-3.0-only", "", "MIT AND GPL-3.0-only", "Proprietary", "AGPL-3.0 OR SSPL-1.0"]
)
def test_another_licence_is_found(licence: str) -> None:
    assert problem("somebody-s", re.split(r"\s+AND\s+", licence))
    assert not problem("somebody-s", ["GPL-3.0-only OR MIT"])


def test_t18_everything_pinned_has_hashes_and_everything_used_is_pinned(install: ModuleType) -> None:
    pinned = install.pinned((HOME / "constraints.txt").read_text())
    known = install.hashed((HOME / "hashes.txt").read_text())
    assert set(known) == {f"{name}=={version}" for name, version in pinned.items()}
    assert [name for name, hashes in known.items() if not hashes] == []
    used = {install.canonical(one.metadata["Name"]) for one in installed(everything()).values()}
    assert used <= set(pinned)
    wanted = {install.canonical(Requirement(one).name) for one in everything()}
    assert wanted <= set(pinned)


def test_t18_versions_without_a_hash_arent_installed(install: ModuleType) -> None:
    known = {"numpy==2.4.6": ["sha256:" + 64 * "0", "sha256:" + 64 * "1"]}
    text = install.locked({"numpy": "2.4.6"}, known)
    assert text == f"numpy==2.4.6 --hash=sha256:{64 * '0'} --hash=sha256:{64 * '1'}\n"
    for resolved in ({"numpy": "2.4.7"}, {"numpy": "2.4.6", "others": "1"}):
        with pytest.raises(SystemExit, match="no hashes of"):
            install.locked(resolved, known)


def test_nothing_names_where_packages_come_from() -> None:
    for name in ("constraints.txt", "hashes.txt", "pyproject.toml", "Makefile", "Dockerfile", *_ci()):
        text = (HOME / name).read_text()
        assert not re.search(r"index-url|find-links|trusted-host|--index\b|files\.python", text), name


def _ci() -> list[str]:
    return [f".ci/{path.name}" for path in (HOME / ".ci").iterdir() if path.is_file()]
