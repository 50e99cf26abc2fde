"""A schedule is changed after it was made: another time, a via passed without a stop, another pace, a stop."""

from __future__ import annotations

import numpy as np

from robots import puma560
from vrs import Engine, Insertion, JointTarget, ManualClock, MotionCommand

model = puma560.model()
clock = ManualClock(0.0)
engine = Engine(model, q=model.poses["nominal"], clock=clock)
places = np.radians([[60, 60, -170, 0, 30, 0], [-30, 70, -150, 0, 40, 0], [10, 40, -120, 20, 30, 60]])
engine.execute(MotionCommand(JointTarget(places[0]), execute_at=0.5))
engine.execute(MotionCommand(JointTarget(places[1]), execute_at=3.0))
engine.execute(MotionCommand(JointTarget(places[2]), insertion=Insertion.APPEND))


def show(what: str) -> None:
    """Print when the moves are to be made that still stand."""
    moves = [r for r in engine.receipts[:3] if r.stands]
    print(f"{what:36s} {', '.join(f'{r.command_id}: {r.execute_at:.2f} to {r.end:.2f} s' for r in moves)}")


show("as it was planned")
engine.retime(2, 3.5)
show("2 half a second later, 3 follows")
receipt = engine.insert_via(2, JointTarget(0.5 * (places[0] + places[1]) + [0, 0.3, 0, 0, 0, 0]), deviation=0.03)
show("2 by a via, without a stop")
print(f"    {receipt.reason}")
clock.set(0.8)
engine.scale_time(0.5)
show("from 0.8 s on at half the pace")
clock.set(1.2)
stop = engine.stop()
print(f"stop at 1.2 s: {stop.reason}, at rest at {stop.end:.3f} s")
clock.set(5.0)
engine.resume()
show("resumed at 5 s")
engine.cancel(2)
show("2 cancelled, 3 goes from elsewhere")
