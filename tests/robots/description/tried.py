"""The table of robots that were tried; `python -m tests.robots.description.tried` writes it into the how-to."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

import rtbdata

from robots.described import DescribedRobot, described

TOOLBOX = Path(rtbdata.__file__).parent / "xacro"
PAGE: Final = Path(__file__).parents[3] / "docs" / "howto" / "robot.md"
ROBOTS: Final = {
    "KUKA LBR iiwa": ("pybullet_data", "kuka_iiwa/model.urdf"),
    "Franka Panda": ("pybullet_data", "franka_panda/panda.urdf"),
    "xArm 6 with gripper": ("pybullet_data", "xarm/xarm6_with_gripper.urdf"),
    "cart-pole": ("pybullet_data", "cartpole.urdf"),
    "MuJoCo's pusher": ("pybullet_data", "mjcf/pusher.xml"),
    "Husky": ("pybullet_data", "husky/husky.urdf"),
    "PUMA 560": ("rtbdata", "unimation_puma560_description/urdf/puma560_robot.urdf"),
    "Lynxmotion AL5D": ("rtbdata", "lynxmotion_al5d_description/urdf/al5d_robot.urdf"),
    "KUKA LBR iiwa 14": ("rtbdata", "kuka_description/kuka_lbr_iiwa/urdf/lbr_iiwa_14_r820.xacro"),
    "Trossen PincherX 100": ("rtbdata", "trossen_descriptions/urdf/px100.urdf.xacro"),
    "ABB IRB 140": ("rtbdata", "abb_irb140_description/urdf/irb140.urdf"),
}
SAID: Final = {
    "mass": "no mass is said",
    "inertia": "no inertia is said",
    "two moments of inertia": "the inertia breaks",
}
"""What notes say of links, by what's assumed then."""
_MARKS: Final = "<!-- tried -->\n\n", "<!-- end of tried -->"


def bullet_data(name: str) -> Path:
    """A file of PyBullet's data."""
    import pybullet_data

    return Path(pybullet_data.getDataPath()) / name


@cache
def examined(robot: str) -> DescribedRobot:
    """A robot with what's said of it; each is read once."""
    package, name = ROBOTS[robot]
    return described(str(bullet_data(name) if package == "pybullet_data" else TOOLBOX / name))


def table() -> str:
    """The table, in Markdown."""
    lines = ["| robot | file | of | joints | ends at | assumed |", "|---|---|---|---|---|---|"]
    for name, (package, path) in ROBOTS.items():
        found = examined(name)
        of = "PyBullet's data" if package == "pybullet_data" else "the Toolbox's data"
        if found.robot.is_base:
            joints, tip = "2 driven wheels", "–"
        else:
            assert found.description is not None
            joints, tip = str(found.robot.arm.limits.dof), f"`{found.description.tip}`"
        lines.append(f"| {name} | `{Path(path).name}` | {of} | {joints} | {tip} | {', '.join(_assumed(found))} |")
    return "\n".join(lines) + "\n"


def _assumed(found: DescribedRobot) -> Iterator[str]:
    """What was assumed of a robot."""
    keys = dict.fromkeys(re.findall(r"^(\w+) =", "\n".join(found.to_state), re.MULTILINE))
    words = {"tip": "", "tool_speed": "", "tool_turn_speed": "the tool's speeds"}
    slower = re.search(r"reached in ([\d.]+ s), as the efforts", "\n".join(found.notes))
    if slower:
        words["acceleration"] = f"`acceleration` (largest speed in {slower[1]}, by the efforts)"
    yield from (said for key in keys if (said := words.get(key, f"`{key}`")))
    for what, said in SAID.items():
        names = [re.split(rf": {said}", note)[0] for note in found.notes if re.search(rf": {said}", note)]
        count = sum(len(name.split(", ")) for name in names)
        if count:
            yield f"{what} of {count} link{'s' * (count > 1)}"


def page() -> str:
    """The page with the table as it is."""
    text = PAGE.read_text(encoding="utf-8")
    start, end = text.index(_MARKS[0]) + len(_MARKS[0]), text.index(_MARKS[1])
    return text[:start] + table() + text[end:]


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
