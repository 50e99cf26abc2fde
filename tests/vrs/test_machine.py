"""The engine as a state machine: hypothesis looks for a short way to break a law."""

from __future__ import annotations

import os

import numpy as np
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test

from robots import puma560
from tests.vrs.laws import Figures
from tests.vrs.sessions import Session, lines_are_planned
from vrs import Timeline

EDITS = int(os.environ.get("VRS_SOAK_EDITS", "0"))
STEPS = 12
EXAMPLES = max(30, EDITS // 400)
MODEL = puma560.model()
LIMITS = MODEL.limits
LINES = lines_are_planned(MODEL)


class Drawn:
    """Chance from hypothesis, which can shrink it."""

    def __init__(self, data: st.DataObject) -> None:
        self.data = data

    def share(self) -> float:
        return self.data.draw(st.floats(0.0, 1.0))

    def pick(self, count: int) -> int:
        return self.data.draw(st.integers(0, count - 1))


class EngineMachine(RuleBasedStateMachine):
    """Rules pass commands to a watched engine; invariants ask what any plan must be, however it was made."""

    source: Drawn
    session: Session

    @initialize(data=st.data())
    def begin(self, data: st.DataObject) -> None:
        self.source = Drawn(data)
        self.session = Session(MODEL, self.source, Figures(), lines=LINES)

    def tell(self, data: st.DataObject, kind: str) -> None:
        self.source.data = data
        self.session.tell(kind)

    @rule(data=st.data())
    def move(self, data: st.DataObject) -> None:
        self.tell(data, "move")

    @rule(data=st.data())
    def move_on(self, data: st.DataObject) -> None:
        self.tell(data, "move")

    @rule(data=st.data())
    def steer(self, data: st.DataObject) -> None:
        self.tell(data, "steer")

    @rule(data=st.data())
    def retime(self, data: st.DataObject) -> None:
        self.tell(data, "retime")

    @rule(data=st.data())
    def cancel(self, data: st.DataObject) -> None:
        self.tell(data, "cancel")

    @rule(data=st.data())
    def insert_via(self, data: st.DataObject) -> None:
        self.tell(data, "via")

    @rule(data=st.data())
    def scale_time(self, data: st.DataObject) -> None:
        self.tell(data, "scale")

    @rule(data=st.data())
    def stop(self, data: st.DataObject) -> None:
        self.tell(data, "stop")

    @rule(data=st.data())
    def stop_and_resume(self, data: st.DataObject) -> None:
        self.tell(data, "stop")
        self.tell(data, "resume")

    @rule(data=st.data())
    def undo(self, data: st.DataObject) -> None:
        self.tell(data, "undo")

    @rule(data=st.data())
    def ask_and_change(self, data: st.DataObject) -> None:
        self.tell(data, "query")
        self.tell(data, "parameter")

    @rule(data=st.data())
    def branch(self, data: st.DataObject) -> None:
        self.source.data = data
        self.session.branch()

    @invariant()
    def the_plan_can_be_written_down_and_read(self) -> None:
        timeline = self.session.watch.engine.timeline
        assert Timeline(timeline.initial, timeline.start, timeline.segments, timeline.version) == timeline

    @invariant()
    def the_arm_is_within_its_limits(self) -> None:
        engine = self.session.watch.engine
        t = np.linspace(engine.timeline.start - 0.1, engine.timeline.end + 0.1, 50)
        q = engine.joints(t)
        assert (q >= LIMITS.q_min - 1e-8).all()
        assert (q <= LIMITS.q_max + 1e-8).all()

    @invariant()
    def receipts_are_numbered_and_the_future_rests(self) -> None:
        engine = self.session.watch.engine
        numbers = [receipt.command_id for receipt in engine.receipts]
        assert numbers == sorted(set(numbers))
        assert not engine.timeline.sample(engine.timeline.end + 1.0, derivative=1).any()

    def teardown(self) -> None:
        if hasattr(self, "session"):
            self.session.audit()


def test_no_short_way_breaks_a_law() -> None:
    how = settings(
        max_examples=EXAMPLES,
        stateful_step_count=STEPS,
        deadline=None,
        database=None,
        derandomize="VRS_SOAK_SEED" not in os.environ,
        suppress_health_check=list(HealthCheck),
        phases=(Phase.generate, Phase.shrink),
    )
    run_state_machine_as_test(EngineMachine, settings=how)
