"""`vrs rsp`: robot models, and the code that is generated from them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from interfaces.cli.options import argument, option
from interfaces.system import written

if TYPE_CHECKING:
    from interfaces.rsp.model import Element, RobotModel

rsp = typer.Typer(name="rsp", rich_markup_mode=None)
model = typer.Typer(name="model", rich_markup_mode=None)
rsp.add_typer(model, help="Robot models: new, show, check.")

ModelFile = Annotated[Path, argument("MODEL.xmi", "A robot model.")]
AsJson = Annotated[bool, option("--json", "Write it as JSON on standard output.")]


@rsp.callback()
def _rsp() -> None:
    """The robot simulacrum protocol: robot models, and code generated from them."""


@model.command()
def new(
    file: Annotated[Path, argument("MODEL.xmi", "Where it goes; nothing may be there.")],
    name: Annotated[str, option("NAME", "Of the robot: a to z, digits, _.")] = "rover",
    model_id: Annotated[int, option("--id N", "Model ID, 0 to 65535.")] = 1,
) -> None:
    """Write a small model with one element of each kind, to begin with."""
    from interfaces.rsp.model import example, write_model

    text = write_model(example(name, model_id))
    with written(file), file.open("xb") as target:
        target.write(text)
    typer.echo(f"Wrote {file}")


@model.command()
def show(file: ModelFile, as_json: AsJson = False) -> None:
    """Show a model: its device map and the payloads of its elements."""
    from interfaces.rsp.model import read_model

    facts = _facts(read_model(file))
    if as_json:
        typer.echo(json.dumps(facts, indent=2))
        return
    from rich.console import Console

    from interfaces.report.tables import table_of

    title = f"{facts['name']}, model ID {facts['id']}, a map of {facts['map_bytes']} bytes"
    heads = ("bit", "element", "kind", "down [B]", "up [B]", "values")
    table = table_of(title, heads, left=("element", "kind", "values"))
    for row in facts["elements"]:
        table.add_row(*("" if cell is None else str(cell) for cell in row.values()))
    Console(markup=False).print(table)


@model.command(short_help="What is wrong with a model")
def check(file: ModelFile, as_json: AsJson = False) -> None:
    """Check a model against the metamodel, and that its elements fit together."""
    from interfaces.rsp.model import read_model

    facts = _facts(read_model(file))
    if as_json:
        typer.echo(json.dumps({key: value for key, value in facts.items() if key != "elements"}, indent=2))
    else:
        typer.echo(f"{file}: {facts['name']}, {facts['count']} elements, fine")


@rsp.command(short_help="A robot's middleware and packet handlers, as a Python package")
def generate(
    file: ModelFile,
    out: Annotated[Path, option("DIR", "Where the package goes, by the model's name; here unless given.")] = Path(),
    as_json: AsJson = False,
) -> None:
    """Write the middleware and the packet handlers of a robot, as a typed Python package."""
    from interfaces.rsp.creator import write_package
    from interfaces.rsp.model import read_model

    robot = read_model(file)
    target = write_package(robot, out)
    files = sorted(path.name for path in target.iterdir() if path.is_file())
    if as_json:
        typer.echo(json.dumps({"package": str(target), "files": files}, indent=2))
    else:
        typer.echo(f"Wrote {target}: {', '.join(files)}")


def _facts(robot: RobotModel) -> dict[str, Any]:
    from interfaces.rsp.header import SIZE
    from interfaces.rsp.layout import Layout, PacketDirection

    layout = Layout(robot)
    rows = []
    for index, element in enumerate(robot):
        down, up = (layout.sizes[way][index] for way in PacketDirection)
        rows.append(
            {
                "bit": index,
                "name": element.name,
                "kind": type(element).__name__,
                "down_bytes": "varies" if down == -1 else down,
                "up_bytes": "varies" if up == -1 else up,
                "values": _values(element),
            }
        )
    return {
        "name": robot.name,
        "id": robot.id,
        "count": layout.count,
        "buffers": robot.buffers,
        "header_bytes": SIZE,
        "map_bytes": layout.map_size,
        "longest_down_bytes": SIZE + layout.longest[PacketDirection.DOWN],
        "longest_up_bytes": SIZE + layout.longest[PacketDirection.UP],
        "elements": rows,
    }


def _values(element: Element) -> str:
    from interfaces.rsp.model import MemoryCommand, MemoryEvent, Module, Monitor

    match element:
        case Module():
            return " ".join(element.members)
        case Monitor():
            return f"of {element.effector}"
        case MemoryCommand() | MemoryEvent():
            return f"{element.size} bytes at most"
        case _:
            unit = f" × {element.scale:g} {element.unit}" if element.unit else ""
            return f"{element.count} {element.type}{unit}"
