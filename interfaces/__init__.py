"""Everything that joins a person or a machine to a robot."""

from interfaces.connecting import connect, connect_mobile
from interfaces.designer import Designer
from interfaces.observer import Observer
from interfaces.supervisor import Supervisor
from interfaces.viewer import Viewer

__all__ = ["Designer", "Observer", "Supervisor", "Viewer", "connect", "connect_mobile"]
