"""Section VII on paths of which many are shorter: on these a robot without middleware arrives now and then, too."""

from __future__ import annotations

from typing import Any, Final

from interfaces.lab.claims import Findings, Study
from interfaces.lab.tipsuwan.run import NetworkControl
from interfaces.lab.tipsuwan.s_paths import SHORTER, s_path
from interfaces.lab.tipsuwan.success import PATHS, PathSuccess, claim, controls, ran

ROBOT: Final = "kinematic"
CONTROLS: Final = (NetworkControl.DIRECT, NetworkControl.NETWORK)
CASES: Final = tuple(str(path) for path in range(PATHS))


def work(study: Study, case: str) -> PathSuccess:
    """Both controls and all delay seeds on a path."""
    found = ran(study, ROBOT, s_path(1000 * study.seed + int(case), within=SHORTER), CONTROLS)
    return found._replace(tracks={})


def conclude(study: Study, results: tuple[Any, ...]) -> Findings:
    """The share of success, and what became of both controls."""
    paths: list[PathSuccess] = list(results)
    table = controls(ROBOT, paths, "shorter", f", T_pred {SHORTER[0]:g} to {SHORTER[1]:g} s")
    return Findings((claim(ROBOT, NetworkControl.NETWORK, paths, SHORTER, study.seed),), (table,), ())
