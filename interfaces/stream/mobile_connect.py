"""A mobile robot that a server serves, for `interfaces.connect_mobile`."""

from __future__ import annotations

from interfaces.clients.designer import Issued
from interfaces.jobs import Forecast, JobList, ListCommand, Load
from interfaces.stream.client import MobileCore, Replied
from interfaces.stream.codec import Encoding
from interfaces.stream.control import Problem, ProblemCode, Role
from interfaces.stream.joining import ELSE, RobotConnection
from interfaces.stream.mobile import MobileWelcome, Plan, Postures, Seen, TaskOrder, Tasks, Trial, Wanted
from interfaces.stream.remote import RemoteDesigner
from interfaces.teleop.tasks import Doing, Go
from robots.onboard.journey import Goal
from vrs.commands import DriveCommand, Stop


class MobileConnection(RobotConnection[MobileCore]):
    """Drives a mobile robot, sends it to goals, and lets it do jobs."""

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
        """Connect; see `interfaces.connect_mobile`."""
        super().__init__(MobileCore, url, role=role, token=token, name=name, encoding=encoding, timeout=timeout)
        self._designer = RemoteDesigner(self._session)
        self._add(self._session, self._designer)

    def drive(self, v: float, w: float, *, wait: float = 0.0) -> Issued:
        """Drive for a moment; who doesn't say so again stops. It ends what the robot does by itself.

        Args:
            v: Linear speed [m/s].
            w: Angular speed [rad/s].
            wait: How long to wait for the answer [s].

        Returns:
            What is known of it; a `refusal` says why it isn't carried out.
        """
        return self._designer.issue(DriveCommand(v, w, self.welcome.holds), wait=wait)

    def stop(self, *, wait: float = 0.0) -> Issued:
        """Stop both robots, and what the real one does by itself."""
        return self._designer.issue(Stop(), wait=wait)

    def go(self, goal: Goal, *, wait: float = 5.0) -> Tasks | Problem:
        """Send the robot to a goal.

        Args:
            goal: Where to.
            wait: How long to wait for the answer, not for the robot [s].

        Returns:
            What it does then; or why not.
        """
        return self._ask(Go(goal), wait)

    def load(self, jobs: JobList, *, wait: float = 5.0) -> Tasks | Problem:
        """Put a list of jobs in the place of the one that's there; see `go`."""
        return self._ask(Load(jobs), wait)

    def do(self, command: ListCommand, *, wait: float = 5.0) -> Tasks | Problem:
        """Run, pause, resume or abort the list, or press the key; see `go`."""
        return self._ask(command, wait)

    def dry_run(self, *, wait: float = 30.0) -> Forecast | Problem:
        """Ask how long the list is likely to take; the virtual robot alone tries it."""
        answer = self._ask(Trial.DRY_RUN, wait)
        if isinstance(answer, Problem):
            return answer
        self.wait(lambda _: self.tasks is not None and self.tasks.forecast is not None, wait)
        tasks = self.tasks
        if tasks is None or tasks.forecast is None:
            return Problem(ProblemCode.STOPPING, f"no forecast within {wait:g} s")
        return tasks.forecast

    def finished(self, timeout: float) -> bool:
        """Wait until the robot does nothing by itself any more, or the time [s] is over; whether that's so."""
        return self.wait(lambda _: self.tasks is not None and self.tasks.doing is Doing.NOTHING, timeout)

    def _ask(self, wanted: Wanted, wait: float) -> Tasks | Problem:
        answer: Replied = self._wish(lambda number, epoch: TaskOrder(number, epoch, wanted), wait)
        return answer if isinstance(answer, Tasks | Problem) else ELSE

    @property
    def postures(self) -> Postures | None:
        """Where both robots are; None before that was told."""
        return self._session.core.postures

    @property
    def tasks(self) -> Tasks | None:
        """What the robot does by itself; None before that was told."""
        return self._session.core.tasks

    @property
    def seen(self) -> Seen | None:
        """What it sees; None before that was told."""
        return self._session.core.seen

    @property
    def plan(self) -> Plan | None:
        """The known map; None before that was told."""
        return self._session.core.plan

    @property
    def welcome(self) -> MobileWelcome:
        """What the server said of itself and its robot."""
        welcome = self._session.core.welcome
        assert isinstance(welcome, MobileWelcome)
        return welcome
