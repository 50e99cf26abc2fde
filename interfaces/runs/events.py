"""What happened in a run, as lines for people."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from interfaces.runs.twin_run import CommandPacket, RunEvent
from interfaces.teleop import Correction
from vrs.ledger import Receipt, Status
from vrs.model import Array

NEAR = 0.3
"""Waits that are nearer than this [s] are told as one."""
LEAST = 0.02
"""A wait by which D grew less than this [s] isn't told."""
_SAME = 1e-9
"""Times nearer than this [s] are one."""


def command_events(
    packet: CommandPacket, sent: Receipt, answer: Receipt | None, *, play_at: Callable[[float], float]
) -> Iterator[RunEvent]:
    """Tell where a command was lost, late or refused at the robot.

    Args:
        packet: Its way across the link.
        sent: What the operator's engine answered.
        answer: What the robot's engine answered; None where it wasn't carried out.
        play_at: Play time of the robot at a user time [s].
    """
    command = packet.command_id
    if packet.lost:
        fate = (
            "" if packet.arrived is None else f", and came {packet.arrived - packet.sent:.3f} s after it was sent"
        )
        yield RunEvent(packet.sent, "lost", f"the message with command {command} was lost on the link{fate}")
    if answer is None or packet.arrived is None:
        return
    asked = sent.execute_at
    if answer.status is Status.REJECTED or answer.execute_at is None or asked is None:
        text = f"the real robot rejected command {command}: {answer.reason}"
        yield RunEvent(packet.arrived, "diverged", text)
    elif answer.execute_at > asked + _SAME:
        late = play_at(packet.arrived) - asked
        why = f"came {late:.3f} s too late" if late > 0 else "met a plan that had changed"
        text = f"command {command} {why}: executed at {answer.execute_at:.3f} s instead of {asked:.3f} s"
        yield RunEvent(packet.arrived, "late", text)


def waits(t: Array, play: Array, q_reference: Array, *, slowest: float) -> Iterator[RunEvent]:
    """Tell when the robot slowed down or waited, since messages were late.

    Args:
        t: User time [s], (k,), evenly spaced.
        play: Play time [s], (k,).
        q_reference: What was asked of the body [rad], (k, n).
        slowest: Pace that correcting D alone doesn't fall below.
    """
    step = float(t[1] - t[0])
    slow = np.diff(play) < (slowest - 1e-6) * step
    begun = np.flatnonzero(np.diff(play) > 0)
    slow[: begun[0] if len(begun) else len(slow)] = False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], slow, [False]]).astype(np.int8)))
    spans: list[tuple[int, int]] = []
    for low, high in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if spans and t[low] - t[spans[-1][1]] < NEAR:
            spans[-1] = spans[-1][0], high
        else:
            spans.append((low, high))
    for low, high in spans:
        grown = float((t[high] - t[low]) - (play[high] - play[low]))
        if grown < LEAST:
            continue
        moving = (q_reference[high] != q_reference[low]).any()
        what = "slowed down" if moving else "waited at rest"
        text = (
            f"messages were late: the real robot {what} until {t[high]:.2f} s, and is {grown:.3f} s further behind"
        )
        yield RunEvent(float(t[low]), "slowed" if moving else "waited", text)


def correction_events(corrections: Sequence[Correction]) -> Iterator[RunEvent]:
    """Tell when the virtual robot was put where the real one was going."""
    for made in corrections:
        yield RunEvent(made.t, "corrected", correction_text(made.end, made.error, made.reason))


def correction_text(end: float, error: Array, reason: str) -> str:
    """Say that the virtual robot was put where the real one was going.

    Args:
        end: Until when it took [s].
        error: By how much it was off [rad], (n,).
        reason: Why.
    """
    joint = int(np.abs(error).argmax())
    off = float(np.degrees(np.abs(error[joint])))
    where = f"joint {joint + 1} was {off:.3g}° off"
    return f"the virtual robot joined the real one's plan until {end:.2f} s ({where}): {reason}"
