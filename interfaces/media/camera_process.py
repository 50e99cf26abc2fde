"""The process that draws what a camera sees: `python -m interfaces.media.camera_process DESCRIPTOR`.

It has a world of its own and never touches the robot's physics. It ends when the other end of its socket does.
"""

from __future__ import annotations

import os
import socket
import sys
from typing import BinaryIO

from interfaces.media.coding import VideoEncoder, video_encoder
from interfaces.media.messages import ORDERS, CameraView, Order, Setup, Shot, Taken, decode, encode, size_of
from interfaces.pipes import HEAD
from interfaces.system import be_nice
from robots.mobile.camera import Look, Sight, jpeg
from robots.robot import HeadCamera, load
from vrs.clock import WallClock
from vrs.errors import FormatError

NICE = 2
"""Whoever steers, and the robot's body, go before pictures."""


def run(connection: socket.socket) -> int:
    """Draw what is asked for, until the other end is closed.

    Args:
        connection: To the site; its first message is the setup.

    Returns:
        The exit status: 0, or 2 if something came that isn't a message, or the robot has no camera.
    """
    be_nice(NICE)
    orders = connection.makefile("rb")
    try:
        setup = _order(orders)
        if not isinstance(setup, Setup):
            return 0 if setup is None else 2
        robot, lens = load(setup.robot), setup.lens
        camera = robot.device(HeadCamera)
        if camera is None:
            return 2
        sight = Sight(setup.room, camera, lens, robot.appearance)
        video = video_encoder(lens.width, lens.height, setup.rate) if setup.video else None
        connection.sendall(encode(None))
        clock = WallClock()
        while isinstance(shot := _order(orders), Shot):
            connection.sendall(encode(take(shot, sight, setup.view, video, clock)))
    except FormatError:
        return 2
    except OSError:
        return 0
    return 0


def take(shot: Shot, sight: Sight, view: CameraView, video: VideoEncoder | None, clock: WallClock) -> Taken:
    """Draw a picture, and encode it as it's wanted."""
    began = clock.now()
    if view is CameraView.OVERHEAD:
        picture = sight.above(shot.posture, shot.t)
    else:
        draw = sight.both if view is CameraView.BOTH else sight.draw
        picture = draw(shot.posture, Look(*shot.look), shot.t)
    frame, key = (b"", False) if video is None else video(picture, shot.key)
    still = jpeg(picture) if shot.still else b""
    return Taken(shot.number, frame, key, still, clock.now() - began)


def _order(orders: BinaryIO) -> Order | None:
    """The next message; None where the other end is closed.

    Raises:
        FormatError: If it's none.
    """
    head = orders.read(HEAD)
    return None if len(head) < HEAD else decode(orders.read(size_of(head)), ORDERS)


if __name__ == "__main__":
    with socket.socket(fileno=int(sys.argv[1])) as _connection:
        _status = run(_connection)
    # Nothing is left to tidy up: the renderer goes with the process.
    os._exit(_status)
