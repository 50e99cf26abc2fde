"""Section IV-B, Fig. 10: the size of packets with and without music, and what it saves against a fixed size."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from interfaces.lab.claims import OWN_BAR, Claim, Figure, Findings, Results, Study, Table, above, all_of, at_most
from interfaces.lab.kim2006.following import TICK, cubo_model, plays
from interfaces.lab.kim2006.schemes import FIXED_DOWN, PlainLocal
from interfaces.lab.output import GOOD, INK, MUTED, REAL, VIRTUAL, draw, legend
from interfaces.rsp import header
from interfaces.rsp.header import PacketType
from interfaces.rsp.local import LocalConfig, LocalCore, LocalState, PeriodConfig
from interfaces.rsp.robot import RobotCore

LENGTH: Final = 120.0
"""Of the paper's experiment [s]."""
SMALL: Final = 34
"""A packet with lip and arms [byte]."""
LARGE: Final = 1992
"""A packet with music, too [byte]."""
SAVING: Final = 38.65
"""What the paper saves [%]."""
DUTY: Final = 1.0 - SAVING / 100.0 * LARGE / (LARGE - SMALL)
"""Share of the time in which music plays that gives that saving: 0.6068."""
DUTIES: Final = (0.0, 0.1, 0.25, 0.4, DUTY, 0.75, 0.9, 1.0)
CURVE: Final = 12.0
"""Length of the runs for the curve [s]."""
SOURCE: Final = "Section IV-B, Fig. 10"


def perform(length: float, duty: float) -> Results:
    """Let CUBO move lip and arms for a time [s], with music for a share of it; the link is perfect."""
    model, rng = cubo_model(), np.random.default_rng(5)
    local = LocalCore(model, rng.bytes, LocalConfig(period=PeriodConfig(least=TICK, adaptive=False)))
    robot = RobotCore(model, rng.bytes)
    lip, speaker = model.index("lip"), model.index("speaker")
    arms = model.index("left_arm"), model.index("right_arm")
    local.open(now=0.0)
    while local.state is not LocalState.OPEN:
        _exchange(local, robot, 0.0)
    local.request(model.index("position"), True)
    for index in (lip, *arms):
        local.activate(index, True)
    t: list[float] = []
    sizes: list[int] = []
    for k in range(round(length / TICK)):
        now = k * TICK
        local.write(lip, bytes((k * 7 % 256, 128 + k % 64, 0)))
        for index, phase in zip(arms, (0.0, math.pi), strict=True):
            angle = round(1000 * math.sin(math.tau * 0.5 * now + phase))
            local.write(index, angle.to_bytes(2, "big", signed=True) + (2000).to_bytes(2, "big"))
        if plays(now, length, duty):
            local.play(speaker, bytes(model.elements[speaker].stream))  # type: ignore[union-attr]
        for size in _exchange(local, robot, now):
            t.append(now)
            sizes.append(size)
        robot.streams.take(speaker)
    return Results(
        t=t,  # when packets went down [s]
        sizes=sizes,  # theirs [byte]
        missing=robot.streams.missing,  # fragments that the robot never had
        overflowed=robot.streams.overflowed,  # fragments for which it had no buffer
    )


def _exchange(local: LocalCore, robot: RobotCore, now: float) -> list[int]:
    """Pass packets both ways at once; returns the sizes of those with devices for the robot."""
    sizes = []
    for data in local.to_send(now=now):
        if header.decode(data).type is PacketType.DOWN:
            sizes.append(len(data))
        robot.receive(data, b"local", now=now)
    for data, _ in robot.to_send(now=now):
        local.receive(data, now=now)
    return sizes


def saving(sizes: list[int], fixed: int = LARGE) -> float:
    """What packets of these sizes save against packets of one size [%]."""
    return 100.0 * (1.0 - sum(sizes) / (fixed * len(sizes)))


