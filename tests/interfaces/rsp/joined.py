"""Two cores joined in memory by a bad network, watched by a model of what must be true."""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from random import Random

from interfaces.rsp.local import LocalCore, LocalState
from interfaces.rsp.model import RobotModel
from interfaces.rsp.outbox import DeliveryOutcome, Settled
from interfaces.rsp.outputs import Commanded, Occurred, RobotChange, Stored
from interfaces.rsp.robot import RobotCore
from interfaces.rsp.session import Keyring, PacketRoundTrip, Rank

ADDRESS = b"local"
KEYS = Keyring({Rank.OPERATOR: b"o" * 32, Rank.ADMIN: b"a" * 32})


@dataclass
class Network:
    """What happens to datagrams; times in seconds."""

    random: Random
    loss: float = 0.0
    duplicate: float = 0.0
    delay: float = 0.01
    jitter: float = 0.0
    silences: tuple[tuple[float, float], ...] = ()
    flight: list[tuple[float, int, str, bytes]] = field(default_factory=list)
    sent: int = 0
    closed: bool = False

    def send(self, to: str, data: bytes, now: float) -> None:
        self.sent += 1
        if self.closed or any(a <= now < b for a, b in self.silences):
            return
        copies = 2 if self.random.random() < self.duplicate else 1
        for k in range(copies):
            if self.random.random() >= self.loss:
                at = now + self.delay + self.jitter * self.random.random()
                heapq.heappush(self.flight, (at, 2 * self.sent + k, to, data))


