"""The laboratory driver: twins agree where the link lets them, and every cause of divergence shows."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from interfaces.link import Service, delay_profile
from interfaces.runs.summary import CAUSES, Measures, attribute, measures, summarize, to_json
from interfaces.runs.twin_run import fixed_offset
from interfaces.runtime.plan import default_plan, parse_plan
from interfaces.runtime.session import run_twins, run_without
from robots import load
from robots.robot import ExactArm, exact_arm
from vrs import Status
from vrs.errors import InvalidValueError

robot = load("puma560")
model = robot.arm
PLAN = parse_plan(
    b"""{"issue": 0.5, "execute": 1.0, "move": [40, 60, -170, 0, 30, 0], "speed": 0.5}
{"issue": 1.5, "move": [-30, 70, -150, 20, 40, 30], "speed": 0.6}
{"issue": 1.6, "payload": {"mass_kg": 2.5}}
{"issue": 2.0, "execute": 1.0, "move": {"pose": "ready"}}
{"issue": 2.2, "register": 2.6, "execute": 2.4, "move": {"pose": "nominal"}}""",
    "plan.jsonl",
    model,
)


def twins(profile, plan=PLAN, arm=exact_arm, seed=0, offset="fixed", service=Service.DATAGRAM):
    delay = delay_profile(profile)
    D = fixed_offset(offset, delay)
    return run_twins(plan, robot, delay, arm, seed=seed, offset=D, service=service)


def told(run, *kinds):
    return [event for event in run.events if event.kind in kinds]


@pytest.mark.parametrize("delay", ["none", "constant:0.5", "constant:0.123456789", "lunar"])
def test_a_constant_delay_shifts_the_real_robot_and_nothing_else(delay):
    run = twins(delay)
    D_f = delay_profile(delay).quantile(0.95)
    assert np.abs(run.D + D_f).max() < 1e-12
    assert run.session.offset == f"fixed:{D_f:.9g}"
    assert [event for event in run.events if event.kind != "payload"] == []
    statuses = [receipt.status for receipt in run.receipts_virtual]
    assert statuses == [Status.ACCEPTED, Status.ACCEPTED, Status.REJECTED, Status.POSTPONED]
    assert [receipt.execute_at for receipt in run.receipts_real] == [
        receipt.execute_at for receipt in run.receipts_virtual if receipt.status is not Status.REJECTED
    ]
    assert [packet.arrived - packet.sent for packet in run.packets] == pytest.approx([D_f] * 3)
    assert [packet.real_id for packet in run.packets] == [1, 2, 4]
    late = np.stack([np.interp(run.t - D_f, run.t, column) for column in run.q_virtual.T], axis=1)
    assert run.q_real == pytest.approx(late, abs=2e-3)
    assert run.q_real == pytest.approx(run.q_matched, abs=1e-9)
    assert run.q_real[-1] == pytest.approx(run.q_virtual[-1], abs=1e-14)


@pytest.mark.parametrize("delay", ["constant:0.3", "mon", "thu", "wed@20"])
@pytest.mark.parametrize("service", list(Service))
def test_with_an_adaptive_offset_no_command_is_late(delay, service):
    run = twins(delay, offset="adaptive", seed=3, service=service)
    assert not told(run, "late", "diverged", "corrected", "halted", "unfinished")
    assert run.q_real == pytest.approx(run.q_matched, abs=1e-12)
    assert run.q_real[-1] == pytest.approx(run.q_virtual[-1], abs=1e-12)
    assert measures(run).tool_rms_timeline_m < 1e-12
    assert measures(run).tool_rms_user_m > 0.01
    assert run.D.max() <= 0
    assert [r.execute_at for r in run.receipts_real] == [
        r.execute_at for r in run.receipts_virtual if r.status is not Status.REJECTED
    ]


def stalled(tmp_path):
    """A link that takes 0.1 s, and once three seconds for two seconds' messages; an operator who moves on."""
    trace = tmp_path / "trace.csv"
    trace.write_text("delay_s\n" + "0.1\n" * 290 + "3.0\n" * 40 + "0.1\n" * 3000)
    sides = (60, -60, 60, -60, 60)
    lines = (
        b'{"issue": %d, "move": [%d, 60, -170, 0, 30, 0], "speed": 0.3}' % (5 * i, q) for i, q in enumerate(sides)
    )
    return f"trace:{trace}", parse_plan(b"\n".join(lines), "plan.jsonl", model)


def test_where_messages_stall_the_robot_slows_down_and_is_further_behind_by_that(tmp_path):
    delay, plan = stalled(tmp_path)
    run = twins(delay, plan, offset="adaptive", service=Service.IN_ORDER)
    (slowed,) = (event for event in told(run, "slowed") if event.t > 5)
    assert 14 < slowed.t < 16.5
    grown = float(slowed.text.split("is ")[1].split()[0])
    until = float(slowed.text.split("until ")[1].split()[0])
    begin, end = (round(t / run.dt) for t in (slowed.t, until))
    assert grown == pytest.approx(run.D[begin] - run.D[end], abs=2e-3)
    assert 2.5 < grown < 3.5
    assert summarize(run)["behind"]["slowed"] == len(told(run, "slowed"))


