"""Who may come in."""

import os
import resource
import stat

import pytest

from interfaces.cli.main import exit_status
from interfaces.messages.control import Role
from interfaces.stream.access import (
    Access,
    add_person,
    bearer,
    check_host,
    check_origin,
    end_person,
    hosts,
    make_tokens,
    read_people,
    read_tokens,
)
from vrs.errors import FormatError, InvalidValueError

TOKENS = {Role.VIEWER: "v" * 43, Role.OPERATOR: "o" * 43, Role.ADMIN: "a" * 43, Role.SITE: "s" * 43}


def test_t03_a_token_opens_its_role_and_those_below():
    access = Access(TOKENS, free=())
    opens = {(owner, role) for owner in Role for role in Role if not access.refusal(role, TOKENS[owner])}
    assert opens == {
        (Role.VIEWER, Role.VIEWER),
        (Role.OPERATOR, Role.VIEWER),
        (Role.OPERATOR, Role.OPERATOR),
        (Role.ADMIN, Role.VIEWER),
        (Role.ADMIN, Role.OPERATOR),
        (Role.ADMIN, Role.ADMIN),
        (Role.SITE, Role.SITE),
    }


@pytest.mark.parametrize("token", [None, "", "x" * 43, "a" * 42, "a" * 44, "a" * 100_000, "ä" * 43])
def test_t03_nothing_else_opens_anything(token):
    access = Access(TOKENS, free=())
    assert access.needs_tokens
    assert all(access.refusal(role, token) for role in Role)


def test_on_the_loopback_all_but_admins_and_sites_need_none():
    access = Access({Role.ADMIN: "a" * 43})
    assert not access.refusal(Role.VIEWER, None)
    assert not access.refusal(Role.OPERATOR, None)
    assert access.refusal(Role.ADMIN, None)
    assert access.refusal(Role.SITE, None)
    assert access.refusal(Role.VIEWER, "wrong")
    with pytest.raises(InvalidValueError, match="admin"):
        Access(free={Role.ADMIN})


def test_t04_a_token_shows_nowhere():
    access = Access(TOKENS, free=())
    said = [repr(access), str(vars(access)), *(access.refusal(role, "b" * 43) for role in Role)]
    assert not any(token in text for token in [*TOKENS.values(), "b" * 43] for text in said)
    with pytest.raises(InvalidValueError) as caught:
        Access({Role.VIEWER: "short"})
    assert "short" not in str(caught.value)


@pytest.mark.parametrize(("length", "long_enough"), [(42, False), (43, True), (256, True), (257, False)])
def test_a_token_has_43_to_256_characters(tmp_path, length, long_enough):
    path = tmp_path / "tokens"
    path.write_text("viewer " + length * "v")
    path.chmod(0o600)
    if long_enough:
        assert not Access(read_tokens(path), free=()).refusal(Role.VIEWER, length * "v")
        return
    with pytest.raises(FormatError, match="43 to 256"):
        read_tokens(path)
    with pytest.raises(InvalidValueError, match="43 to 256"):
        Access({Role.VIEWER: length * "v"})


