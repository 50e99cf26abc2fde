"""Delay profiles as the command line spells them: how long a packet takes one way, and whether it arrives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from interfaces.link.delay import CORRELATION_TIME, MAX_DELAY, ConstantDelay, DelayProfile
from interfaces.link.gamma import GammaDelay
from interfaces.link.measured import MEASURED
from interfaces.link.route import RouteDelay
from interfaces.link.trace import TraceDelay, read_trace
from vrs.errors import InvalidValueError

LUNAR_ROUND_TRIP = 2.56
"""Earth to Moon and back [s]."""

ALLOWED = (
    f"none, constant:S (S seconds in [0, {MAX_DELAY:g}]), {', '.join(MEASURED)}, gamma:MEAN,SD[,MIN] (s), "
    "route:DISTANCE,NODES,ROUTING,LOAD,BANDWIDTH (m, count, s, s, bit/s), lunar, "
    "or trace:FILE.csv with a delay_s column; the measured rows, gamma and route may end in @TAU "
    f"(correlation time in s, {CORRELATION_TIME:g} without it, 0 for independent draws)"
)
"""What a delay profile may be, in words."""


def delay_profile(text: str) -> DelayProfile:
    """Read a delay profile as the command line spells it.

    Args:
        text: `none`, `constant:S`, `domain`, `country`, `mon` to `fri`, `gamma:MEAN,SD[,MIN]`,
            `route:DISTANCE,NODES,ROUTING,LOAD,BANDWIDTH`, `lunar` or `trace:FILE.csv`. The measured rows,
            gamma and route may carry a correlation time in seconds: `thu@20`; `thu@0` draws independently.

    Returns:
        The profile; its delays are one way.

    Raises:
        InvalidValueError: If text is none of these.
        FormatError: If a trace file can't be read as one.
    """
    kind, colon, argument = text.partition(":")
    if text == "none":
        return ConstantDelay(text, 0.0)
    if text == "lunar":
        return ConstantDelay(text, LUNAR_ROUND_TRIP / 2)
    if kind == "trace" and argument:
        return TraceDelay(text, read_trace(Path(argument), longest=MAX_DELAY))
    try:
        return _spelled(text, kind, argument if colon else None)
    except InvalidValueError as error:
        raise InvalidValueError("delay profile", text, f"{ALLOWED} ({error})") from None
    except (ValueError, KeyError, TypeError):
        raise InvalidValueError("delay profile", text, ALLOWED) from None


def _spelled(text: str, kind: str, argument: str | None) -> DelayProfile:
    """Read a profile with numbers; any ValueError, KeyError or TypeError means that it isn't one."""
    if kind == "constant":
        return ConstantDelay(text, float(argument or "none"))
    body, at, tau_text = (kind if argument is None else argument).partition("@")
    tau = float(tau_text) if at else CORRELATION_TIME
    if argument is not None:
        return _PARAMETRIC[kind](text, body.split(","), tau)
    return replace(MEASURED[body], name=text, correlation_time=tau) if at else MEASURED[body]


def _gamma(text: str, parts: list[str], tau: float) -> DelayProfile:
    mean, deviation, low = (float(part) for part in (parts if len(parts) == 3 else [*parts, "0"]))
    return GammaDelay(text, mean, deviation, low, tau)


def _route(text: str, parts: list[str], tau: float) -> DelayProfile:
    distance, nodes, routing, load, bandwidth = parts
    return RouteDelay.uniform(
        text,
        distance=float(distance),
        nodes=int(nodes),
        routing=float(routing),
        load=float(load),
        bandwidth=float(bandwidth),
        tau=tau,
    )


_PARAMETRIC: dict[str, Callable[[str, list[str], float], DelayProfile]] = {"gamma": _gamma, "route": _route}
