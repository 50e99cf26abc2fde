"""The module creator: the packet handler of the robot's side, a method a device."""

from __future__ import annotations

from interfaces.rsp.creator.names import camel, values_type
from interfaces.rsp.model.elements import Command, Effector, Element, Event, MemoryCommand, MemoryEvent, Sensor
from interfaces.rsp.model.robot_model import RobotModel


def robot_module(model: RobotModel) -> str:
    """The text of `robot.py`."""
    handler = f"{camel(model.name)}Handler"
    body = [*_effects(model), *_outputs(model)]
    for index, element in enumerate(model):
        body += _methods(index, element, model)
    text = "\n".join(body)
    used = [name for name in ("Commanded", "RobotOutput", "Stored") if name in text or name == "RobotOutput"]
    lines = [
        f'"""The packet handler of the robot `{model.name}`: derive from it. Generated; don\'t edit."""',
        "",
        "from __future__ import annotations",
        "",
        f"from interfaces.rsp.outputs import {', '.join(used)}",
        "from interfaces.rsp.robot import RobotCore",
        *(["", "from . import packets"] if "packets." in text else []),
        "",
        "",
        f"class {handler}:",
        '    """Calls `on_…` for what came; `measure_…`, `occur_…` and `tell_…` send what the robot has to say."""',
        "",
        "    def __init__(self, core: RobotCore) -> None:",
        '        """Take the robot\'s side of the protocol."""',
        "        self.core = core",
        "",
        "    def advance(self, *, now: float) -> list[RobotOutput]:",
        '        """Do what is due by now [s]; returns what happened to the session."""',
        *body,
    ]
    return "\n".join(lines) + "\n"


def _effects(model: RobotModel) -> list[str]:
    moved = [(i, e) for i, e in enumerate(model) if isinstance(e, Effector) and not e.stream]
    lines = ["        told = self.core.effectors(now=now)"] if moved else ["        self.core.effectors(now=now)"]
    for index, element in moved:
        lines += [
            f"        if {index} in told:",
            f"            self.on_{element.name}(packets.values_{element.name}(told[{index}]))",
        ]
    return lines


def _outputs(model: RobotModel) -> list[str]:
    if not any(isinstance(element, Command | MemoryCommand) for element in model):
        return ["        return self.core.take()"]
    lines = [
        "        others: list[RobotOutput] = []",
        "        for output in self.core.take():",
        "            match output:",
    ]
    for index, element in enumerate(model):
        if isinstance(element, Command):
            lines += [
                f"                case Commanded(index={index}, payload=payload):",
                f"                    self.on_{element.name}(packets.unpack_{element.name}(payload))",
            ]
        elif isinstance(element, MemoryCommand):
            lines += [
                f"                case Stored(index={index}, data=data):",
                f"                    self.on_{element.name}(data)",
            ]
    return [
        *lines,
        "                case _:",
        "                    others.append(output)",
        "        return others",
    ]


def _methods(index: int, element: Element, model: RobotModel) -> list[str]:
    name, values = element.name, values_type(element, model)
    match element:
        case Effector(stream=size) if size:
            return [
                "",
                f"    def take_{name}(self) -> bytes | None:",
                f'        """Take the next fragment of {name}; None where there is none."""',
                f"        return self.core.streams.take({index})",
            ]
        case Effector() | Command():
            return [
                "",
                f"    def on_{name}(self, values: {values}) -> None:",
                f'        """Do what {name} was told."""',
            ]
        case Sensor():
            return [
                "",
                f"    def measure_{name}(self, values: {values}) -> None:",
                f'        """Set what {name} says."""',
                f"        self.core.measure({index}, packets.pack_{name}(values))",
            ]
        case Event():
            return [
                "",
                f"    def occur_{name}(self, values: {values}) -> bool:",
                f'        """Tell of {name}; returns whether it will be told."""',
                f"        return self.core.occur({index}, packets.pack_{name}(values))",
            ]
        case MemoryCommand():
            return [
                "",
                f"    def on_{name}(self, data: bytes) -> None:",
                f'        """Keep what came for {name}."""',
            ]
        case MemoryEvent():
            return [
                "",
                f"    def tell_{name}(self, data: bytes, *, deadline: float) -> int:",
                f'        """Tell {name}, to be settled by a time [s]; returns its ID."""',
                f"        return self.core.store({index}, data, deadline=deadline)",
            ]
        case _:
            return []