def perform_fixed(length: float) -> list[int]:
    """Sizes of the packets of one size that go down in a time [s], whatever plays [byte]."""
    local = PlainLocal(1, FIXED_DOWN)
    return [len(data) for k in range(round(length / TICK)) for data in local.to_send(now=k * TICK)]


def work(_study: Study, _case: str) -> Findings:
    """The experiment, packets of one size beside it, and the curve."""
    found, fixed = perform(LENGTH, DUTY), perform_fixed(CURVE)
    kinds = sorted(set(found.sizes))
    share = found.sizes.count(LARGE) / len(found.sizes)
    measured = saving(found.sizes)
    curve = [
        (duty, saving(perform(CURVE, duty).sizes), 100 * (LARGE - SMALL) * (1 - duty) / LARGE) for duty in DUTIES
    ]
    off = max(abs(saved - formula) for _, saved, formula in curve)
    other = max(abs(saving(fixed) - formula) for _, _, formula in curve)
    one = "packets of one size"
    music = f"music for {100 * share:.2f} % of the time"
    claims = (
        above(f"saving against packets of {LARGE} bytes, {music} [%]", SOURCE, 0, measured, (one, saving(fixed))),
        all_of("sizes that occur: without music, and with it", SOURCE, len(kinds), 2, (one, len(set(fixed)))),
        _fitted("packets with lip and arms [byte]: CUBO's elements are fitted to it", SMALL, kinds[0], 0),
        _fitted("packets with music [byte]: CUBO's elements are fitted to it", LARGE, kinds[-1], 0),
        _fitted(f"the same saving [%]: its {music} is fitted to it", SAVING, measured, 0.5),
        at_most(
            "saving against share of music: largest deviation from (1992 − 34)(1 − f)/1992 [%]",
            f"{SOURCE}; {OWN_BAR}", 0.5, off, (one, other),
        ),
    )  # fmt: skip
    columns = ("music, share of the time", "saving measured [%]", "saving by the formula [%]")
    table = Table("saving", "What variable packet size saves", columns, tuple(curve))
    return Findings(claims, (table,), (_sizes(found), _curve(curve, share, measured)))


def _fitted(what: str, expected: float, measured: float, slack: float) -> Claim:
    """A figure of the paper to which something of ours was fitted: that it comes out shows nothing."""
    return Claim(what, SOURCE, expected, measured, abs(measured - expected) <= slack)


def _sizes(found: Results) -> Figure:
    def paint(canvas: Any) -> None:
        ax = canvas.add_subplot()
        ax.step(found.t, found.sizes, where="post", color=VIRTUAL, linewidth=1.0)
        ax.axhline(LARGE, color=MUTED, linestyle=":", linewidth=1.0, label="fixed size")
        ax.set(xlabel="time [s]", ylabel="packet to the robot [byte]", ylim=(0, 2200), xlim=(0, LENGTH))
        ax.set_title(f"Packets of {SMALL} bytes (A: lip and arms) and {LARGE} bytes (B: with music)")
        legend(ax, place="lower right")

    return draw("packet_sizes", "Variable packet size, Fig. 10", paint)


def _curve(curve: list[tuple[float, float, float]], share: float, measured: float) -> Figure:
    def paint(canvas: Any) -> None:
        ax = canvas.add_subplot()
        duty = [100 * point[0] for point in curve]
        ax.plot(duty, [point[2] for point in curve], color=MUTED, label="(1992 − 34)(1 − f)/1992")
        ax.plot(duty, [point[1] for point in curve], "o", color=VIRTUAL, markersize=5, label="measured")
        ax.plot([100 * share], [measured], "o", color=REAL, markersize=8, label="120 s, as the paper's")
        ax.axhline(SAVING, color=GOOD, linestyle=":", linewidth=1.0, label=f"the paper's {SAVING} %")
        ax.set(xlabel="music, share of the time [%]", ylabel="saved [%]", xlim=(0, 100), ylim=(0, 100))
        ax.set_title("What is saved against packets of 1992 bytes", color=INK)
        legend(ax)

    return draw("saving", "Saving against duty", paint)
