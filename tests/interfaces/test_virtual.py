"""The laboratory driver: twins agree where the link lets them, and every cause of divergence shows."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest

from interfaces.link import delay_profile
from interfaces.report.summary import summarize, to_json
from interfaces.runtime.attribution import CAUSES, Measures, attribute, measures, run_without
from interfaces.runtime.bodies import exact_arm, simulated_puma
from interfaces.runtime.plan import default_plan, parse_plan
from interfaces.runtime.virtual import run_twins
from robots import puma560
from vrs import Status

model = puma560.model()
PLAN = parse_plan(
    b"""{"issue": 0.5, "execute": 1.0, "move": [40, 60, -170, 0, 30, 0], "speed": 0.5}
{"issue": 1.5, "move": [-30, 70, -150, 20, 40, 30], "speed": 0.6}
{"issue": 1.6, "payload": {"mass_kg": 2.5}}
{"issue": 2.0, "execute": 1.0, "move": {"pose": "ready"}}
{"issue": 2.2, "register": 2.6, "execute": 2.4, "move": {"pose": "nominal"}}""",
    "plan.jsonl",
    model,
)


def twins(profile, plan=PLAN, arm=exact_arm, seed=0):
    return run_twins(plan, model, delay_profile(profile), arm, seed=seed)


@pytest.mark.parametrize("delay", ["none", "constant:0.5", "constant:0.123456789", "lunar"])
def test_a_constant_delay_shifts_the_real_robot_and_nothing_else(delay):
    run = twins(delay)
    D_f = delay_profile(delay).quantile(0.95)
    assert D_f == -run.D
    assert [event for event in run.events if event.kind != "payload"] == []
    statuses = [receipt.status for receipt in run.receipts_virtual]
    assert statuses == [Status.ACCEPTED, Status.ACCEPTED, Status.REJECTED, Status.POSTPONED]
    assert [receipt.execute_at for receipt in run.receipts_real] == [
        receipt.execute_at for receipt in run.receipts_virtual if receipt.status is not Status.REJECTED
    ]
    assert [packet.arrived - packet.sent for packet in run.packets] == pytest.approx([D_f] * 3)
    assert [packet.real_id for packet in run.packets] == [1, 2, 3]
    late = np.stack([np.interp(run.t + run.D, run.t, column) for column in run.q_virtual.T], axis=1)
    assert run.q_real == pytest.approx(late, abs=2e-3)
    assert run.q_real[-1] == pytest.approx(run.q_virtual[-1], abs=1e-14)


def test_a_late_command_is_postponed_and_told(tmp_path):
    trace = tmp_path / "trace.csv"
    trace.write_text("delay_s\n0.1\n0.1\n0.1\n3.0\n" + "0.1\n" * 100)
    plan = parse_plan(
        b"\n".join(b'{"issue": %d, "move": [%d, 60, -170, 0, 30, 0]}' % (5 * i, 10 * i) for i in range(5)),
        "plan.jsonl",
        model,
    )
    run = twins(f"trace:{trace}", plan)
    assert round(run.D, 9) == -0.1
    assert [event.kind for event in run.events] == ["late"]
    assert run.receipts_real[3].status is Status.POSTPONED
    assert run.receipts_real[3].execute_at == pytest.approx(17.9)
    assert measures(run).tool_rms_timeline_m > 0.01


def test_a_lost_command_is_told(tmp_path):
    trace = tmp_path / "trace.csv"
    trace.write_text('delay_s\n0.1\n""\n0.1\n')
    run = twins(f"trace:{trace}")
    assert [packet.arrived is None for packet in run.packets] == [False, True, False]
    assert [event.kind for event in run.events] == ["lost", "payload"]
    assert len(run.receipts_real) == 2
    assert summarize(run)["commands"]["lost"] == 1


def test_the_load_is_taken_by_the_robots_own_clock():
    (event,) = twins("constant:0.5").events
    assert event.t == pytest.approx(2.1)


def test_the_body_runs_every_millisecond_in_step_with_its_timeline():
    seen = []

    class Spy:
        def run(self, q_ref, qd_ref, qdd_ref):
            seen.append((q_ref, qd_ref, qdd_ref))
            return q_ref

        def attach(self, mass):
            seen.append(mass)

    run = twins("constant:0.25", arm=lambda q: nullcontext(Spy()))
    assert [s for s in seen if isinstance(s, float)] == [2.5]
    q, qd, _ = (np.concatenate([s[i] for s in seen if not isinstance(s, float)]) for i in range(3))
    assert len(q) == round(run.t[-1] * 1000)
    assert q[19::20] == pytest.approx(run.q_reference[1:], abs=1e-12)
    assert np.diff(q, axis=0) == pytest.approx(0.5e-3 * (qd[1:] + qd[:-1]), abs=1e-5)


def test_same_seed_same_bytes_and_another_seed_other_arrivals():
    first, second, other = (to_json(summarize(twins("thu", seed=seed))) for seed in (4, 4, 5))
    assert first == second
    assert first != other


def test_parts_and_residual_add_up():
    stages = tuple(
        Measures(*values) for values in ((9.0, 8.0, 7.0), (5.0, 3.0, 6.5), (2.0, 2.5, 1.0), (0.5, 0.1, 0.0))
    )
    for item in attribute(stages):
        assert [cause for cause, _ in item.parts] == list(CAUSES)
        assert sum(part for _, part in item.parts) + item.residual == pytest.approx(item.total)
    assert attribute(stages)[0].parts == (("network", 4.0), ("payload_and_friction", 3.0), ("servo", 1.5))


def test_the_simulated_arm_follows_and_feels_its_load():
    plan = parse_plan(
        b"""{"issue": 0, "payload": {"mass_kg": 2.5}}
{"issue": 0.2, "move": [20, 40, -150, 0, 30, 0], "speed": 0.8}""",
        "plan.jsonl",
        model,
    )
    loaded = measures(twins("none", plan, simulated_puma()))
    free = measures(run_without(frozenset(CAUSES[:2]), plan, model, delay_profile("thu"), seed=0))
    assert np.degrees(loaded.joint_rms_timeline_rad) < 0.5
    assert loaded.joint_rms_timeline_rad > 1.15 * free.joint_rms_timeline_rad > 0


def test_the_default_plan_has_what_the_demo_promises():
    plan = default_plan(model)
    run = twins("none", plan)
    statuses = [receipt.status for receipt in run.receipts_virtual]
    assert statuses.count(Status.POSTPONED) == 1
    assert statuses.count(Status.REJECTED) == 1
    assert any(receipt.shifted for receipt in run.receipts_virtual)
    assert 50 < run.t[-1] < 70
    assert [event.kind for event in run.events] == ["payload", "release"]
    assert measures(run).joint_rms_timeline_rad == pytest.approx(0, abs=1e-12)
