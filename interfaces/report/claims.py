"""The page of all claims, read back from studies and benchmarks: one HTML file and the same as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from interfaces.lab.claims import Verdict, said
from interfaces.lab.output import SCHEMA
from interfaces.report.pages import page
from interfaces.system import read_within, written
from vrs.errors import FormatError

Json = Mapping[str, Any]
COLUMNS: Final = (
    "claim", "source", "expected", "measured", "interval", "counterfactual", "met", "verdict", "holds", "ours",
)  # fmt: skip
"""What each claim says of itself."""
LARGEST: Final = 64 * 2**20
"""Longest file that is read [byte]."""


@dataclass(frozen=True, slots=True)
class ClaimReport:
    """The claims of one paper, study or benchmark."""

    name: str
    title: str
    facts: tuple[tuple[str, str], ...]
    """How it was measured, in pairs of a name and a value."""
    claims: tuple[Json, ...]
    """Each with the keys of `COLUMNS`."""
    timings: tuple[Json, ...] = ()
    """Bars of the machine's speed: met or not."""
    tables: tuple[Json, ...] = ()
    """`title`, `columns` and `rows`."""
    figures: tuple[tuple[str, str], ...] = ()
    """Titles and SVG texts."""

    @property
    def counts(self) -> dict[str, dict[str, int]]:
        """How many claims have which verdict, of the paper's own and of ours; a bar of speed is ours."""
        found = [(row["ours"], row["verdict"]) for row in (*self.claims, *self.timings)]
        return {
            whose: {verdict.value: found.count((ours, verdict)) for verdict in Verdict}
            for whose, ours in WHOSE.items()
        }


WHOSE: Final = {"paper": False, "ours": True}
"""Whether a claim is ours, by who makes it."""


def summed(reports: Iterable[ClaimReport]) -> dict[str, dict[str, int]]:
    """The counts of some reports together."""
    each = [found.counts for found in reports]
    return {whose: {verdict: sum(one[whose][verdict] for one in each) for verdict in Verdict} for whose in WHOSE}


def read_verdicts(path: Path) -> tuple[ClaimReport, ...]:
    """Read a study's `PAPER.json` with the figures beside it, or the `results.json` of the benchmarks.

    Raises:
        FormatError: If it's neither, or can't be read.
    """
    data = read_within(path, LARGEST)
    try:
        document = json.loads(data)
    except ValueError as error:
        raise FormatError(str(path), f"isn't JSON: {error}") from None
    try:
        if document.get("schema") == SCHEMA:
            return (_study(path, document),)
        return tuple(found for name, part in document["parts"].items() if (found := _benchmark(name, part)).timings)
    except (KeyError, TypeError, AttributeError) as error:
        raise FormatError(str(path), f"isn't a reproduction or a benchmark's results: {error!r}") from None


def _study(path: Path, document: Json) -> ClaimReport:
    length = f"{document['length_s']:g} s"
    facts = [("seed", str(document["seed"])), ("runs", str(document["runs"])), ("length", length)]
    name, title = document["paper"], document["citation"]
    if body := document.get("body", ""):
        facts.append(("body", body))
        name, title = f"{name}@{body}", f"{title}: with bodies in {body}"
    return ClaimReport(
        name,
        title,
        tuple(facts),
        tuple(map(_claim, document["claims"])),
        tuple(map(_claim, document["timings"])),
        tuple({**each, "rows": [list(map(_cell, row)) for row in each["rows"]]} for each in document["tables"]),
        tuple(
            (figure["title"], read_within(path.parent / figure["file"], LARGEST).decode())
            for figure in document["figures"]
        ),
    )


def _cell(value: object) -> object:
    """A cell of a table; what isn't there is blank."""
    return "" if value is None else value


def _claim(claim: Json) -> Json:
    return {name: claim[name] for name in COLUMNS}


def _benchmark(name: str, part: Json) -> ClaimReport:
    asked = [_measured(name, result) for result in part["results"] if result["holds"] is not None]
    facts = (("pace of the machine", f"{part['pace_us']:.0f} µs"),)
    return ClaimReport(name, part["title"], facts, (), tuple(asked))


