"""`vrs token`: the people of a token file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from interfaces.cli.options import argument, option
from vrs.checks import number_in, one_of

token = typer.Typer(name="token", rich_markup_mode=None)
TokensOf = Annotated[Path, argument("FILE", "The --token-file of a server.")]
Name = Annotated[str, argument("NAME", "Of a person: letters, digits, '.', '_' and '-'.")]
DAY = 86400.0


@token.callback()
def _token() -> None:
    """Tokens of people: a server that uses the file takes a change at once."""


@token.command()
def make(
    file: TokensOf,
    name: Name,
    role: Annotated[str, option("ROLE", "viewer, operator, admin or site.")] = "viewer",
    days: Annotated[
        float, option("N", "It counts to the end of the day so far from now, by UTC; 0 is today.")
    ] = 30.0,
) -> None:
    """Make somebody's token and show it: the file keeps its digest alone."""
    from interfaces.messages.control import Role
    from interfaces.stream.access import add_person
    from vrs.clock import seconds_since_1970, utc

    chosen = Role(one_of("role", role, Role))
    number_in("days", days, 0.0, 3660.0)
    until = f"{utc(seconds_since_1970() + days * DAY):%Y-%m-%d}"
    typer.echo(add_person(file, name, chosen, until))
    typer.echo(f"vrs: {name}, {chosen}, until {until}", err=True)


@token.command("list")
def list_people(file: TokensOf) -> None:
    """List the people: name, role, last day."""
    from interfaces.stream.access import read_people
    from vrs.clock import utc

    for one in read_people(file):
        ended = "" if one.counts else " (ended)"
        typer.echo(f"{one.name} {one.role} {utc(one.until - 1.0):%Y-%m-%d}{ended}")


@token.command()
def end(file: TokensOf, name: Name) -> None:
    """End somebody's token: connections by it are closed within a second."""
    from interfaces.stream.access import end_person

    end_person(file, name)
