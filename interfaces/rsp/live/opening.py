"""Sessions for programs: a middleware on a socket, with the random bytes and keys that it needs."""

from __future__ import annotations

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from interfaces.rsp.live.link import UdpLink
from interfaces.rsp.local import MOST_PATIENCE, LocalConfig, LocalCore
from interfaces.rsp.middleware import Middleware
from interfaces.rsp.model.robot_model import RobotModel
from interfaces.rsp.security import Keyring, Rank
from interfaces.stream.access import read_tokens
from interfaces.stream.control import Role
from vrs.checks import finite
from vrs.clock import WallClock
from vrs.errors import FormatError

_RANKS = {Role.OPERATOR: Rank.OPERATOR, Role.ADMIN: Rank.ADMIN}


def read_keys(path: Path) -> Keyring:
    """The keys of a token file: its operator's and its admin's tokens.

    Raises:
        FormatError: If it can't be read, others may read it, or it has neither.
    """
    return keys_of(read_tokens(path), path)


def keys_of(tokens: dict[Role, str], path: Path) -> Keyring:
    """The keys of tokens from a file.

    Raises:
        FormatError: If there's neither an operator's nor an admin's.
    """
    found = {_RANKS[role]: token.encode("ascii") for role, token in tokens.items() if role in _RANKS}
    if not found:
        raise FormatError(f"token file {path}", "it has no token of an operator or an admin")
    return Keyring(found)


@contextmanager
def opened(
    model: RobotModel,
    address: str,
    *,
    key_file: Path | None = None,
    timeout: float = 5.0,
    takeover: bool = False,
    config: LocalConfig | None = None,
) -> Iterator[Middleware]:
    """Have a session with a robot meanwhile.

    Args:
        model: Of the robot.
        address: Where it listens, HOST:PORT.
        key_file: A token file; packets are sealed with it. Without one all is in the clear.
        timeout: For the session to open [s]; it's asked for as long.
        takeover: Whether another's session is to end for it; that opens as admin where there are keys.
        config: How packets are sent.

    Raises:
        DeadlineError: If nothing answers in time.
        NoSessionError: If the robot gives no session.
        FormatError: If the address can't be resolved or the file read.
        InvalidValueError: If the timeout isn't finite.
    """
    keys = None if key_file is None else read_keys(key_file)
    rank = Rank.ADMIN if keys is not None and (takeover or Rank.OPERATOR not in keys) else Rank.OPERATOR
    clock = WallClock()
    config = LocalConfig() if config is None else config
    patience = max(config.patience, min(finite("timeout", timeout, "finite seconds"), MOST_PATIENCE))
    core = LocalCore(model, secrets.token_bytes, replace(config, patience=patience), keys=keys, rank=rank)
    with UdpLink(Middleware(core, clock), address, clock=clock).open(timeout=timeout, takeover=takeover) as link:
        yield link.middleware