def test_a_late_command_is_postponed_and_the_virtual_robot_follows(tmp_path):
    delay, plan = stalled(tmp_path)
    run = twins(delay, plan, service=Service.IN_ORDER)
    assert run.D[0] == pytest.approx(-0.1)
    (late,) = told(run, "late")
    assert late.text.startswith("command 4 came ")
    arrived = run.packets[3].arrived
    assert run.receipts_real[3].status is Status.POSTPONED
    assert run.receipts_real[3].execute_at == pytest.approx(arrived - 0.1)
    assert measures(run).tool_rms_timeline_m > 0.01
    assert run.corrections
    assert len(told(run, "corrected")) == len(run.corrections) == summarize(run)["commands"]["corrections"]
    # What the commands make is kept apart from what the user saw.
    assert np.abs(run.q_shown - run.q_virtual).max() > 0.01
    assert run.q_shown[-1] == pytest.approx(run.q_real[-1], abs=1e-9)


def test_a_lost_message_is_told_and_repeated(tmp_path):
    trace = tmp_path / "trace.csv"
    trace.write_text("delay_s\n" + "0.1\n" * 11 + '""\n' + "0.1\n" * 400)
    run = twins(f"trace:{trace}", offset="adaptive")
    assert [packet.lost for packet in run.packets] == [True, False, False]
    assert run.packets[0].arrived - run.packets[0].sent == pytest.approx(0.15)
    assert [event.kind for event in run.events if event.kind != "payload"][:1] == ["lost"]
    assert len(run.receipts_real) == 3
    assert summarize(run)["commands"]["lost"] == 1
    assert np.isnan(run.messages[:, 1]).sum() == 1


def test_a_robot_that_cannot_follow_stops_and_the_run_ends():
    class Stuck(ExactArm):
        def follow(self, prepared):
            return replace(super().follow(prepared), q=np.tile(PLAN.start, (len(prepared.q), 1)))

        def attach(self, mass):
            pass

    run = twins("constant:0.6", arm=lambda q: nullcontext(Stuck()))
    (halted,) = told(run, "halted")
    assert "rad from where it should be" in halted.text
    assert 1.6 < halted.t < 2.1
    # A command that was under way then is never carried out, and the run doesn't wait for it.
    assert len(run.packets) > len(run.receipts_real)
    assert not told(run, "unfinished")
    assert run.corrections
    assert run.q_shown[-1] == pytest.approx(PLAN.start, abs=1e-9)
    assert any("robot doesn't follow" in r.reason for r in run.receipts_virtual)


@pytest.mark.parametrize(
    "text", ["", "adaptiv", "fixed:", "fixed:-1", "fixed:nan", "fixed:1e9", "-0.5", "constant:1"]
)
def test_an_offset_of_another_spelling_is_refused(text):
    with pytest.raises(InvalidValueError, match="'adaptive', 'fixed', or 'fixed:S'"):
        fixed_offset(text, delay_profile("none"))


def test_a_fixed_offset_covers_the_profile_or_is_given():
    assert fixed_offset("adaptive", delay_profile("thu")) is None
    assert fixed_offset("fixed", delay_profile("constant:0.123")) == -0.123
    assert fixed_offset("fixed:0.25", delay_profile("thu")) == -0.25
    D = fixed_offset("fixed", delay_profile("thu"))
    assert 0 <= -D - delay_profile("thu").quantile(0.95) < 0.02 + 1e-9


@pytest.mark.parametrize("offset", ["fixed", "fixed:0.7", "adaptive"])
def test_the_load_is_taken_when_the_robot_plays_its_time(offset):
    run = twins("constant:0.5", offset=offset)
    (event,) = told(run, "payload")
    assert np.interp(event.t, run.t, run.play) == pytest.approx(1.6, abs=1e-4)
    if offset == "fixed":
        assert event.t == pytest.approx(2.1, abs=1e-9)


@pytest.mark.parametrize("offset", ["fixed", "adaptive"])
def test_the_body_runs_every_millisecond_in_step_with_its_timeline(offset):
    seen = []

    class Spy(ExactArm):
        def prepare(self, *reference):
            seen.append(reference)
            return super().prepare(*reference)

        def attach(self, mass):
            seen.append(mass)

    run = twins("constant:0.25", arm=lambda q: nullcontext(Spy()), offset=offset)
    assert [s for s in seen if isinstance(s, float)] == [2.5]
    q, qd, _ = (np.concatenate([s[i] for s in seen if not isinstance(s, float)]) for i in range(3))
    assert len(q) == round(run.t[-1] * 1000)
    assert q[19::20] == pytest.approx(run.q_reference[1:], abs=1e-12)
    assert np.diff(q, axis=0) == pytest.approx(0.5e-3 * (qd[1:] + qd[:-1]), abs=1e-5)


def test_same_seed_same_bytes_and_another_seed_other_arrivals():
    first, second, other = (to_json(summarize(twins("thu", seed=seed, offset="adaptive"))) for seed in (4, 4, 5))
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
    loaded = measures(twins("none", plan, robot.body()))
    free = measures(run_without(frozenset(CAUSES[:2]), plan, robot, delay_profile("thu"), seed=0))
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
