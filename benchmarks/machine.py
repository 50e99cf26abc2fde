"""Where and when a run was made."""

from __future__ import annotations

import os
import platform
import subprocess
from pathlib import Path

from benchmarks import peers

HOME = Path(__file__).resolve().parents[1]


def facts() -> dict[str, str]:
    """The machine, the versions, the commit and how busy the machine is, by name."""
    one, five, quarter = os.getloadavg()
    dirty = " and changes that aren't committed" if _git("status", "--porcelain", "--untracked-files=no") else ""
    return {
        "processor": f"{_processor()}, {len(os.sched_getaffinity(0))} cores",
        "memory": f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.0f} GiB",
        "system": f"{platform.system()} {platform.release()}, {platform.machine()}",
        "Python": platform.python_version(),
        **peers.versions(),
        "commit": (_git("rev-parse", "--short=12", "HEAD") or "unknown") + dirty,
        "date of the commit": _git("show", "-s", "--format=%cs", "HEAD") or "unknown",
        "load": f"{one:.1f}, {five:.1f}, {quarter:.1f} (1, 5 and 15 minutes, at the start)",
    }


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor() or "unknown"


def _git(*words: str) -> str:
    answer = subprocess.run(["git", "-C", str(HOME), *words], capture_output=True, text=True, check=False)
    return answer.stdout.strip()