class Pair:
    """A local system and a robot."""

    def __init__(self, model: RobotModel, network: Network, *, sealed: bool = False, seed: int = 0, **configs):
        random, keys = Random(seed), KEYS if sealed else None
        self.network = network
        self.local = LocalCore(model, random.randbytes, configs.get("local"), keys=keys)
        self.robot = RobotCore(model, random.randbytes, configs.get("robot"), keys=keys)
        self.now = 0.0
        self.told: list[object] = []
        self.did: list[object] = []

    def opened(self, *, within: float = 5.0, takeover: bool = False) -> Pair:
        self.local.open(now=self.now, takeover=takeover)
        self.until(lambda: self.local.state is LocalState.OPEN and self.robot.session is not None, within)
        return self

    def count_from(self, number: int) -> None:
        """Let both sides' numbers go on from another one: near to where they go round."""
        local, robot = self.local.numbers, self.robot.claim.session
        self.network.flight.clear()
        local.number, robot.number = number, number + 7
        robot.newest, local.newest = number - 1, number + 6
        self.local.packet_round_trip, self.robot.packet_round_trip = PacketRoundTrip(), PacketRoundTrip()

    def until(self, condition, within: float) -> None:
        end = self.now + within
        while not condition():
            assert self.now < end, "it didn't happen in time"
            self.step()

    def run(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.step()

    def step(self) -> None:
        """Go on to what is due next."""
        due = [self.now + 0.1]
        if self.network.flight:
            due.append(self.network.flight[0][0])
        due += [t for t in (self.local.next_deadline(), self.robot.next_deadline()) if t is not None]
        self.now = now = max(self.now, min(due))
        while self.network.flight and self.network.flight[0][0] <= now:
            _, _, to, data = heapq.heappop(self.network.flight)
            if to == "robot":
                self.robot.receive(data, ADDRESS, now=now)
            else:
                self.local.receive(data, now=now)
        for data in self.local.to_send(now=now):
            self.network.send("robot", data, now)
        for data, address in self.robot.to_send(now=now):
            assert address == ADDRESS
            self.network.send("local", data, now)
        self.told += self.local.take()
        self.did += self.robot.take()


class Judge:
    """The model: what was given, and what became of it."""

    def __init__(self, pair: Pair) -> None:
        self.pair = pair
        self.commands: list[int] = []
        self.stores: dict[int, float] = {}
        self.events: dict[int, float] = {}
        self.executed: list[int] = []
        self.stored: list[int] = []
        self.logged: list[int] = []
        self.outcomes: dict[tuple[str, int], DeliveryOutcome] = {}
        self.lost = self.occurred = 0

    def look(self) -> None:
        """Take what happened and hold it against the rules."""
        pair = self.pair
        for output in pair.did:
            if isinstance(output, Commanded):
                assert not self.executed or output.id > self.executed[-1], "a command after a newer one, or twice"
                assert output.payload == value(output.id)
                self.executed.append(output.id)
            elif isinstance(output, Stored):
                assert not self.stored or output.id > self.stored[-1], "out of order, or twice"
                assert output.data == value(output.id) * (output.id % 50)
                self.stored.append(output.id)
            elif isinstance(output, Settled):
                self._settled("memory event", output, self.events)
            elif output is RobotChange.LINK_LOST:
                self.lost += 1
        for output in pair.told:
            if isinstance(output, Settled):
                if pair.local.model.elements[output.index].name.startswith("program"):
                    self._settled("memory command", output, self.stores)
                else:
                    assert output.outcome is DeliveryOutcome.DONE
                    assert output.id in self.executed[-5000:], "acknowledged, but not executed"
                    self._settled("command", output, None)
            elif isinstance(output, Stored):
                assert not self.logged or output.id > self.logged[-1]
                self.logged.append(output.id)
            elif isinstance(output, Occurred):
                self.occurred += 1
        pair.did.clear()
        pair.told.clear()

    def _settled(self, kind: str, output: Settled, deadlines: dict[int, float] | None) -> None:
        assert (kind, output.id) not in self.outcomes, "settled twice"
        self.outcomes[kind, output.id] = output.outcome
        if deadlines is not None and output.outcome is DeliveryOutcome.FAILED:
            due = deadlines[output.id]
            assert due <= self.pair.now <= due + 0.25, f"due {due}, reported {self.pair.now}"

    def conclude(self) -> None:
        """All is settled; what was said to be done was done."""
        assert self.executed == self.commands
        for kind, given, got in (
            ("memory command", self.stores, self.stored),
            ("memory event", self.events, self.logged),
        ):
            done = [number for number in given if self.outcomes[kind, number] is DeliveryOutcome.DONE]
            assert set(done) <= set(got)
            assert set(got) <= set(given)
            assert len(got) == len(set(got))


def value(number: int) -> bytes:
    """What an item of a number carries."""
    return bytes([number % 251])


def talk(pair: Pair, judge: Judge, random: Random, packets: int) -> None:
    """Give commands, memory items and events at random until so many packets were sent; then let all be settled."""
    local, robot, model = pair.local, pair.robot, pair.local.model
    commands = [i for i, e in enumerate(model) if e.name.startswith("ir_fire")]
    programs = [i for i, e in enumerate(model) if e.name.startswith("program")]
    logs = [i for i, e in enumerate(model) if e.name.startswith("log")]
    bumper = model.index("bumper")
    local.request(bumper, True)
    wheel = model.index("left_wheel")
    while pair.network.sent < packets:
        pair.step()
        judge.look()
        chance = random.random()
        if chance < 0.1 and len(judge.commands) - len(judge.executed) < 200:
            number = local.command(random.choice(commands), value(len(judge.commands)))
            judge.commands.append(number)
        elif chance < 0.13 and len(local.memory_outbox) < 50:
            deadline = pair.now + random.choice((0.05, 0.5, 2.0, 15.0))
            data = value(len(judge.stores)) * (len(judge.stores) % 50)
            judge.stores[local.store(random.choice(programs), data, deadline=deadline)] = deadline
        elif chance < 0.15 and len(robot.memory_outbox) < 50 and robot.session:
            deadline = pair.now + random.choice((0.05, 0.5, 2.0, 15.0))
            judge.events[robot.store(random.choice(logs), b"!" * random.randrange(256), deadline=deadline)] = (
                deadline
            )
        elif chance < 0.17:
            robot.occur(bumper, b"\1")
        elif chance < 0.3:
            local.write(wheel, random.randrange(500).to_bytes(2, "big"))
    pair.network.loss, pair.network.silences = 0.1, ()
    end = pair.now + 300.0
    while pair.now < end and (len(local.command_outbox) or len(local.memory_outbox) or len(robot.memory_outbox)):
        pair.step()
        judge.look()
