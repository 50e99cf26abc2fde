"""`vrs rsp`: robot models, the code that is generated from them, and a service."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from interfaces.cli.options import argument, option
from interfaces.rsp.errors import NoSessionError
from interfaces.system import written
from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from interfaces.rsp.middleware import Middleware
    from interfaces.rsp.model import Element, RobotModel
    from interfaces.rsp.story import StoryTeller

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


@rsp.command(short_help="Let a thin client tell a story to whoever comes near")
def story(
    address: Annotated[str, argument("HOST:PORT", "Where vrs robot --rsp HOST:PORT --model story listens.")],
    text: Annotated[Path | None, option("--text FILE", "What is told instead, a sentence a line.")] = None,
    out: Annotated[
        Path | None, option("DIR", "Where pictures of who came go, and what was heard: visit-N.jpg, heard.wav.")
    ] = None,
    token_file: Annotated[Path | None, option("FILE", "Token file of that robot.")] = None,
    visits: Annotated[int, option("N", "End after so many visitors; 0 for never.", min=0)] = 0,
) -> None:
    """Let a thin client tell a story whenever somebody comes near it, as its sensors say, until Ctrl-C."""
    from interfaces.rsp.live import opened
    from interfaces.rsp.model import read_model
    from interfaces.rsp.story import STORY, StoryTeller
    from interfaces.system import run_loop
    from robots.robot import USUAL_CLIENT, ThinClient, load
    from vrs.checks import bounded_text

    told = (
        STORY if text is None else tuple(line for line in bounded_text(text, 20_000).splitlines() if line.strip())
    )
    if not told:
        raise InvalidValueError("text", str(text), "a file with a sentence")
    client = load(USUAL_CLIENT).device(ThinClient)
    assert client is not None
    rate = client.sound_rate
    sound, problem = run_loop(_spoken(told, rate))
    if problem:
        typer.echo(f"vrs: {problem}: the story is only written", err=True)
    if out is not None:
        with written(out):
            out.mkdir(parents=True, exist_ok=True)
    with opened(read_model(client.model.with_name("story.xmi")), address, key_file=token_file) as middleware:
        teller = StoryTeller(middleware, sound, rate)
        typer.echo(f"vrs: waiting for somebody to come near {address}")
        try:
            _tell(teller, middleware, told, out, visits)
        except KeyboardInterrupt:
            typer.echo("")
        finally:
            if out is not None:
                _write_heard(teller, out / "heard.wav")


def _tell(teller: StoryTeller, middleware: Middleware, told: Sequence[str], out: Path | None, visits: int) -> None:
    """Let visitors be told the story, until the session or the last visit is over."""
    import math

    seen, until = 0, -math.inf
    while middleware.is_open and not (visits and teller.told >= visits and middleware.clock.now() >= until):
        before, now = teller.told, middleware.clock.now()
        who = teller.turn(now=now)
        if who is not None:
            typer.echo(f"vrs: somebody is {who[0]:.2f} m away, at {math.degrees(who[1]):.0f} deg to the left")
        if teller.told > before:
            typer.echo("\n".join(told))
            # A picture of it comes meanwhile.
            until = now + max(teller.lasts, 2.0)
        while out is not None and teller.pictures:
            seen += 1
            with written(out):
                (out / f"visit-{seen}.jpg").write_bytes(teller.pictures.popleft())
        middleware.wait_for(lambda: not middleware.is_open, 0.02)
    if not middleware.is_open:
        raise NoSessionError("lost")


def _write_heard(teller: StoryTeller, path: Path) -> None:
    """Write what the microphone heard of late, as WAV."""
    import wave

    from robots.mobile.microphone import TOLD_RATE

    with written(path), path.open("wb") as raw, wave.open(raw, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(TOLD_RATE)
        file.writeframes(b"".join(piece.tobytes() for piece in tuple(teller.heard)))


async def _spoken(sentences: Sequence[str], rate: int) -> tuple[bytes, str]:
    """Sentences as a speaker plays them that wants a rate [1/s]; without the program nothing, and why."""
    from interfaces.media.speech import SpeechError, cleaned, spoken
    from interfaces.rsp.story import playable

    try:
        return b"".join([playable(*await spoken(cleaned(sentence)), rate) for sentence in sentences]), ""
    except SpeechError as error:
        return b"", str(error)


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
