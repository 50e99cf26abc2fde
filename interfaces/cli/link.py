"""`vrs link`: a bad link between two programs that talk TCP or UDP."""

from __future__ import annotations

import enum
import json
import math
from typing import TYPE_CHECKING, Annotated, Any

import typer

from interfaces.cli.options import PROFILES, Seed, end_on_signal, option

if TYPE_CHECKING:
    from interfaces.link import Conditions, DelayProfile
    from interfaces.link.proxy import Proxy


class ProxyTransport(enum.StrEnum):
    """What the proxy passes on."""

    TCP = "tcp"
    UDP = "udp"
    BOTH = "both"


def link(
    listen: Annotated[
        str,
        option(
            "[HOST:]PORT",
            "Where clients come: loopback without a host, any free port for 0. No access control.",
        ),
    ],
    to: Annotated[str, option("[HOST:]PORT", "The server.")],
    delay: Annotated[str, option("PROFILE", f"One-way delay, each way: {PROFILES}")],
    delay_back: Annotated[
        str | None, option("PROFILE", "One-way delay from the server; as --delay without it.")
    ] = None,
    loss: Annotated[str, option("P", "Share of packets lost, or burst:P,N in bursts of N packets.")] = "0",
    duplicate: Annotated[float, option("P", "Share of datagrams that arrive twice.", min=0, max=1)] = 0.0,
    reorder: Annotated[
        float, option("P", "Share of packets held back, beside what delays do.", min=0, max=1)
    ] = 0.0,
    reorder_by: Annotated[float, option("S", "How long they are held back [s].", min=0, max=3600)] = 0.05,
    bandwidth: Annotated[float, option("BITS", "Rate each way [bit/s]; unlimited without it.", min=1)] = math.inf,
    queue: Annotated[
        int,
        option("N", "Datagrams that wait for the bandwidth before some are dropped.", min=1, max=10_000_000),
    ] = 1000,
    transport: Annotated[
        ProxyTransport, option("--transport", "What to pass on; both use the same port number.")
    ] = ProxyTransport.BOTH,
    clients: Annotated[int, option("N", "Most connections, and most UDP clients, at once.", min=1, max=1000)] = 64,
    idle: Annotated[float, option("S", "A UDP client is forgotten after so long [s].", min=0.01, max=86400)] = 60.0,
    seed: Seed = 0,
    as_json: Annotated[bool, option("--json", "Write statistics as JSON on standard output at the end.")] = False,
) -> None:
    """Delay, lose and reorder what passes between two programs, until Ctrl-C or SIGTERM."""
    import asyncio

    import numpy as np

    from interfaces.link import Conditions, LinkConditions, delay_profile, loss_model
    from interfaces.link.proxy import Proxy, ProxySettings, parse_address
    from vrs.clock import WallClock

    def conditions(profile: DelayProfile) -> Conditions:
        return Conditions(
            delay=profile,
            loss=loss_model(loss),
            duplicate=duplicate,
            reorder=reorder,
            reorder_by=reorder_by,
            bandwidth=bandwidth,
            queue_packets=queue,
        )

    forward = delay_profile(delay)
    backward = forward if delay_back is None else delay_profile(delay_back)
    settings = ProxySettings(
        parse_address("--listen", listen),
        parse_address("--to", to),
        LinkConditions(conditions(forward), conditions(backward)),
        tcp=transport is not ProxyTransport.UDP,
        udp=transport is not ProxyTransport.TCP,
        most_clients=clients,
        udp_idle=idle,
    )
    proxy = Proxy(settings, WallClock(), np.random.default_rng(seed))
    asyncio.run(_serve(proxy, f"{transport}, to {settings.to}, delay {delay}"))
    statistics = {**proxy.statistics(), "seed": seed}
    if as_json:
        typer.echo(json.dumps(statistics, indent=2, sort_keys=True))
    else:
        for line in _lines(statistics):
            typer.echo(line)


async def _serve(proxy: Proxy, about: str) -> None:
    """Pass packets on until a signal comes."""
    import asyncio

    ended = asyncio.Event()
    end_on_signal(ended)
    try:
        await proxy.start()
        typer.echo(f"vrs: link listens on {proxy.listening} ({about})", err=True)
        await ended.wait()
    finally:
        proxy.close()


def _lines(statistics: dict[str, Any]) -> list[str]:
    """The statistics for a reader."""
    lines = [f"{statistics['duration_s']:.1f} s, delay {statistics['delay_forward']}, seed {statistics['seed']}"]
    for transport in ("tcp", "udp"):
        for way in ("forward", "backward"):
            if transport in statistics:
                totals = statistics[transport][way]
                mean = totals["delay_mean"]
                delay = "" if mean is None else f", mean delay {mean:.4f} s"
                lost = sum(totals["lost"].values())
                lines.append(
                    f"{transport} {way:9}{totals['sent']} sent, {totals['arrived']} arrived, {lost} lost, "
                    f"{totals['resent']} sent again{delay}"
                )
    late = statistics["timers"]["late_max_s"]
    return lines if late is None else [*lines, f"timers at most {1e3 * late:.1f} ms late"]
