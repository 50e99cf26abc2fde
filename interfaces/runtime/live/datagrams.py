"""Datagrams beside the stream between the sites: what fits in four crosses both ways, and the first copy counts.

A datagram is 1200 bytes at most: an id (20 bytes, in the clear and authenticated), a counter (8), and, sealed by
AES-256-GCM with a tag of 16 bytes, a cookie (8), which piece of how many it is (1 each), and that piece of a
message as it stands on the stream. Keys and id are made of a secret that the robot's site tells on the stream, new
for each connection.

A robot's site sends messages to an address only after somebody there has brought back the cookie that it had sent
there. Until then each datagram is answered by one that holds the cookie alone, the shortest that there is.
"""

from __future__ import annotations

import asyncio
import contextlib
import enum
import hashlib
import hmac
import secrets
import socket
from collections import OrderedDict
from collections.abc import Callable, Iterable
from typing import Any, Final, NamedTuple

from interfaces.rsp import header
from interfaces.rsp.session import OVERHEAD, PacketCipher, PacketDropped, hkdf
from interfaces.stream.limits import Bucket

LONGEST: Final = 1200
"""Of a datagram [byte]."""
COOKIE: Final = 8
"""Of a cookie [byte]."""
ID: Final = header.SIZE
"""Of what a connection's datagrams begin with [byte]: as long as the header that `PacketCipher` seals."""
PIECE: Final = LONGEST - ID - OVERHEAD - COOKIE - 2
"""Longest piece of a message in a datagram [byte]."""
PIECES: Final = 4
"""Pieces of a message, at most: their counters follow one another."""
ROOM: Final = PIECES * PIECE
"""Longest message that's sent in datagrams [byte]; longer ones have the stream."""
PARTIAL: Final = 16
"""Messages of which some pieces have come, that are kept."""
REMEMBERED: Final = 8192
"""Messages of which copies are known: those of over two minutes."""
ALONE: Final = 64
"""Datagrams don't get through where so many messages in a row have come by the stream alone: some two seconds'."""
RATE, BURST = 2000.0, 256.0
"""Datagrams that are looked at, a second for long and at once; the system keeps and drops what is beyond."""
BATCH: Final = 64
"""Datagrams that are read before others get their turn."""
_PAUSE: Final = 0.02
"""No more are read for so long, where too many came [s]."""
_BUFFER: Final = 65536
"""What the system keeps [byte]."""
_NONE: Final = bytes(COOKIE)
_INFO: Final = b"vrs datagrams 1"


class DatagramState(enum.StrEnum):
    """How datagrams get on."""

    OFF = "off"
    """One of the sites doesn't want them, or the robot's stream isn't as secure as it must be."""
    NONE_YET = "none yet"
    """None has come."""
    THROUGH = "through"
    BLOCKED = "blocked"
    """None gets through: all goes by the stream alone."""


class _Keys(NamedTuple):
    """Of a connection."""

    id: bytes
    to_robot: bytes
    to_operator: bytes


def _keys(secret: str) -> _Keys:
    made = hkdf(secret.encode(), b"", _INFO, ID + 64)
    return _Keys(made[:ID], made[ID : ID + 32], made[ID + 32 :])


