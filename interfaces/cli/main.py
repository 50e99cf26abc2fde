"""The door of the command line: every failure that a user can mend is one line and exit code 2."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from interfaces.cli.check import check
from interfaces.cli.compare import compare
from interfaces.cli.console import console
from interfaces.cli.demo import demo
from interfaces.cli.doctor import doctor
from interfaces.cli.export import export
from interfaces.cli.lab import lab
from interfaces.cli.link import link
from interfaces.cli.middleware import middleware
from interfaces.cli.replay import replay
from interfaces.cli.reproduce import reproduce
from interfaces.cli.robot import robot
from interfaces.cli.rsp import rsp
from interfaces.cli.run import run
from interfaces.cli.serve import serve
from interfaces.software import software
from vrs.errors import VrsError

# Typer exports only one of its usage errors; the class above it is the root of all of them.
UsageProblem: type[Exception] = typer.BadParameter.__mro__[1]

app = typer.Typer(
    name="vrs",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
app.command()(check)
app.command()(compare)
app.command()(console)
app.command()(demo)
app.command()(doctor)
app.command()(export)
app.command()(link)
app.command()(replay)
app.command()(lab)
app.command()(reproduce)
app.command()(robot)
app.command()(run)
app.command()(serve)
app.add_typer(rsp)
app.add_typer(middleware)


def _version(value: bool) -> None:
    if value:
        typer.echo(software())
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """An internet-teleoperation laboratory: virtual and simulated real robots on one timeline."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 the machine is at fault, 2 bad input, 130 Ctrl-C."""
    sys.exit(_status(sys.argv[1:] if arguments is None else arguments))


def _status(arguments: list[str]) -> int:
    try:
        result = app(args=arguments or ["--help"], prog_name="vrs", standalone_mode=False)
        sys.stdout.flush()
    except (KeyboardInterrupt, typer.Abort):
        return _say("interrupted", 130)
    except UsageProblem as error:
        return _say(f"{getattr(error, 'format_message', error.__str__)()} (vrs --help says what is allowed)", 2)
    except VrsError as error:
        return _say(str(error), 2)
    except BrokenPipeError:
        # Whoever read our output has left; the interpreter must not fail again when it flushes.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    status = result if isinstance(result, int) else 0
    # Typer turns Ctrl-C into this status by itself, and says nothing.
    return _say("interrupted", status) if status == 130 else status


def _say(message: str, status: int) -> int:
    line = " ".join(message.split())
    typer.echo(f"vrs: {line}", err=True)
    return status
