"""`vrs robot --rsp`: the thin client CUBO, a body without a brain."""

from __future__ import annotations

import asyncio
import secrets
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from interfaces.cli.doors import end_on_signal, end_with_input, is_loopback, keep_quiet
from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    import socket

    from interfaces.rsp.model import RobotModel
    from interfaces.rsp.session import Keyring
    from robots.bullet.rooms import Room


def thin_client(address: str, model: Path | None, room: Room, token_file: Path | None, *, until_eof: bool) -> None:
    """Run a CUBO until a signal comes or its body fails.

    Args:
        address: Where it listens for RSP, HOST:PORT.
        model: Of its devices; CUBO's own unless given.
        room: Where it drives.
        token_file: Keys; needed off loopback, made if it's missing.
        until_eof: Whether it ends with standard input.

    Raises:
        InvalidValueError: If something isn't allowed.
        FormatError: If a file or the address can't be used.
    """
    import uvloop

    from interfaces.link.proxy import parse_address
    from interfaces.rsp.live import bind
    from interfaces.rsp.model import read_model
    from robots.cubo.parameters import MODEL_FILE

    where = parse_address("--rsp", address)
    robot = read_model(MODEL_FILE if model is None else model)
    keys = _keys(where.host, token_file)
    sock = bind(where.host, where.port)
    problem = uvloop.run(_serve(robot, room, keys, sock, until_eof=until_eof))
    if problem:
        typer.echo(f"vrs: {problem}", err=True)
        raise typer.Exit(1)


def _keys(host: str, token_file: Path | None) -> Keyring | None:
    from interfaces.rsp.live import keys_of
    from interfaces.stream.access import make_tokens, read_tokens

    if token_file is None:
        if not is_loopback(host):
            raise InvalidValueError("host", host, "127.0.0.1 or localhost, unless a --token-file is given")
        return None
    return keys_of(read_tokens(token_file) if token_file.exists() else make_tokens(token_file), token_file)


async def _serve(
    model: RobotModel, room: Room, keys: Keyring | None, sock: socket.socket, *, until_eof: bool
) -> str:
    """Run until a signal comes, the body fails, or standard input ends; what failed, if anything did."""
    from interfaces.rsp.host import RspHost
    from interfaces.rsp.live import RspServer
    from interfaces.rsp.robot import RobotCore
    from interfaces.runtime.live.process import READY
    from interfaces.system import hasten
    from robots.cubo.body import MOVES, CuboBody
    from vrs.clock import WallClock

    ended = asyncio.Event()
    end_on_signal(ended)
    with CuboBody(room=room) as body:
        clock = WallClock()
        host = RspHost(RobotCore(model, secrets.token_bytes, keys=keys), body, frozenset(MOVES), now=clock.now())
        server = RspServer(host, sock, clock)
        server.failed.add_done_callback(lambda _: ended.set())
        address, port = sock.getsockname()[:2]
        async with server.running():
            keep_quiet()
            hasten(1)
            sealed = "sealed" if keys else "in the clear"
            typer.echo(f"{READY}rsp://{address}:{port} ({model.name}, {len(model.elements)} devices, {sealed})")
            sys.stdout.flush()
            if until_eof:
                end_with_input(ended)
            await ended.wait()
            failed = server.failed
            error = failed.exception() if failed.done() and not failed.cancelled() else None
    return "" if error is None else f"the body failed: {error}"
