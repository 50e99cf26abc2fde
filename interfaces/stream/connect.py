"""The four interfaces of a robot that a server serves, for `interfaces.connect`."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from interfaces.clients.viewer import ShownFrame
from interfaces.messages import ViewForm
from interfaces.stream.client import ClientCore
from interfaces.stream.codec import Encoding
from interfaces.stream.control import Role, State, Welcome
from interfaces.stream.joining import RobotConnection
from interfaces.stream.remote import RemoteDesigner, RemoteObserver, RemoteSupervisor, RemoteViewer


class Connection(RobotConnection[ClientCore]):
    """An arm that a server serves."""

    def __init__(
        self,
        url: str,
        *,
        role: Role = Role.OPERATOR,
        token: str | None = None,
        name: str = "client",
        encoding: Encoding = Encoding.MSGPACK,
        timeout: float = 5.0,
    ) -> None:
        """Connect; see `interfaces.connect`."""
        super().__init__(ClientCore, url, role=role, token=token, name=name, encoding=encoding, timeout=timeout)
        self.designer = RemoteDesigner(self._session)
        """Issues commands; they need the lease."""
        self.observer = RemoteObserver(self._session)
        """Asks for positions."""
        self.supervisor = RemoteSupervisor(self.designer, self.observer)
        """Both."""
        self._add(self._session, self.designer)
        self._add(self._session, self.observer)

    def viewer(
        self,
        *,
        rate: float = 50.0,
        form: ViewForm = ViewForm.SEGMENTS,
        show: Callable[[ShownFrame], None] | None = None,
    ) -> RemoteViewer:
        """A viewer, on a connection of its own.

        Args:
            rate: Frames to show a second, 0.1 to 1000.
            form: What crosses.
            show: Is called with each frame, in another thread: to be quick.

        Raises:
            UnreachableError: If the connection doesn't come about.
            InvalidValueError: If rate is out of range.
        """
        session = self._open(Role.VIEWER)
        viewer = RemoteViewer(session, rate=rate, form=ViewForm(form), show=show, end=partial(self._end, session))
        self._add(session, viewer)
        return viewer

    @property
    def state(self) -> State | None:
        """The real robot as it was last heard of; None before that."""
        return self._session.core.state

    @property
    def welcome(self) -> Welcome:
        """What the server said of itself and its robot."""
        welcome = self._session.core.welcome
        assert isinstance(welcome, Welcome)
        return welcome
