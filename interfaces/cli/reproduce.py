"""`vrs reproduce`: what papers claim, measured."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from interfaces.cli.demo import prepare
from interfaces.cli.options import On, Resume, Workers, argument, bars, option, sweeping
from vrs.errors import InvalidValueError

if TYPE_CHECKING:
    from interfaces.lab import Paper, Reproduction, Study
    from interfaces.lab.claims import PaperPart
    from interfaces.lab.finished import FinishedRows
    from interfaces.lab.runner import Workers as Who
    from interfaces.report.claims import ClaimReport


def reproduce(
    ctx: typer.Context,
    paper: Annotated[
        str, argument("PAPER", "doulgeri, han2001, kim2002, kim2006, tipsuwan, or all for every paper.")
    ],
    out: Annotated[Path, option("DIR", "Where PAPER.json and the figures go.")],
    seed: Annotated[int, option("N", "Seed of everything random.", min=0, max=2**32 - 1)] = 0,
    runs: Annotated[
        int | None, option("K", "Runs behind each random figure; 10 unless given.", min=2, max=1000)
    ] = None,
    length: Annotated[
        float | None,
        option(
            "S",
            "Commands in each run last so long [s]; 20 for doulgeri, 120 for han2001, 30 for kim2006, 15 for "
            "tipsuwan.",
            min=2,
            max=3600,
        ),
    ] = None,
    beyond: Annotated[
        list[Path] | None,
        option(
            "FILE",
            "What is claimed beyond the papers, for the page: benchmarks/results.json, the summary.json of vrs lab "
            "localization, or PAPER.json of another --body; repeatable.",
        ),
    ] = None,
    body: Annotated[
        str,
        option(
            "bullet|mujoco",
            "World of physics that the robots are in, instead of the usual one; only claims on such robots are "
            "measured.",
        ),
    ] = "",
    workers: Workers = 2,
    on: On = "",
    resume: Resume = False,
    as_json: Annotated[
        bool, option("--json", "Write PAPER.json on standard output too, a document a paper.")
    ] = False,
) -> None:
    """Measure each claim of a paper with and without what it claims; with figures, and all claims on one page."""
    from interfaces.lab import Study, papers
    from interfaces.lab.output import to_json, write
    from interfaces.report.claims import read_verdicts, write_claims

    chosen = tuple(found for each in papers(paper) if (found := each.in_world(body)).parts)
    if not chosen:
        raise InvalidValueError("body", body, f"left out of {paper}: no robot in it has physics")
    more = [found for path in beyond or () for found in read_verdicts(path)]
    prepare(out, "reproduce.html", *(f"{each.name}.json" for each in chosen))
    studies = [
        (each, Study(seed, each.runs if runs is None else runs, each.length if length is None else length, body))
        for each in chosen
    ]
    with sweeping(ctx, out, workers, on, resume=resume) as (who, finished):
        made = [(found, write(found, out)) for found in measured(studies, who, finished)]
    written: list[ClaimReport] = []
    for reproduction, path in made:
        written.extend(read_verdicts(path))
        if as_json:
            typer.echo(to_json(reproduction), nl=False)
        else:
            show(reproduction, path)
    page = write_claims(out, written, more)
    if not as_json:
        typer.echo(f"Wrote {page}: all claims on one page")


def measured(chosen: Sequence[tuple[Paper, Study]], workers: Who, finished: FinishedRows) -> Iterator[Reproduction]:
    """Measure papers' claims, with a bar for each part; of several papers, one that is done has none any more."""
    from interfaces.lab import reproductions
    from interfaces.lab.runner import calls_of

    with bars("{task.description:26}") as bar:
        tasks = {
            part: bar.add_task(part.title, total=len(part.cases), completed=finished.ready(calls_of(part, asked)))
            for paper, asked in chosen
            for part in paper.parts
        }

        def advance(part: PaperPart) -> None:
            bar.advance(tasks[part])

        for made in reproductions(chosen, workers=workers, finished=finished, progress=advance):
            yield made
            for part in made.paper.parts if len(chosen) > 1 else ():
                bar.update(tasks[part], visible=False)


NARROWEST = 8
"""Characters that a column of a table needs to be read."""


def show(reproduction: Reproduction, path: Path) -> None:
    """Show the claims and tables that fit the console, and how many hold."""
    from rich.console import Console

    from interfaces.lab.claims import Verdict
    from interfaces.lab.output import rich_tables

    console = Console()
    for table in rich_tables(reproduction):
        if len(table.columns) * NARROWEST <= console.width:
            console.print(table)
        else:
            typer.echo(f"{table.title}: {table.row_count} rows, too wide for this console; see {path.name}")
    found = reproduction.findings
    for whose, ours in (("The paper's own claims", False), ("Ours", True)):
        of = [claim.verdict for claim in found.claims if claim.is_ours is ours]
        counts = ", ".join(f"{of.count(verdict)} {verdict}" for verdict in Verdict if verdict in of)
        typer.echo(f"{whose}: {counts or 'none'}")
    for claim in reproduction.failed:
        typer.echo(f"Doesn't hold: {claim.claim} ({claim.source})")
    typer.echo(f"Wrote {path} and {len(found.figures)} figures")
