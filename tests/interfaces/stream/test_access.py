"""Who may come in."""

import os
import stat

import pytest

from interfaces.messages.control import Role
from interfaces.stream.access import Access, bearer, check_host, check_origin, hosts, make_tokens, read_tokens
from vrs.errors import FormatError, InvalidValueError

TOKENS = {Role.VIEWER: "v" * 43, Role.OPERATOR: "o" * 43, Role.ADMIN: "a" * 43, Role.SITE: "s" * 43}


def test_a_token_opens_its_role_and_those_below():
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
def test_nothing_else_opens_anything(token):
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


def test_a_token_shows_nowhere():
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
def test_a_file_that_others_may_read_is_refused(tmp_path, mode):
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
