"""What stands at an operator's site beside the robots' motion: a list of jobs, a camera, a recording."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractAsyncContextManager, nullcontext
from typing import Any

from starlette.routing import BaseRoute
from typing_extensions import override

from interfaces.media import CameraConfig, LiveMedia, MediaDoor
from interfaces.runtime.live.base_twins import BaseTwins
from interfaces.stream.access import Access
from interfaces.stream.hub import Hub
from robots.rooms import Room
from vrs.clock import Clock


class OperatorDevice:
    """One of those. What it doesn't do is done nothing about."""

    name: str
    """Of it, in `/health`."""
    routes: Sequence[BaseRoute] = ()
    """What it answers."""

    def running(self) -> AbstractAsyncContextManager[object]:
        """What runs as long as the site does."""
        return nullcontext()

    def turn(self) -> None:
        """Take in what is new, whenever the site has its turn."""

    def health(self) -> Any:
        """How it is, for `/health`; None where it isn't there."""


class MediaDevice(OperatorDevice):
    """Camera, voice and screen of a mobile robot."""

    name = "media"

    def __init__(
        self, config: CameraConfig | None, room: Room, twins: BaseTwins, hub: Hub, clock: Clock, access: Access
    ) -> None:
        """Wait for pages.

        Args:
            config: The camera; None where there's none, nor voice and screen.
            room: Where the robot is.
            twins: Where, and what it has to say.
            hub: Who has control.
            clock: Session time.
            access: Who may look and listen.
        """
        self._twins = twins
        self.media: LiveMedia | None = None
        """What sees, speaks and shows; None without a camera."""
        if config is not None:
            self.media = LiveMedia(
                config, room, clock, stand=twins.stand, screen=twins.scene.say,
                commands=lambda session, epoch: hub.commands(session, epoch, now=clock.now()),
            )  # fmt: skip
            self.routes = MediaDoor(self.media, access).routes

    @override
    def running(self) -> AbstractAsyncContextManager[object]:
        return nullcontext() if self.media is None else self.media.running()

    @override
    def turn(self) -> None:
        tasks = self._twins.operator.robot.tasks
        if self.media is not None and tasks is not None:
            self.media.presenter.follow(tasks.says, tasks.shows)

    @override
    def health(self) -> dict[str, Any] | None:
        return None if self.media is None else self.media.health()
