"""A PyBullet world of its own: one client in DIRECT mode, closed when its context ends."""

from __future__ import annotations

import os
import sys
from types import ModuleType, TracebackType
from typing import Any, Self

from vrs.errors import VrsError


class WorldClosedError(VrsError):
    """A PyBullet world used after it was closed."""

    def __init__(self) -> None:
        super().__init__("this PyBullet world is closed: make a new one")


def load_pybullet() -> Any:
    """Import PyBullet without the build date that its C++ part writes to descriptor 2."""
    if isinstance(loaded := sys.modules.get("pybullet"), ModuleType):
        return loaded
    sys.stderr.flush()
    saved = os.dup(2)
    try:
        with open(os.devnull, "wb") as sink:
            os.dup2(sink.fileno(), 2)
        import pybullet
    finally:
        os.dup2(saved, 2)
        os.close(saved)
    return pybullet


class World:
    """A PyBullet client, empty but for gravity and a time step. Several live side by side in a process."""

    def __init__(self, *, gravity: float, dt: float) -> None:
        """Connect a client with free fall along -z [m/s²] and a fixed step [s]."""
        self.bullet = load_pybullet()
        self._gravity, self._dt = gravity, dt
        self._client: int | None = self.bullet.connect(self.bullet.DIRECT)
        self.clear()

    @property
    def client(self) -> int:
        """PyBullet's id of this world.

        Raises:
            WorldClosedError: If it is closed.
        """
        if self._client is None:
            raise WorldClosedError
        return self._client

    @property
    def closed(self) -> bool:
        """Whether the client is disconnected."""
        return self._client is None

    def clear(self) -> None:
        """Remove every body, and with them PyBullet's cached trees, which never see a changed mass."""
        self.bullet.resetSimulation(physicsClientId=self.client)
        self.bullet.setGravity(0.0, 0.0, -self._gravity, physicsClientId=self.client)
        self.bullet.setTimeStep(self._dt, physicsClientId=self.client)

    def close(self) -> None:
        """Disconnect; a second call does nothing."""
        if self._client is not None:
            self.bullet.disconnect(physicsClientId=self._client)
            self._client = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
