"""The table of programs that others wrote, in docs/val2.md: what was found, of what is known."""

from __future__ import annotations

import re
from pathlib import Path

from benchmarks import public_programs as public
from benchmarks.destinations import TURN, WAY

HOME = Path(__file__).parents[3]
KNOWN = public.known()
OTHERS = [one for one in KNOWN if one.repository]
FOUND = public.read()


def test_the_page_shows_what_was_found() -> None:
    assert public.page(FOUND) == public.PAGE.read_text(encoding="utf-8")
    assert public.PAGE.read_text(encoding="utf-8").count(public.table(FOUND)) == 1


def test_something_was_found_of_every_program_that_is_known() -> None:
    assert [public.key(one) for one in FOUND] == [public.key(one) for one in KNOWN]
    assert len({public.key(one) for one in KNOWN}) == len(KNOWN)


def test_every_file_has_a_commit_and_a_digest_of_its_own() -> None:
    files = {(one.repository, one.path): one.sha256 for one in OTHERS}
    assert all(re.fullmatch(r"[0-9a-f]{64}", digest) for digest in files.values())
    assert len(files) > 35
    assert len([path for repository, path in files if repository == "alexdu/robot-sandbox"]) == 32


def test_no_program_is_wrong() -> None:
    allowed = {public.RIGHT, public.AS_FAR, public.STILL, public.STOPS}
    assert {one.verdict for one in FOUND} <= allowed
    assert all(one.way <= WAY and one.turn <= TURN for one in FOUND)
    # What isn't right to its end says why.
    assert all(one.reason for one in FOUND if one.verdict in {public.AS_FAR, public.STOPS})
    assert all(one.destinations for one in FOUND if one.verdict in {public.RIGHT, public.AS_FAR})


def test_their_text_isnt_here() -> None:
    digests = {one.sha256 for one in OTHERS} | {digest for one in OTHERS for digest in one.files.values()}
    tracked = [
        path for folder in ("benchmarks", "examples", "tests", "docs") for path in (HOME / folder).rglob("*")
    ]
    assert not digests & {public.digest(path) for path in tracked if path.is_file()}
