"""The page of all claims: read back from what studies and benchmarks write, nothing lost, nothing let through."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest

from interfaces.cli.main import exit_status
from interfaces.lab import Claim, Findings, Paper, Reproduction, Study, Table
from interfaces.lab.claims import OWN_BAR, Counterfactual, Figure, Verdict
from interfaces.lab.output import write
from interfaces.report.claims import COLUMNS, DATA, in_worlds, read_verdicts, render, write_claims
from vrs.errors import FormatError

BENCHMARKS = Path(__file__).resolve().parents[2] / "benchmarks" / "results.json"
OFF = Counterfactual("<i>switched</i> off", 4.0, False, (3.0, 5.0))
CLAIMS = (
    Claim("it <b>holds</b> [cm]", "eq. (1)", 2.0, 1.9999, True, (1.5, 2.5), OFF),
    Claim("it doesn't", "eq. (2)", "at most 1", 3.0, False, counterfactual=OFF),
    Claim("it would anyway", OWN_BAR, "at most 5", 3.0, True, counterfactual=replace(OFF, met=True)),
    Claim("beside nothing", OWN_BAR, "at most 5", 3.0, True),
)


@pytest.fixture
def paper(tmp_path: Path) -> Path:
    table = Table("rows", "Rows & columns", ("a", "b"), ((1.0, None),))
    figure = Figure("curve", "A curve", "<svg xmlns='http://www.w3.org/2000/svg'/>")
    found = Findings(CLAIMS, (table,), (figure,), (Claim("quick", "", "≤ 1", 0.5, True),))
    return write(Reproduction(Paper("toy", "Nobody: Nothing", ()), Study(seed=4), found), tmp_path)


class Reader(HTMLParser):
    """Notes the elements, and fails where one isn't closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag, attrs):
        self.seen.append((tag, dict(attrs)))
        if tag not in {"meta", "link", "input", "img"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    assert reader.open == []
    return reader


def test_every_claim_comes_through_with_all_that_it_says(paper, tmp_path):
    (found,) = read_verdicts(paper)
    assert found.counts == {
        "paper": {"holds": 1, "doesn't hold": 1, "not shown by this": 0},
        "ours": {"holds": 1, "doesn't hold": 0, "not shown by this": 2},
    }
    page = write_claims(tmp_path, [found], read_verdicts(BENCHMARKS))
    document = json.loads((tmp_path / DATA).read_text())
    assert document["papers"][0]["claims"][0] == {
        "claim": CLAIMS[0].claim, "source": "eq. (1)", "expected": 2.0, "measured": 1.9999, "interval": [1.5, 2.5],
        "counterfactual": {"what": OFF.what, "measured": 4.0, "interval": [3.0, 5.0], "met": False},
        "met": True, "verdict": "holds", "holds": True, "ours": False,
    }  # fmt: skip
    rows = [attributes.get("class") for tag, attributes in read(page.read_text()).seen if tag == "tr"]
    for verdict in Verdict:
        assert rows.count(verdict[0]) == sum(counts[verdict] for counts in document["counts"].values())


def test_a_claim_says_in_which_world_it_holds(paper, tmp_path):
    elsewhere = tmp_path / "mujoco"
    elsewhere.mkdir()
    found = Findings((replace(CLAIMS[0], measured=2.6, met=False), replace(CLAIMS[1], claim="another")))
    other = write(Reproduction(Paper("toy", "Nobody: Nothing", ()), Study(seed=4, body="mujoco"), found), elsewhere)
    (usual,), (mujoco,) = read_verdicts(paper), read_verdicts(other)
    assert mujoco.facts[-1] == ("body", "mujoco")
    assert in_worlds(mujoco, [usual, mujoco]) is mujoco
    table, rows = in_worlds(usual, [usual, mujoco]).tables
    assert rows == usual.tables[0]
    assert table["columns"][-2:] == ["usual body", "mujoco"]
    assert table["rows"] == [["it <b>holds</b> [cm]", 2.0, "2: holds", "2.6: doesn't hold"]]
    page = write_claims(tmp_path, [usual], [mujoco]).read_text()
    read(page)
    assert "In which world" in page
    assert "with bodies in mujoco" in page


def test_the_page_is_safe_whole_and_asks_nobody_for_anything(paper):
    page = render(read_verdicts(paper))
    assert "<b>holds</b>" not in page
    assert "<i>switched</i>" not in page
    assert not re.search(r"<script|src=\"(?!data:)|https?://", page)
    assert page.count("data:image/svg+xml") == 1
    assert "<title>1 of 2 claims of the papers hold</title>" in page


def test_equal_findings_are_equal_pages(paper):
    assert render(read_verdicts(paper)) == render(read_verdicts(paper))


def test_what_benchmarks_were_asked_for_is_there_once_each():
    data = json.loads(BENCHMARKS.read_text())
    asked = [row for part in data["parts"].values() for row in part["results"] if row["holds"] is not None]
    found = [claim for part in read_verdicts(BENCHMARKS) for claim in part.timings]
    assert [claim["holds"] for claim in found] == [row["holds"] for row in asked]
    assert all(set(claim) == set(COLUMNS) and claim["expected"] for claim in found)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"parts": {"a": {}}}', '{"schema": "vrs-reproduction/2"}', "\0"])
def test_another_file_is_refused_in_one_line(tmp_path, text, capfd):
    path = tmp_path / "other.json"
    path.write_text(text)
    with pytest.raises(FormatError, match=r"other\.json"):
        read_verdicts(path)
    assert exit_status(["reproduce", "kim2006", "--out", str(tmp_path), "--beyond", str(path)]) == 2
    assert capfd.readouterr().err.count("\n") == 1


def test_a_figure_that_isnt_there_is_said(paper):
    (paper.parent / "curve.svg").unlink()
    with pytest.raises(FormatError, match=r"curve\.svg: can't be read: No such file"):
        read_verdicts(paper)