def test_a_full_disk_leaves_no_part_of_a_token_file(tmp_path):
    path, (soft, hard) = tmp_path / "tokens", resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        with pytest.raises(FormatError, match="can't be written"):
            make_tokens(path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not path.exists()
    assert len(make_tokens(path)) == len(Role)


def test_the_token_that_a_request_shows():
    token = 43 * "v"
    assert bearer(f"Bearer {token}") == bearer(f"bearer {token}") == token
    for nothing in ("", "Bearer", "Bearer ", f"Basic {token}", token):
        assert bearer(nothing) is None
    assert bearer("Bearer " + 100_000 * "v") == 257 * "v"


def test_a_made_file_is_read_back(tmp_path):
    path = tmp_path / "tokens"
    before = os.umask(0)
    try:
        made = make_tokens(path)
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert read_tokens(path) == made
    assert set(made) == set(Role)
    assert len(set(made.values())) == 4
    assert all(len(token) == 43 for token in made.values())
    assert not Access(made, free=()).refusal(Role.ADMIN, made[Role.ADMIN])
    with pytest.raises(FormatError, match="exists"):
        make_tokens(path)


@pytest.mark.parametrize("mode", [0o644, 0o640, 0o604, 0o660, 0o400, 0o700])
def test_t04_a_file_that_others_may_read_is_refused(tmp_path, mode):
    path = tmp_path / "tokens"
    make_tokens(path)
    path.chmod(mode)
    with pytest.raises(FormatError, match="0600"):
        read_tokens(path)


@pytest.mark.parametrize(
    "text",
    ["", "\n", "viewer", "king " + "k" * 43, "viewer short", "viewer " + "v" * 43 + " more",
     "viewer " + "v" * 43 + "\nviewer " + "w" * 43, "viewer " + "v" * 5000, "\x00\xff"],
)  # fmt: skip
def test_a_file_with_anything_else_is_refused_and_not_shown(tmp_path, text):
    path = tmp_path / "tokens"
    path.write_text(text, encoding="latin-1")
    path.chmod(0o600)
    with pytest.raises(FormatError) as caught:
        read_tokens(path)
    assert "vvvv" not in str(caught.value)


def test_no_file_and_no_plain_file(tmp_path):
    for path in (tmp_path / "none", tmp_path):
        with pytest.raises(FormatError, match="token file"):
            read_tokens(path)


def test_people_have_tokens_of_their_own_that_end(tmp_path, monkeypatch):
    path = tmp_path / "tokens"
    ada, bo = (
        add_person(path, "ada", Role.OPERATOR, "2090-01-31"),
        add_person(path, "bo", Role.VIEWER, "2090-02-01"),
    )
    access = Access(read_tokens(path), free=(), people=path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert ada not in path.read_text()
    assert not access.refusal(Role.OPERATOR, ada)
    assert not access.refusal(Role.VIEWER, bo)
    assert access.refusal(Role.OPERATOR, bo)
    assert access.refusal(Role.ADMIN, ada)
    shown = [access.admit(Role.VIEWER, token) for token in (ada, bo, "x" * 43, None)]
    assert [one.person for one in shown] == ["ada", "bo", "", ""]
    assert access.admit(Role.OPERATOR, bo).person == "bo"
    kept = access.admit(Role.ADMIN, read_tokens(path)[Role.ADMIN])
    assert not access.refusal(Role.ADMIN, read_tokens(path)[Role.ADMIN])
    end_of_january = 3789590400.0
    monkeypatch.setattr("interfaces.stream.access.seconds_since_1970", lambda: end_of_january - 1.0)
    assert not access.refusal(Role.OPERATOR, ada)
    monkeypatch.setattr("interfaces.stream.access.seconds_since_1970", lambda: end_of_january)
    assert access.refusal(Role.OPERATOR, ada) == "this token has ended: ask for another one"
    assert [one.counts() for one in (shown[0], shown[1], kept)] == [False, True, True]
    end_person(path, "bo")
    assert access.refusal(Role.VIEWER, bo)
    again = access.admit(Role.VIEWER, add_person(path, "bo", Role.VIEWER, "2090-02-01"))
    assert [one.counts() for one in (shown[1], again, kept)] == [False, True, True]
    assert sorted(one.name for one in access.people.values()) == ["ada", "bo"]
    path.write_text("rubbish")
    assert sorted(one.name for one in access.people.values()) == ["ada", "bo"]


@pytest.mark.parametrize(
    ("name", "day"),
    [("a b", "2090-01-31"), ("", "2090-01-31"), ("ada", "2090-01-31"), ("bo", "2090-02-30"), ("bo", "soon")],
)
def test_nobody_else_gets_into_a_file(tmp_path, name, day):
    path = tmp_path / "tokens"
    add_person(path, "ada", Role.OPERATOR, "2090-01-31")
    before = path.read_bytes()
    with pytest.raises(InvalidValueError):
        add_person(path, name, Role.VIEWER, day)
    with pytest.raises(InvalidValueError, match="one of ada"):
        end_person(path, "bo")
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "line", ["operator sha256:12 ada 2090-01-31", "king sha256:" + 64 * "0" + " ada 2090-01-31",
             "viewer sha256:" + 64 * "0" + " ada 2090-13-01", "viewer sha256:" + 64 * "0" + " a/b 2090-01-01"],
)  # fmt: skip
def test_a_person_that_is_none_is_refused_with_its_line(tmp_path, line):
    path = tmp_path / "tokens"
    make_tokens(path)
    path.write_text(path.read_text() + line + "\n")
    with pytest.raises(FormatError, match="line 5"):
        read_people(path)


def test_the_command_makes_lists_and_ends_tokens(tmp_path, capsys):
    path = tmp_path / "tokens"
    assert exit_status(["token", "make", str(path), "ada", "--role", "operator", "--days", "1"]) == 0
    token = capsys.readouterr().out.strip()
    assert not Access(free=(), people=path).refusal(Role.OPERATOR, token)
    assert exit_status(["token", "list", str(path)]) == 0
    assert capsys.readouterr().out.startswith("ada operator 20")
    assert exit_status(["token", "end", str(path), "ada"]) == 0
    assert Access(free=(), people=path).refusal(Role.OPERATOR, token)
    for wrong in (
        ["end", str(path), "ada"],
        ["make", str(path), "bo", "--role", "king"],
        ["list", str(tmp_path / "x")],
    ):
        assert exit_status(["token", *wrong]) == 2


ALLOWED = hosts(["127.0.0.1", "localhost", "::1"], 8080)


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost:8080", "LOCALHOST:8080", "[::1]:8080"])
def test_this_server_by_its_names(host):
    assert check_host([host], ALLOWED)
    assert check_origin([f"http://{host}"], ALLOWED)
    assert check_origin([f"https://{host}"], ALLOWED)


@pytest.mark.parametrize(
    "host",
    ["", "127.0.0.1", "localhost:80", "evil.example:8080", "127.0.0.1:8080.evil.example", "localhost:8080 ",
     "a@localhost:8080", "127.1:8080", "localhost.:8080"],
)  # fmt: skip
def test_no_other_name(host):
    assert not check_host([host], ALLOWED)
    assert not check_origin([f"http://{host}"], ALLOWED)


def test_odd_headers():
    assert check_origin([], ALLOWED)
    assert not check_host([], ALLOWED)
    assert not check_host(["localhost:8080", "localhost:8080"], ALLOWED)
    for origin in ("null", "localhost:8080", "file://localhost:8080", "http://localhost:8080/", ""):
        assert not check_origin([origin], ALLOWED)
    assert not check_origin(["http://localhost:8080", "http://evil.example"], ALLOWED)
