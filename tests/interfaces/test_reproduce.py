"""`vrs reproduce`: every part of the paper in small, the command, its files, and that they repeat."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from dataclasses import replace

import numpy as np
import pytest

from interfaces.cli.main import exit_status
from interfaces.lab import PAPERS, Claim, Findings, Paper, PaperPart, Study, Table, papers, reproduce, reproductions
from interfaces.lab.claims import Results
from interfaces.lab.doulgeri import (
    agreement,
    broadcasting,
    causality,
    delays,
    dragging,
    encoding,
    jitter,
    rivals,
    segments,
)
from interfaces.lab.output import rich_tables, to_json, write
from interfaces.lab.runner import joined
from interfaces.lab.statistics import bootstrap, median
from tests.interfaces.lab.test_doulgeri_claims import but
from vrs.errors import InvalidValueError

SMALL = Study(seed=3, runs=2, length=4.0)
KEYS = {
    "claim", "source", "expected", "measured", "interval", "counterfactual", "met", "verdict", "holds", "ours",
}  # fmt: skip


def double(study: Study, case: str) -> float:
    return study.seed * float(case)


def add_up(study: Study, found: tuple[float, ...]) -> Findings:
    total = sum(found)
    claims = (
        Claim("it adds up", "eq. (1)", 12.0, total, total == 12.0, (total, total)),
        Claim("it's nothing [odd]", "eq. (2)", 0.0, float("inf"), False),
    )
    tables = (Table("numbers", "Numbers", ("a", "b"), ((1.0, None),)),)
    return Findings(claims, tables, (), (Claim("quick", "", "≤ 1", 0.5, True),))


TOY = Paper("toy", "Nobody: Nothing", (PaperPart("toy", double, add_up, ("1", "3")),))


def only(name: str) -> PaperPart:
    return next(part for part in PAPERS["doulgeri"].parts if name in part.title)


def measured(part: PaperPart, study: Study = SMALL) -> Findings:
    return part.conclude(study, tuple(part.work(study, case) for case in part.cases))


class TestHouse:
    @pytest.mark.parametrize("workers", [1, 2])
    def test_what_is_found_doesnt_depend_on_the_workers(self, workers):
        told = []
        study = Study(seed=3)
        made = reproduce(TOY, study, workers=workers, progress=told.append)
        assert told == ["toy", "toy"]
        assert made.findings.claims[0].measured == 12.0
        assert [claim.claim for claim in made.failed] == ["it's nothing [odd]"]

    @pytest.mark.parametrize("workers", [1, 2])
    def test_papers_share_the_workers_and_come_in_their_order(self, workers):
        told = []
        other = replace(TOY, name="other", parts=(replace(TOY.parts[0], title="other", cases=("5", "7", "9")),))
        chosen = [(TOY, Study(seed=3)), (other, Study(seed=1)), (TOY, Study(seed=2))]
        made = list(reproductions(chosen, workers=workers, progress=lambda part: told.append(part.title)))
        assert [one.paper.name for one in made] == ["toy", "other", "toy"]
        assert made == [reproduce(paper, study) for paper, study in chosen]
        assert sorted(told) == ["other"] * 3 + ["toy"] * 4

    def test_a_failure_in_a_worker_is_raised_here(self):
        bad = replace(TOY, parts=(replace(TOY.parts[0], cases=("1", "x")),))
        for workers in (1, 2):
            with pytest.raises(ValueError, match="x"):
                reproduce(bad, Study(), workers=workers)

    def test_json_has_the_contract_and_no_infinity(self, tmp_path):
        made = reproduce(TOY, Study(seed=3))
        path = write(made, tmp_path)
        assert path.name == "toy.json"
        document = json.loads(path.read_text(), parse_constant=pytest.fail)
        assert all(set(claim) == KEYS for claim in document["claims"] + document["timings"])
        assert document["claims"][0]["interval"] == [12.0, 12.0]
        assert document["claims"][1] | {"claim": ""} == {
            "claim": "", "source": "eq. (2)", "expected": 0.0, "measured": "inf", "interval": None,
            "counterfactual": None, "met": False, "verdict": "doesn't hold", "holds": False, "ours": False,
        }  # fmt: skip
        assert document["tables"][0]["rows"] == [[1.0, None]]

    def test_a_table_says_what_doesnt_hold(self):
        from rich.console import Console

        console = Console(width=140, record=True, file=io.StringIO())
        for table in rich_tables(reproduce(TOY, Study(seed=3))):
            console.print(table)
        text = console.export_text()
        assert "doesn't hold" in text
        assert "[odd]" in text

    def test_all_and_one_and_none(self):
        assert papers("all") == tuple(PAPERS.values())
        assert papers("doulgeri") == (PAPERS["doulgeri"],)
        with pytest.raises(InvalidValueError, match="doulgeri, han2001, kim2002, kim2006, tipsuwan, all"):
            papers("nobody")

    def test_of_a_world_of_physics_what_robots_have_part_in_is_measured(self):
        parts = {name: [part.title for part in paper.in_world("mujoco").parts] for name, paper in PAPERS.items()}
        assert parts == {
            "doulgeri": [], "han2001": ["Architectures"], "kim2002": ["The scenario"], "kim2006": [],
            "tipsuwan": ["Controllers", "Success"],
        }  # fmt: skip
        assert TOY.in_world("") == TOY
        made = reproduce(TOY, Study(body="mujoco"))
        assert json.loads(to_json(made))["body"] == "mujoco"

    def test_misuse(self):
        for options in (
            {"seed": -1},
            {"body": "jelly"},
            {"runs": 1},
            {"length": 1.0},
            {"length": np.nan},
            {"runs": 2.5},
        ):
            with pytest.raises(InvalidValueError):
                Study(**options)
        with pytest.raises(InvalidValueError):
            reproduce(TOY, Study(), workers=0)
        with pytest.raises(InvalidValueError):
            Table("t", "T", ("a",), ((1.0, 2.0),))

    def test_findings_are_joined_in_order(self):
        one = add_up(Study(), (1.0,))
        assert joined([one, one]).claims == one.claims + one.claims


class TestStatistics:
    def test_the_interval_covers_the_mean_as_often_as_it_says(self):
        rng = np.random.default_rng(0)
        estimates = [bootstrap(rng.normal(2.0, 1.0, 40), seed) for seed in range(100)]
        assert 0.87 <= np.mean([e.low <= 2.0 <= e.high for e in estimates]) <= 0.99

    def test_one_value_and_no_spread(self):
        assert bootstrap([1.5], 0)[:3] == (1.5, 1.5, 1.5)
        assert bootstrap([1.5] * 6, 0)[:3] == bootstrap([1.5] * 12, 0)[:3] == (1.5, 1.5, 1.5)
        assert bootstrap([1.0, 2.0, 9.0], 0, median).value == 2.0
        assert bootstrap([-1.0, -2.0], 0).is_below_zero
        assert not bootstrap([-1.0, 2.0], 0).is_below_zero

    @pytest.mark.parametrize("values", [[], [np.nan], [[1.0]]])
    def test_what_is_no_sample(self, values):
        with pytest.raises(InvalidValueError):
            bootstrap(values, 0)


class TestDoulgeri:
    @pytest.mark.parametrize("name", ["Fig. 1", "II-C", "VI-B", "(d)", "(e)"])
    def test_every_claim_of_a_part_holds(self, name, monkeypatch):
        monkeypatch.setattr(broadcasting, "over_sockets", lambda _: ())
        found = measured(only(name))
        assert found.claims
        assert [claim for claim in found.claims if not claim.holds] == []
        for figure in found.figures:
            assert ET.fromstring(figure.svg).tag.endswith("svg")

    def test_fig_1(self):
        seen = segments.example()
        before, after, t_exec = seen.before, seen.after, seen.t_exec
        assert [segments.degree(s) for s in segments.moving(before)] == [2, 1, 2]
        assert [segments.degree(s) for s in segments.moving(after)] == [2, 1, 2, 1, 2]
        assert segments.moving(after)[2].start == t_exec
        assert max(segments.jumps(after.segments)) < 1e-9

    def test_a_jump_is_seen(self):
        """The timeline's own check lets jumps of velocity pass."""
        after = segments.example().after
        torn = list(after.segments)
        bent = torn[-1].coefficients.copy()
        bent[1] += 0.01
        torn[-1] = replace(torn[-1], coefficients=bent)
        position, velocity = segments.jumps(torn)
        assert position < 1e-9
        assert velocity == pytest.approx(0.01)

    @pytest.mark.parametrize("case", list(delays.SETTINGS))
    def test_figs_4_to_6_in_a_run(self, case):
        setting = delays.SETTINGS[case]
        seen = delays.run(setting, 5, 6.0)
        assert np.abs(np.array(seen.lateness) - setting.lateness).max() < 1e-8
        assert seen.ages[0] == pytest.approx(setting.age, abs=1e-8)
        assert seen.shown <= setting.age + 1.0 / delays.RATE + 1e-8
        assert (seen.falsified > 0) == (setting.lead > 0)
        assert seen.falsified == pytest.approx(seen.foretold, abs=0.01)
        assert seen.wrong == seen.falsified
        assert len(seen.commands) == len(seen.lateness) > 0

    def test_frames_further_ahead_are_falsified_more_often(self):
        shares = delays.leads(1, 10.0)
        assert list(shares) == sorted(shares)
        assert 0 < shares[0] < shares[-1] < 1

    def test_foretold_counts_what_lies_in_the_lead(self):
        frames = [Results(made_at=t, t=t + 0.5) for t in (0.0, 0.3, 0.6, 1.0)]
        assert delays.foretold(frames, np.array([0.7])) == 0.5
        assert delays.foretold(frames, np.array([])) == 0.0
        assert delays.foretold([], np.array([0.7])) == 0.0

    def test_delays_conclude(self):
        found = measured(only("Figs 4"), Study(seed=1, runs=3, length=6.0))
        assert len(found.tables[0].rows) == 4
        lateness = [claim for claim in found.claims if "come late" in claim.claim]
        assert [claim.expected for claim in lateness] == [0.3, 0.0, 0.0, 0.5]
        assert all(claim.met for claim in lateness)
        seen = delays.run(delays.SETTINGS["0"]._replace(D=0.01), 5, 4.0)
        off = delays.delay_claims("0", {"0": [seen], "-Df": [seen]})
        assert not any(claim.met for claim in off)

    def test_causality_is_told_rightly_by_each_clock(self):
        for D in (0.0, -causality.D_F, causality.D_B):
            right, total = causality.over_a_link(D, 2, 6.0)
            assert right[D] == total > 0
            assert all(count < total for other, count in right.items() if other != D)

    def test_a_frame_that_lacks_is_seen(self):
        assert broadcasting.count_missing([3, 4, 5]) == 0
        assert broadcasting.count_missing([3, 5, 6]) == 1
        assert broadcasting.count_missing([]) == 1

    def test_jitter_adaptive_and_its_rivals(self):
        seen = {
            name: jitter.run("mon@2", 1, 5.0, robot)[0]
            for name, robot in (
                ("ours", rivals.adaptive),
                ("postpones", rivals.postponing(-0.1)),
                ("waits", rivals.waiting(-2.0)),
                ("jumps", rivals.jumping),
            )
        }
        for name in ("ours", "waits"):
            one = seen[name]
            assert one.aside <= 1e-3
            assert one.bursts == one.postponed == one.corrections == 0
            assert one.limits <= 1 + 1e-9
            assert one.pace <= 1.05 + 1e-9
            assert one.progress == pytest.approx(1.0)
        assert seen["waits"].time_difference > 1.9
        assert seen["postpones"].postponed > 0
        assert seen["postpones"].corrections > 0
        assert seen["postpones"].mean > seen["ours"].mean
        assert seen["jumps"].aside <= 1e-3
        assert seen["jumps"].pace > 2
        assert seen["jumps"].limits > 2
        assert jitter.run("mon@2", 2, 20.0, rivals.halting)[0].progress < 0.5

    def test_a_seed_counts_once_however_many_profiles_it_ran_under(self):
        one = jitter.run("mon@0.2", 1, 2.0)[0]
        pair, late = ([but(one, mean=x, time_difference=x) for x in values] for values in ((0.0, 1.0), (1.5, 1.5)))
        runs = {
            "adaptive": pair,
            "postpones": late,
            "waits": late,
            "waits, mean": pair,
            "jumps": late,
            "halts": late,
        }
        result = Results(D={}, runs=runs, traces=(jitter.run("mon@0.2", 1, 2.0)[1],) * 2)
        found = jitter.conclude(SMALL, (result,) * len(jitter.CASES))
        assert len(found.tables[0].rows) == 5 * len(jitter.CASES)
        # Of two seeds it's the range: each counts once.
        intervals = {claim.claim[:9]: claim.interval for claim in found.claims if claim.interval is not None}
        assert intervals == {"adaptive ": pytest.approx((0.0, 1.0)), "mean time": pytest.approx((-1.5, -0.5))}

    def test_encoding_is_read_again(self):
        for kind in encoding.MOTIONS:
            sizes = encoding.measure(kind, 1, 2.0 if kind == "moves" else 0.4)
            assert sizes.rebuilt <= 1e-12
            assert sizes.compact_error <= 1e-5
            assert sizes.frames_single < sizes.frames
        assert encoding.measure("moves", 1, 6.0).segments < sizes.frames

    def test_encoding_concludes(self):
        sizes = Results(
            frames=100.0, frames_single=60.0, segments=400.0, commands=50.0, between=1e-3, rebuilt=0.0,
            compact=400.0, compact_each=500.0, absolute=600.0, compact_error=1e-6, joined=1e-3, joined_few=1e-2,
        )  # fmt: skip
        found = encoding.conclude(SMALL, ([sizes] * 2,) * 3)
        assert [claim.met for claim in found.claims[:5]] == [False, False, True, True, True]

    def test_more_hands_than_runs(self):
        assert dragging.work(SMALL, "2") == {}

    def test_timelines_that_never_agree_are_said_so(self):
        seen = agreement.talk(1, 4.0, agreement.Conditions(), None)
        assert seen.agreed <= 0.1
        apart = but(seen, agreed=np.inf)
        found = agreement.conclude(SMALL, ([apart] * 2, [apart] * 2, *([[seen] * 2] * 3)))
        holds = {claim.claim: claim.met for claim in found.claims if "agree to 1e-9" in claim.claim}
        assert list(holds.values()) == [False, False, True, True]


