"""A server of its own for a console: `vrs serve` as a child process, which ends with its parent."""

from __future__ import annotations

import contextlib
import os
import re
import selectors
import subprocess
import sys
from collections.abc import Iterator, Sequence
from typing import IO, Final

from vrs.errors import VrsError

START: Final = 90.0
"""Time for it to be ready [s]."""
_END: Final = 8.0
"""Time for it and its robot to come to rest and end [s]."""
_SAYS: Final = re.compile(r"vrs: serving \S+ on (http://\S+)/view\b.*")


class ServerStartError(VrsError):
    """The server couldn't be started."""

    def __init__(self, problem: str) -> None:
        self.problem = problem
        super().__init__(f"the server didn't start: {problem}")


@contextlib.contextmanager
def local_server(options: Sequence[str]) -> Iterator[str]:
    """Run `vrs serve` on a free loopback port meanwhile.

    Args:
        options: Of `vrs serve`, but for the address.

    Returns:
        Its address, `http://127.0.0.1:PORT`.

    Raises:
        ServerStartError: If it isn't ready in time.
    """
    command = [sys.executable, "-P", "-m", "interfaces.cli", "serve", "--port", "0", "--until-eof", *options]
    process = subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)},
        start_new_session=True,
    )
    try:
        assert process.stdout is not None
        yield _address(process.stdout)
    finally:
        try:
            process.communicate(timeout=_END)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


def _address(output: IO[bytes]) -> str:
    """What it says first."""
    with selectors.DefaultSelector() as selector:
        selector.register(output, selectors.EVENT_READ)
        if not selector.select(START):
            raise ServerStartError(f"it said nothing for {START:g} s")
    line = output.readline().decode(errors="replace").strip()
    found = _SAYS.fullmatch(line)
    if found is None:
        raise ServerStartError(line or "it ended at once")
    return found[1]
