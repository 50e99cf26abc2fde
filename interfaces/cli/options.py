"""Options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, TypeAlias

import typer

PROFILES = (
    "none, constant:S, domain, country, mon, tue, wed, thu, fri, lunar, gamma:MEAN,SD[,MIN], "
    "route:DISTANCE,NODES,ROUTING,LOAD,BANDWIDTH or trace:FILE.csv; thu@20 for a correlation time of 20 s."
)
"""What a delay may be."""

Delay: TypeAlias = Annotated[str, typer.Option("--delay", metavar="PROFILE", help=PROFILES)]
Offset: TypeAlias = Annotated[
    str,
    typer.Option(
        "--offset",
        metavar="OFFSET",
        help="How far the real robot plays behind: adaptive, fixed (the profile's 95 % quantile) or fixed:S.",
    ),
]
Order: TypeAlias = Annotated[
    str, typer.Option("--service", metavar="ORDER", help="Delivery on the link: datagram or in-order.")
]
Out: TypeAlias = Annotated[
    Path, typer.Option("--out", metavar="DIR", help="Where report.html, summary.json and run.mcap go.")
]
Host: TypeAlias = Annotated[
    str,
    typer.Option("--host", metavar="HOST", help="Address to listen on; off loopback with --token-file only."),
]
Port: TypeAlias = Annotated[
    int, typer.Option("--port", min=0, max=65535, metavar="N", help="0 for any that's free.")
]