class TestCommand:
    def test_bad_input_is_one_line_and_exit_2(self, tmp_path, capsys):
        (tmp_path / "file").touch()
        for arguments, said in (
            (
                ["reproduce", "nobody", "--out", str(tmp_path)],
                "one of doulgeri, han2001, kim2002, kim2006, tipsuwan, all",
            ),
            (["reproduce", "--out", str(tmp_path)], "PAPER"),
            (["reproduce", "doulgeri"], "--out"),
            (["reproduce", "doulgeri", "--out", str(tmp_path / "file")], "can't hold the results"),
            (["reproduce", "doulgeri", "--out", str(tmp_path), "--runs", "1"], "--runs"),
        ):
            assert exit_status(arguments) == 2
            captured = capsys.readouterr()
            assert captured.out == ""
            assert captured.err.count("\n") == 1
            assert said in captured.err

    @pytest.mark.slow
    def test_the_same_bytes_in_two_processes(self, tmp_path):
        """Some parts; all of them with VRS_REPRODUCE_PARTS=:, which takes a minute."""
        documents, pictures = [], []
        for k, workers in enumerate((1, 2)):
            out = tmp_path / str(k)
            done = subprocess.run(
                [sys.executable, "-c", PROGRAM, "reproduce", "doulgeri", "--out", str(out), *SHORT, "--workers",
                 str(workers)],
                capture_output=True, text=True, check=False, timeout=300,
                env={**os.environ, "PYTHONHASHSEED": str(k + 1)},
            )  # fmt: skip
            assert done.returncode == 0, done.stderr
            text = (out / "doulgeri.json").read_text()
            assert done.stdout == text
            document = json.loads(text)
            document.pop("timings")
            documents.append(json.dumps(document))
            pictures.append({path.name: path.read_bytes() for path in sorted(out.glob("*.svg"))})
            assert set(pictures[-1]) == {figure["file"] for figure in document["figures"]}
        assert documents[0] == documents[1]
        assert pictures[0] == pictures[1]
        assert len(pictures[0]) >= 4

    def test_it_prints_tables_and_what_doesnt_hold(self, tmp_path, monkeypatch, capsys):
        from interfaces.lab import papers as known

        monkeypatch.setitem(known.__globals__["PAPERS"], "toy", TOY)
        assert exit_status(["reproduce", "toy", "--out", str(tmp_path), "--workers", "1", "--seed", "3"]) == 0
        out = capsys.readouterr().out
        assert "The paper's own claims: 1 doesn't hold, 1 not shown by this" in out
        assert "Doesn't hold: it's nothing [odd] (eq. (2))" in out
        assert (tmp_path / "toy.json").exists()


SHORT = ("--runs", "2", "--length", "2", "--seed", "4", "--json")
PROGRAM = """
import os
from dataclasses import replace
from interfaces.lab import papers as known
PAPERS = known.__globals__["PAPERS"]
paper = PAPERS["doulgeri"]
wanted = os.environ.get("VRS_REPRODUCE_PARTS", "Fig. 1:Figs 4 to 6:(d)").split(":")
parts = tuple(part for part in paper.parts if any(word in part.title for word in wanted))
PAPERS["doulgeri"] = replace(paper, parts=parts)
from interfaces.cli import main
if __name__ == "__main__":
    main()
"""


def test_a_short_study_has_a_motion_in_every_run():
    """Of seed 63 chance gives a stop alone, half a second after the beginning."""
    seen, _ = jitter.run("mon@2", 63, 2.0)
    assert seen.moves == 1
    assert seen.progress == pytest.approx(1.0)


def test_a_short_study_has_a_command_in_every_run():
    assert all(encoding.acts("moves", np.random.default_rng(seed), 2.0) for seed in range(40))