class DatagramEnd:
    """One end of a connection's datagrams, and which messages have come there by whatever way."""

    def __init__(self, name: bytes, sending: bytes, receiving: bytes) -> None:
        self._id, self._cipher, self._count = name, PacketCipher(sending, receiving), 0
        self._known: OrderedDict[bytes, None] = OrderedDict()
        self._partial: OrderedDict[int, dict[int, bytes]] = OrderedDict()
        self._alone = 0
        self.came = 0
        """Datagrams that counted."""

    @property
    def state(self) -> DatagramState:
        """How datagrams from the other end get on."""
        if self._alone >= ALONE:
            return DatagramState.BLOCKED
        return DatagramState.THROUGH if self.came else DatagramState.NONE_YET

    def streamed(self, message: bytes) -> bool:
        """Whether a message that has come by the stream comes for the first time."""
        new = self.is_new(message)
        self._alone += new and len(message) <= ROOM
        return new

    def is_new(self, message: bytes) -> bool:
        """Whether a message comes for the first time, by whatever way."""
        key = hashlib.blake2b(message, digest_size=16).digest()
        if key in self._known:
            return False
        self._known[key] = None
        if len(self._known) > REMEMBERED:
            self._known.popitem(last=False)
        return True

    def _seal(self, cookie: bytes, message: bytes) -> list[bytes]:
        """The datagrams of a message; one without a piece where it's empty, none where it's too long."""
        pieces = -(-len(message) // PIECE)
        if pieces > PIECES:
            return []
        sealed = []
        for k in range(pieces or 1):
            self._count += 1
            body = cookie + bytes((k, pieces)) + message[k * PIECE : (k + 1) * PIECE]
            sealed.append(self._cipher.seal(self._id, body, self._count))
        return sealed

    def _open(self, datagram: bytes) -> tuple[bytes, bytes] | None:
        """The cookie of a datagram that's authentic and new, and the message if that's new and complete with it."""
        if len(datagram) > LONGEST or datagram[:ID] != self._id:
            return None
        try:
            body, count = self._cipher.open(datagram)
        except PacketDropped:
            return None
        if len(body) < COOKIE + 2 or body[COOKIE + 1] > PIECES:
            return None
        self.came, self._alone = self.came + 1, 0
        k, pieces = body[COOKIE : COOKIE + 2]
        message = self._joined(count - k, k, pieces, body[COOKIE + 2 :])
        return body[:COOKIE], message if message and self.is_new(message) else b""

    def _joined(self, first: int, k: int, pieces: int, piece: bytes) -> bytes:
        """The message that its k-th piece completes, or nothing; `first` is the counter of its first piece."""
        if pieces <= 1:
            return piece
        known = self._partial.setdefault(first, {})
        known[k] = piece
        if len(known) < pieces:
            if len(self._partial) > PARTIAL:
                self._partial.popitem(last=False)
            return b""
        del self._partial[first]
        return b"".join(known[k] for k in sorted(known))


class OperatorDatagrams(DatagramEnd):
    """The operator's end."""

    def __init__(self, secret: str) -> None:
        """Begin with the secret that the robot's site told."""
        keys = _keys(secret)
        super().__init__(keys.id, keys.to_robot, keys.to_operator)
        self._cookie = _NONE

    def seal(self, message: bytes) -> list[bytes]:
        """The datagrams of a message; none where it's too long."""
        return self._seal(self._cookie, message)

    def take(self, datagram: bytes) -> bytes:
        """The message that a datagram completes; empty where that isn't new, or the datagram doesn't count."""
        found = self._open(datagram)
        if found is None:
            return b""
        self._cookie, message = found
        return message


class RobotDatagrams(DatagramEnd):
    """The robot's end."""

    def __init__(self, secret: str) -> None:
        """Begin with a secret that's told to the operator's site."""
        keys = _keys(secret)
        super().__init__(keys.id, keys.to_operator, keys.to_robot)
        self._baking = secrets.token_bytes(32)
        self.address: Any = None
        """Where the operator's site has been proven to be; None before that."""

    def cookie(self, address: Any) -> bytes:
        """What proves that somebody is at an address."""
        return hmac.digest(self._baking, repr(address).encode(), "sha256")[:COOKIE]

    def seal(self, message: bytes) -> list[bytes]:
        """The datagrams of a message, for `address`; none where that isn't known, or the message is too long."""
        return [] if self.address is None else self._seal(self.cookie(self.address), message)

    def take(self, datagram: bytes, address: Any) -> tuple[bytes, list[bytes]]:
        """Take a datagram that came from an address.

        Returns:
            The message that it completes, empty where that isn't new, or the datagram doesn't count; and what is to
            be sent there at once.
        """
        found = self._open(datagram)
        if found is None:
            return b"", []
        shown, message = found
        cookie = self.cookie(address)
        if hmac.compare_digest(shown, cookie):
            self.address = address
            return message, []
        return message, self._seal(cookie, b"")


NO_UDP: Final = (OSError, NotImplementedError)
"""What is raised where there's no way for datagrams, or the loops of the system don't wait for them."""


def connected(address: Any) -> socket.socket:
    """A UDP socket to where a stream goes.

    Args:
        address: Of the other end, as its socket has it.

    Raises:
        OSError: If there's no way there.
    """
    sock = socket.socket(socket.AF_INET6 if ":" in address[0] else socket.AF_INET, socket.SOCK_DGRAM)
    try:
        sock.connect(address)
    except OSError:
        sock.close()
        raise
    return sock


class DatagramSocket:
    """A UDP socket in the running loop, of which no more is read a second than `RATE`."""

    def __init__(self, sock: socket.socket, take: Callable[[bytes, Any], None]) -> None:
        """Read from now on.

        Args:
            sock: Bound or connected; it's closed in the end.
            take: Is given what comes, and where from.

        Raises:
            NotImplementedError: If this system's loops don't wait for UDP; the socket is closed then.
        """
        self._loop = asyncio.get_running_loop()
        self._socket, self._take = sock, take
        sock.setblocking(False)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        self._bucket = Bucket(RATE, BURST, self._loop.time())
        self._resting: asyncio.TimerHandle | None = None
        try:
            self._read_on()
        except NotImplementedError:
            sock.close()
            raise

    def _read_on(self) -> None:
        self._resting = None
        self._loop.add_reader(self._socket, self._read)

    def _read(self) -> None:
        for _ in range(BATCH):
            if not self._bucket.take(self._loop.time()):
                self._loop.remove_reader(self._socket)
                self._resting = self._loop.call_later(_PAUSE, self._read_on)
                return
            try:
                data, address = self._socket.recvfrom(LONGEST + 1)
            except BlockingIOError:
                return
            except OSError:
                # Nobody listens where something went: said so on the next read.
                continue
            self._take(data, address)

    def send(self, datagrams: Iterable[bytes], address: Any = None) -> None:
        """Send datagrams; what the system doesn't take is lost, as on the way.

        Args:
            datagrams: What to send.
            address: Where to; None where the socket is connected.
        """
        for datagram in datagrams:
            with contextlib.suppress(OSError):
                if address is None:
                    self._socket.send(datagram)
                else:
                    self._socket.sendto(datagram, address)

    def close(self) -> None:
        """Read no more."""
        if self._resting is not None:
            self._resting.cancel()
        self._loop.remove_reader(self._socket)
        self._socket.close()
