"""Whether there are wheels of all that the base install needs, for each machine and version of Python that we name.

`make platforms` resolves, as `pip` would there, and downloads nothing but what packages say of themselves. What is
resolved isn't run: README, *Machines*, says what is.
"""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
MACHINES = {
    "Linux, x86-64": "x86_64-unknown-linux-gnu",
    "Linux, aarch64": "aarch64-unknown-linux-gnu",
    "macOS, arm64": "aarch64-apple-darwin",
    "Windows, x86-64": "x86_64-pc-windows-msvc",
}
VERSIONS = "3.11", "3.12", "3.13"


def resolved(machine: str, version: str) -> tuple[int, str]:
    """How many packages it would be; or what there is no wheel of."""
    project = tomllib.loads((HOME / "pyproject.toml").read_text())["project"]
    done = subprocess.run(
        [sys.executable, "-m", "uv", "pip", "compile", "--quiet", "--no-header", "--no-annotate",
         "--only-binary", ":all:", "--python-platform", machine, "--python-version", version, "-"],
        input="\n".join(project["dependencies"]), capture_output=True, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        return 0, " ".join(done.stderr.split())
    return len(done.stdout.splitlines()), ""


def main() -> int:
    """Print a table; 1 where something is missing."""
    missing = 0
    for name, machine in MACHINES.items():
        for version in VERSIONS:
            count, problem = resolved(machine, version)
            print(f"{name:16} Python {version}  {f'{count} wheels' if count else problem}")
            missing += not count
    return int(bool(missing))


if __name__ == "__main__":
    sys.exit(main())
