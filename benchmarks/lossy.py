"""Two network namespaces of this process, joined by what loses and delays packets between their kernels.

Each has a TUN device; a child process carries IP packets from one to the other. TCP is the system's own, at both
ends.
"""

from __future__ import annotations

import contextlib
import ctypes
import heapq
import os
import select
import signal
import struct
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from random import Random
from typing import TypeVar

from interfaces.system import hasten

OPERATOR, ROBOT = "10.213.58.1", "10.213.58.2"
"""Addresses; they exist in the namespaces alone."""
_NEWNET = 0x40000000
_TUNSETIFF = 0x400454CA
_TUN_PLAIN = 0x1001
_MOST = 4096
_PACKET = 65535
_libc = ctypes.CDLL(None, use_errno=True)

T = TypeVar("T")


class NamespaceError(Exception):
    """This machine makes no network namespaces for whoever asks."""


def _enter_new(name: str, mine: str, theirs: str) -> int:
    """Put this thread into a namespace of its own, with a TUN device between two addresses; that device."""
    import fcntl

    if _libc.unshare(_NEWNET):
        raise NamespaceError(os.strerror(ctypes.get_errno()))
    try:
        tun = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
        fcntl.ioctl(tun, _TUNSETIFF, struct.pack("16sH22x", name.encode(), _TUN_PLAIN))
        for step in (f"addr add {mine} peer {theirs} dev {name}", f"link set {name} up", "link set lo up"):
            subprocess.run(["ip", *step.split()], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as error:
        raise NamespaceError(str(error)) from None
    return tun


def _in_thread(work: Callable[[], T]) -> T:
    """Do something in a thread of its own, whose namespace is its own, too."""
    done: list[T] = []
    failed: list[Exception] = []

    def run() -> None:
        try:
            done.append(work())
        except Exception as error:  # noqa: BLE001 - raised again where it's waited for
            failed.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    if failed:
        raise failed[0]
    return done[0]


@contextlib.contextmanager
def lossy_kernels(listen: Callable[[], T], loss: float, delay: float, seed: int) -> Iterator[T]:
    """Put this thread into the operator's namespace, and carry packets to the robot's and back meanwhile.

    Args:
        listen: Makes what is wanted of the robot's, called there.
        loss: Share of packets lost, each by itself.
        delay: Of each packet, one way [s].
        seed: Of the losses.

    Returns:
        What `listen` made.

    Raises:
        NamespaceError: If there are none for this process.
    """
    robot, made = _in_thread(lambda: (_enter_new("vrs-r", ROBOT, OPERATOR), listen()))
    operator = _enter_new("vrs-o", OPERATOR, ROBOT)
    child = os.fork()
    if not child:
        try:
            hasten(2)
            _carry({operator: robot, robot: operator}, loss, delay, Random(seed))  # noqa: S311
        finally:
            os._exit(0)
    try:
        yield made
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(operator)
        os.close(robot)


def _carry(ways: dict[int, int], loss: float, delay: float, random: Random) -> None:
    """Carry packets from each device to the other, until this process ends."""
    flight: list[tuple[float, int, int, bytes]] = []
    count = 0
    while True:
        wait = None if not flight else max(0.0, flight[0][0] - time.monotonic())
        for device in select.select(list(ways), (), (), wait)[0]:
            packet = os.read(device, _PACKET)
            count += 1
            if random.random() >= loss and len(flight) < _MOST:
                heapq.heappush(flight, (time.monotonic() + delay, count, ways[device], packet))
        now = time.monotonic()
        while flight and flight[0][0] <= now:
            _, _, device, packet = heapq.heappop(flight)
            with contextlib.suppress(BlockingIOError):
                os.write(device, packet)
