"""Messages of the four interfaces' clients, on the wire."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta
from typing_extensions import override

from interfaces.messages import Ask, Follow, Order, ViewForm, Want
from interfaces.wire.commands import CommandWire, command_wire
from interfaces.wire.fields import Count, Epoch, Message, Number, Time, digits, epoch

Rate = Annotated[float, Meta(gt=0, le=1e4)]


class OrderWire(Message, frozen=True, omit_defaults=True, gc=False, tag="order"):
    """`Order`."""

    number: Number
    command: CommandWire | None = None
    epoch: Epoch | None = None

    @override
    @classmethod
    def of(cls, value: Order, packed: bool) -> OrderWire:
        return cls(value.number, command_wire(value.command, packed), digits(value.epoch))

    def read(self) -> Order:
        """The order."""
        command = None if self.command is None else self.command.read()
        return Order(self.number, command, epoch(self.epoch))


class AskWire(Message, frozen=True, omit_defaults=True, gc=False, tag="ask"):
    """`Ask`."""

    number: Number
    t: Time | None = None

    def read(self) -> Ask:
        """The question."""
        return Ask(self.number, self.t)


class FollowWire(Message, frozen=True, omit_defaults=True, gc=False, tag="follow"):
    """`Follow`."""

    number: Number
    form: ViewForm
    rate: Rate | None = None

    def read(self) -> Follow:
        """The wish."""
        return Follow(self.number, self.form, self.rate)


class WantWire(Message, frozen=True, omit_defaults=True, gc=False, tag="want"):
    """`Want`."""

    edit: Count
    index: Count | None = None

    def read(self) -> Want:
        """The wish."""
        return Want(self.edit, self.index)
