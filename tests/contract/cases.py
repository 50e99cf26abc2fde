"""The table of commands whose output is kept: what a case runs, what it reads, and what of it is left out."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from tests.contract.doors import DATA

Line = tuple[str, ...]


SPEEDS: Final = {
    r'"timings": \[\n.*?\n  \]': '"timings": []',
    r"\w+: speed of this machine.*?└[^\n]*┘\n": "",
    r"<h4>Speed of this machine</h4>.*?</table>": "",
}
"""Papers' tables of how fast this machine is, in JSON, text and page."""


@dataclass(frozen=True, slots=True)
class Case:
    """Commands that are run one after the other in one directory."""

    name: str
    lines: tuple[Line, ...]
    """Arguments of `vrs`, a tuple a command."""
    stdin: str = ""
    """What each of them reads."""
    left_out: dict[str, str] = field(default_factory=dict)
    """Patterns in output and files that aren't compared, each with what is put in its place."""


def words(text: str) -> tuple[Line, ...]:
    """Commands as one types them, a line each."""
    return tuple(tuple(line.split()) for line in text.strip().splitlines())


def _runs() -> list[Case]:
    plan = "--commands data/plan.jsonl"
    return [
        Case("demo none", words(f"demo {plan} --delay none --seed 1 --json")),
        Case("demo wed", words(f"demo {plan} --delay wed --seed 3 --out here")),
        Case("demo trace", words(f"demo {plan} --delay trace:data/delays.csv --offset fixed:0.3")),
        *(
            Case(f"run {name}", words(f"run data/programs/{name}.v2 --delay {delay} --seed 2"), stdin="3\nAda\n")
            for name, delay in {
                "motions": "mon", "lines": "none", "signals": "constant:0.2", "react": "none", "alter": "none",
                "dialogue": "none", "timed": "gamma:0.1,0.05", "unreachable": "none",
            }.items()
        ),
        Case(
            "lab architectures",
            words("lab --architecture I --architecture extended --delay wed --runs 1 --length 2 --workers 1"
                " --out lab"),
        ),
        Case(
            "lab recorded",
            words(
                "lab --robot ipr --robot micro --operator slalom --transport stream --runs 1 --length 2 --seed 5"
                " --workers 1 --record --json --out lab"
            ),
        ),
        Case("lab localization", words("lab localization --runs 2 --length 2 --starts 1 --workers 1 --out lab")),
    ]  # fmt: skip


def _checks() -> list[Case]:
    names = sorted(path.stem for path in (DATA / "programs").glob("*.v2"))
    return [
        *(Case(f"check {name}", words(f"check data/programs/{name}.v2 --json")) for name in names),
        Case("check in words", words("check data/programs/types.v2\ncheck --static data/programs/react.v2")),
        *(
            Case(f"console {path.stem}", words("console --alone --files ."), stdin=path.read_text(encoding="utf-8"))
            for path in sorted((DATA / "console").glob("*.console"))
        ),
        Case(
            "rsp",
            words(
                """
                rsp model new rover.xmi
                rsp model show rover.xmi
                rsp model show rover.xmi --json
                rsp model check rover.xmi
                rsp generate rover.xmi --out code
                rsp model new rover.xmi
                """
            ),
        ),
    ]


def _papers() -> list[Case]:
    return [
        Case(
            f"reproduce {paper}",
            words(f"reproduce {paper} --runs 2 --workers 1 --out paper --length 2"),
            left_out=SPEEDS,
        )
        for paper in ("doulgeri", "han2001", "kim2002", "kim2006", "tipsuwan")
    ]


def _recordings() -> list[Case]:
    cases = []
    for path in sorted((DATA / "recordings").glob("*.mcap")):
        name, file = path.stem, f"data/recordings/{path.name}"
        lines = words(
            f"""
            compare {file} --json
            compare {file}
            export {file} --csv tables
            replay {file} --headless --at 1.5 --json
            replay {file} --commands --json
            """
        )
        cases.append(Case(f"recording {name}", lines))
    return cases


WRONG: Final = """
frobnicate
demo --frobnicate
demo --seed -1
demo --seed six
demo --delay sunday
demo --delay constant:-1
demo --delay trace:nothere.csv
demo --commands nothere.jsonl
demo --offset fixed:x
demo --service pigeon
run
run nothere.v2
run data/programs/syntax.v2
run data/programs/lines.v2 --limit 0
check nothere.v2
console --connect ftp://127.0.0.1
console --alone --files nothere
serve --host 0.0.0.0
serve --port 70000
serve --robot r2d2
serve --link-loss panic
serve --max-age 3
robot --listen nowhere
robot --rsp 127.0.0.1:0 --model nothere.xmi
replay nothere.mcap
replay data/plan.jsonl --headless
replay data/recordings/demo.mcap --headless --rate 9
compare nothere.mcap
compare data/plan.jsonl
export data/recordings/demo.mcap
lab
lab --runs 0 --out lab
lab --architecture IV --out lab
lab juggling --out lab
reproduce nobody --out out
link --listen 0 --to nowhere --delay none
link --listen 0 --to 127.0.0.1:9 --delay none --loss 2
rsp model check data/plan.jsonl
rsp generate nothere.xmi
"""


def _wrong() -> list[Case]:
    return [Case(f"wrong: {' '.join(line)}", (line,)) for line in words(WRONG)]


PAPERS: Final = _papers()
RECORDINGS: Final = _recordings()
COMMANDS: Final = [*_runs(), *_checks(), *_wrong()]
ALL: Final = {case.name: case for case in (*COMMANDS, *RECORDINGS, *PAPERS)}
