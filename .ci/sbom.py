"""Writes what an environment is made of, CycloneDX: `python .ci/sbom.py OTHER/bin/python FILE`.

It has every distribution of the environment, or this fails; dates and serial numbers are left out.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

HOME = Path(__file__).resolve().parents[1]
LIST = "import json, importlib.metadata as m; print(json.dumps([(d.name, d.version) for d in m.distributions()]))"


def main(python: str, file: Path) -> None:
    """Write and check it."""
    file.parent.mkdir(exist_ok=True)
    subprocess.run(
        [sys.executable, "-m", "cyclonedx_py", "environment", "--pyproject", str(HOME / "pyproject.toml"),
         "--mc-type", "application", "--short-PURLs", "--output-reproducible", "--validate", "--of", "JSON",
         "--output-file", str(file), python],
        check=True,
    )  # fmt: skip
    written = json.loads(file.read_text(encoding="utf-8"))
    listed = [*written["components"], written["metadata"]["component"]]
    known = {(one["name"], one["version"]) for one in listed}
    listing = subprocess.run([python, "-c", LIST], check=True, stdout=subprocess.PIPE).stdout
    installed = {(name, version) for name, version in json.loads(listing)}
    if missing := installed - known:
        sys.exit(f"{file} hasn't got {sorted(missing)}")
    print(f"{file}: {len(written['components'])} components")


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
