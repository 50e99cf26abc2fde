"""`vrs view`: a relay, which serves a robot's page to viewers elsewhere; `vrs router`: what joins both ends."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

import typer

from interfaces.cli.options import (
    Audit,
    Host,
    Hosts,
    Port,
    ReachedAs,
    Tls,
    TlsCert,
    TlsKey,
    TokenFile,
    ZenohFile,
    access_for,
    asked_for,
    audit_log,
    certificate_for,
    collect_at_leisure,
    end_on_signal,
    end_with_input,
    keep_quiet,
    option,
    say_certificate,
    schemes,
    shown_host,
    tls_of,
)
from interfaces.system import run_loop, software

if TYPE_CHECKING:
    from interfaces.relay.network import NetworkConfig
    from interfaces.stream.access import Access
    from interfaces.stream.audit import AuditLog
    from interfaces.stream.certificates import Certificate


def view(
    zenoh: Annotated[str, option("ENDPOINT", "Router where a vrs serve --zenoh publishes: tcp/127.0.0.1:7447.")],
    site: Annotated[str, option("NAME", "Which site, as its vrs serve --site; the first that's there.")] = "*",
    robot: Annotated[str, option("NAME", "Which of its robots; the first that's there.")] = "*",
    zenoh_config: ZenohFile = None,
    host: Host = "127.0.0.1",
    port: Port = 8700,
    token_file: TokenFile = None,
    reached_as: ReachedAs = None,
    tls: Tls = None,
    tls_cert: TlsCert = None,
    tls_key: TlsKey = None,
    audit: Audit = None,
    until_eof: Annotated[bool, option("--until-eof", "End when standard input does.")] = False,
) -> None:
    """Relay a robot that vrs serve --zenoh publishes to viewers here, until Ctrl-C or SIGTERM."""
    from interfaces.messages.control import Role
    from interfaces.relay.network import NetworkConfig

    network = NetworkConfig((zenoh,), file=zenoh_config)
    allowed = asked_for(host, reached_as or ())
    access = access_for(host, token_file, free={Role.VIEWER})
    certificate = certificate_for(host, token_file, reached_as or (), tls=tls, chain=tls_cert, key=tls_key)
    shown = reached_as[0] if reached_as else ""
    with audit_log(audit) as log:
        access.audit = log
        run_loop(
            _view(network, (site, robot), access, host, port, allowed, shown, certificate, log, until_eof=until_eof)
        )


async def _view(
    config: NetworkConfig,
    which: tuple[str, str],
    access: Access,
    host: str,
    port: int,
    allowed: Hosts,
    reached_as: str,
    certificate: Certificate | None,
    log: AuditLog | None,
    *,
    until_eof: bool,
) -> None:
    """Run until a signal comes."""
    import asyncio
    import contextlib

    from starlette.routing import Mount

    from interfaces.link.proxy import Address
    from interfaces.relay.network import Network
    from interfaces.relay.relay import SOCKETS, Relay, RelayConfig
    from interfaces.stream import sockets
    from interfaces.stream.server import application
    from vrs.clock import WallClock

    ended = asyncio.Event()
    end_on_signal(ended)
    async with contextlib.AsyncExitStack() as stack:
        listening = stack.enter_context(contextlib.closing(sockets.bind(host, port)))
        at = Address(shown_host(host), listening.getsockname()[1])
        page, ws, known = schemes(certificate)
        clock = WallClock()
        own = RelayConfig(*which, f"{page}://{reached_as or at}/", software())
        relay = Relay(
            own,
            Network(config, clock),
            access,
            clock,
            audit=log,
            say=lambda said: typer.echo(f"vrs: {said}", err=True),
        )
        app = application([Mount("/", relay)], allowed(at.port), audit=log)
        await stack.enter_async_context(sockets.serve(app, listening, limits=SOCKETS, tls=tls_of(certificate)))
        await stack.enter_async_context(relay.running())
        keep_quiet()
        tidying = asyncio.create_task(collect_at_leisure(lambda: True))
        stack.callback(tidying.cancel)
        typer.echo(f"vrs: relay on {page}://{at}/ (programs: {ws}://{at}/ws{known})")
        say_certificate(certificate)
        sys.stdout.flush()
        if until_eof:
            end_with_input(ended)
        await ended.wait()


def router(
    listen: Annotated[str, option("ENDPOINT", "Where hubs, relays and routers come: tcp/127.0.0.1:7447.")],
    connect: Annotated[
        list[str] | None, option("ENDPOINT", "Another router, which this one joins; may be repeated.")
    ] = None,
    zenoh_config: ZenohFile = None,
) -> None:
    """Join hubs to relays by Zenoh, until Ctrl-C or SIGTERM; zenohd does the same."""
    from interfaces.relay.network import NetworkConfig

    run_loop(_route(NetworkConfig(tuple(connect or ()), (listen,), zenoh_config)))


async def _route(config: NetworkConfig) -> None:
    """Run until a signal comes."""
    import asyncio
    import contextlib

    from interfaces.relay.network import Network
    from vrs.clock import WallClock

    ended = asyncio.Event()
    end_on_signal(ended)
    network = Network(config, WallClock())
    ending = asyncio.create_task(ended.wait())
    opening = asyncio.create_task(network.open())
    await asyncio.wait([ending, opening], return_when=asyncio.FIRST_COMPLETED)
    if opening.done():
        await opening
        typer.echo(f"vrs: Zenoh router on {', '.join(config.listen)}")
        sys.stdout.flush()
        await ending
    opening.cancel()
    with contextlib.suppress(asyncio.CancelledError):
        await opening
    await network.close()
