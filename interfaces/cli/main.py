"""The door of the command line: every failure that a user can mend is one line and exit code 2."""

from __future__ import annotations

import errno
import io
import logging
import os
import signal
import sys
import threading
from concurrent.futures import BrokenExecutor
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
from interfaces.cli.options import option
from interfaces.cli.replay import replay
from interfaces.cli.reproduce import reproduce
from interfaces.cli.robot import robot
from interfaces.cli.rsp import rsp
from interfaces.cli.run import run
from interfaces.cli.serve import serve
from interfaces.cli.token import token
from interfaces.cli.view import router, view
from interfaces.system import software
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
app.command(short_help="Both twins on one plan across an emulated internet: begin here")(demo)
app.command(short_help="What this machine lacks, and how to mend it")(doctor)
app.command(short_help="The operator station in a browser, both robots live")(serve)
app.command(short_help="The real robot alone: the remote site")(robot)
app.command(short_help="Type VAL-II commands to an arm")(console)
app.command(short_help="A VAL-II program on both twins")(run)
app.command(short_help="What is wrong with a VAL-II program, or assumed of a robot")(check)
app.command(short_help="Play recordings back, in the browser or as lines")(replay)
app.command(short_help="How far apart the twins of a recording were")(compare)
app.command(short_help="A recording as tables or as a report")(export)
app.command(short_help="Seeded experiments with a mobile robot")(lab)
app.command(short_help="What papers claim, measured")(reproduce)
app.command(short_help="An emulated internet between two programs")(link)
app.command(short_help="A relay: a served robot's page for viewers elsewhere")(view)
app.command(short_help="What joins relays to servers, by Zenoh")(router)
app.add_typer(token, short_help="Tokens of people: make, list, end")
app.add_typer(rsp, short_help="Robot models of the simulacrum protocol, and code from them")
app.add_typer(middleware, short_help="The gain network of the network middleware")


def _version(value: bool) -> None:
    if value:
        typer.echo(software())
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, option("--version", "Show the version and exit.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """An internet-teleoperation laboratory: virtual and simulated real robots on one timeline."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 the machine is at fault, 2 bad input, 130 Ctrl-C or SIGTERM."""
    _ready_streams()
    # Whoever ends it so wants workers and robots ended as by Ctrl-C; what serves has its own way.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    sys.unraisablehook = _interrupt_again
    sys.exit(exit_status(sys.argv[1:] if arguments is None else arguments))


def _interrupt_again(lost: sys.UnraisableHookArgs) -> None:
    """Send an interruption again that came in a callback, as of an import, where Python can only print it."""
    if isinstance(lost.exc_value, KeyboardInterrupt):
        threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGTERM)).start()
    else:
        sys.__unraisablehook__(lost)


def _ready_streams() -> None:
    """Have standard streams, whatever this was started with, and let warnings look like what else is said."""
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w", encoding="utf-8"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    if logging.lastResort is not None:
        logging.lastResort.setFormatter(logging.Formatter("vrs: %(message)s"))


def exit_status(arguments: list[str]) -> int:
    """Run the command line, and return the status that `main` exits with; errors are said on standard error."""
    try:
        result = app(args=arguments or ["--help"], prog_name="vrs", standalone_mode=False)
        sys.stdout.flush()
    except (KeyboardInterrupt, typer.Abort):
        return _say("interrupted", 130)
    except UsageProblem as error:
        command = getattr(getattr(error, "ctx", None), "command_path", "vrs")
        said = getattr(error, "format_message", error.__str__)()
        return _say(f"{said} ({command} --help says what is allowed)", 2)
    except VrsError as error:
        return _say(str(error), 2)
    except BrokenExecutor:
        return _say("a worker was ended from outside: memory may be short; fewer --workers take less", 1)
    except BrokenPipeError:
        return _unheard(1)
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        return _unheard(_say(f"standard output: {error.strerror}", 1))
    status = result if isinstance(result, int) else 0
    # Typer turns Ctrl-C into this status by itself, and says nothing.
    return _say("interrupted", status) if status == 130 else status


def _unheard(status: int) -> int:
    """Let the interpreter not fail again when it flushes what nobody takes."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status


def _say(message: str, status: int) -> int:
    line = " ".join(message.split())
    typer.echo(f"vrs: {line}", err=True)
    return status
