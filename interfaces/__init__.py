"""Everything that joins a person or a machine to a robot."""

from interfaces.clients.designer import Designer, Supervisor
from interfaces.clients.observer import Observer
from interfaces.clients.viewer import Viewer
from interfaces.connecting import connect, connect_mobile

__all__ = ["Designer", "Observer", "Supervisor", "Viewer", "connect", "connect_mobile"]
