"""Whether there are wheels, with hashes here, of all that is needed, for each machine and Python that we name.

`make platforms` resolves, as `pip` would there, and downloads nothing but what packages say of themselves. What is
resolved isn't run: README, *Machines*, says what is.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tomllib

from install import HOME, hashed, pinned

MACHINES = {
    "Linux, x86-64": "x86_64-unknown-linux-gnu",
    "Linux, aarch64": "aarch64-unknown-linux-gnu",
    "macOS 14, arm64": "aarch64-apple-darwin",
    "Windows, x86-64": "x86_64-pc-windows-msvc",
}
VERSIONS = "3.11", "3.12", "3.13"
PEERS = "bench"
"""The extra that is for one machine: those beside whom it's measured aren't everywhere."""


def resolved(machine: str, version: str, requirements: list[str]) -> tuple[int, str]:
    """How many packages it would be; or what there is no wheel, or no hash, of."""
    done = subprocess.run(
        [sys.executable, "-m", "uv", "pip", "compile", "--quiet", "--no-header", "--no-annotate", "--only-binary",
         ":all:", "--constraints", str(HOME / "constraints.txt"), "--python-platform", machine, "--python-version",
         version, "-"],
        input="\n".join(requirements), capture_output=True, text=True, check=False,
        env=os.environ | {"MACOSX_DEPLOYMENT_TARGET": "14.0"},
    )  # fmt: skip
    if done.returncode:
        return 0, " ".join(done.stderr.split())
    known = hashed((HOME / "hashes.txt").read_text(encoding="ascii"))
    found = [f"{name}=={number}" for name, number in pinned(done.stdout).items()]
    missing = [one for one in found if one not in known]
    return (0, f"no hashes of {', '.join(missing)}: make hashes") if missing else (len(found), "")


def main() -> int:
    """Print a table; 1 where something is missing."""
    project = tomllib.loads((HOME / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    base, extras = project["dependencies"], project["optional-dependencies"]
    every = [requirement for name, more in extras.items() if name != PEERS for requirement in more]
    asked = {"base": base, "with extras": [*base, *every], f"with {PEERS}": [*base, *extras[PEERS]]}
    missing = 0
    for name, machine in MACHINES.items():
        for version in VERSIONS:
            for what, requirements in asked.items():
                count, problem = resolved(machine, version, requirements)
                print(f"{name:16} Python {version} {what:12} {f'{count} wheels' if count else problem}", flush=True)
                missing += not count and what != f"with {PEERS}"
    return int(bool(missing))


if __name__ == "__main__":
    sys.exit(main())