def _measured(name: str, result: Json) -> Json:
    """A benchmark's row as a claim: medians, the 99th percentile, the ratio to a peer."""
    beside = f", beside {result['peer']}" if result["peer"] else ""
    unit, ours = result["unit"], result["ours"]
    words = [f"{ours['median']:.3g} {unit}".rstrip()]
    if ours["p99"] is not None:
        words.append(f"p99 {ours['p99']:.3g} {unit}".rstrip())
    if result["ratio"] is not None:
        words.append(f"ratio {result['ratio']:.2f}")
    return {
        "claim": f"{result['name']}{beside}".replace("`", "") + (f" [{unit}]" if unit else ""),
        "source": f"python -m benchmarks {name}",
        "expected": result["asked"],
        "measured": ", ".join(words),
        "interval": None,
        "counterfactual": None,
        "met": bool(result["holds"]),
        "verdict": Verdict.HOLDS if result["holds"] else Verdict.FAILS,
        "holds": bool(result["holds"]),
        "ours": True,
    }


def in_worlds(found: ClaimReport, others: Sequence[ClaimReport]) -> ClaimReport:
    """Return a paper's claims with a table of what they come to in other worlds of physics.

    Args:
        found: The paper's.
        others: Among them those of the same paper with bodies in other worlds; without any, there's no table.
    """
    worlds = {
        other.name.partition("@")[2]: {claim["claim"]: _verdict(claim) for claim in other.claims}
        for other in others
        if other.name.startswith(f"{found.name}@")
    }
    rows = [
        [
            claim["claim"],
            claim["expected"],
            _verdict(claim),
            *(them.get(claim["claim"], "") for them in worlds.values()),
        ]
        for claim in found.claims
        if any(claim["claim"] in them for them in worlds.values())
    ]
    if not rows:
        return found
    table = {"title": "In which world", "columns": ["claim", "expected", "usual body", *worlds], "rows": rows}
    return replace(found, tables=(table, *found.tables))


def _verdict(claim: Json) -> str:
    return f"{said(claim['measured'])}: {claim['verdict']}"


PAGE: Final = "reproduce.html"
DATA: Final = "reproduce.json"
CLAIMS_SCHEMA: Final = "vrs-claims/2"


def write_claims(out: Path, papers: Sequence[ClaimReport], beyond: Sequence[ClaimReport] = ()) -> Path:
    """Write the page and its JSON into an existing directory.

    Args:
        out: The directory.
        papers: What papers claim.
        beyond: What is claimed beyond them.

    Returns:
        The page.

    Raises:
        FormatError: If the directory can't hold them.
    """
    papers = [in_worlds(found, (*papers, *beyond)) for found in papers]
    with written(out, "can't hold the results"):
        (out / DATA).write_text(to_json(papers, beyond), encoding="utf-8")
        (out / PAGE).write_text(render(papers, beyond), encoding="utf-8", newline="\n")
    return out / PAGE


def to_json(papers: Sequence[ClaimReport], beyond: Sequence[ClaimReport] = ()) -> str:
    """Every claim as JSON; equal findings give equal texts."""
    document = {
        "schema": CLAIMS_SCHEMA,
        "counts": summed((*papers, *beyond)),
        "papers": [_plain(found) for found in papers],
        "beyond": [_plain(found) for found in beyond],
    }
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _plain(found: ClaimReport) -> dict[str, Any]:
    return {
        "name": found.name,
        "title": found.title,
        **dict(found.facts),
        "counts": found.counts,
        "claims": list(found.claims),
        "timings": list(found.timings),
    }


def render(papers: Sequence[ClaimReport], beyond: Sequence[ClaimReport] = ()) -> str:
    """The page as one HTML text; equal findings give equal texts."""
    own = summed(papers)["paper"]
    ours = summed((*papers, *beyond))["ours"]
    title = f"{own[Verdict.HOLDS]} of {sum(own.values())} claims of the papers hold"
    facts = tuple(
        (whose, ", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
        for whose, counts in (("the papers' own", own), ("ours", ours))
    )
    return page("claims.html", title=title, facts=facts, papers=papers, beyond=beyond)
