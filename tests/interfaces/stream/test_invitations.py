"""Codes by which a class comes in: what they open, how long, and how many may be tried."""

import random

import pytest

from interfaces.messages.control import Role
from interfaces.stream import invitations as inv
from interfaces.stream.access import Access
from interfaces.stream.invitations import (
    ALPHABET,
    GRACE,
    LESSON,
    MEMBERS,
    RENEWED,
    Invitations,
    Membership,
    is_code,
)

TOKEN = "t" * 43


def codes(invitations, *, now=0.0):
    return {one.role: one.code for one in invitations.shown(now=now)}


def test_codes_are_short_and_unlike_each_other():
    shown = [one for k in range(200) for one in Invitations(0.0).shown(now=float(k > 100))]
    assert {len(one.code) for one in shown} == {6}
    assert {one.role for one in shown} == {Role.VIEWER, Role.OPERATOR}
    assert set("".join(one.code for one in shown)) == set(ALPHABET)
    assert not set(ALPHABET) & set("0O1IL2Z5S8BU")
    assert len({one.code for one in shown}) > 350


def test_two_roles_never_have_one_code():
    drawn = iter("AAAAAA" + "AAAAAA" + "AAAAAC")
    assert codes(Invitations(0.0, lambda _: next(drawn))) == {Role.VIEWER: "AAAAAA", Role.OPERATOR: "AAAAAC"}


@pytest.mark.parametrize("spelled", [str, str.lower, lambda code: f" {code[:3]}-{code[3:]} "])
def test_a_code_gives_its_role_however_it_is_spelled(spelled):
    invitations = Invitations(0.0)
    for role, code in codes(invitations).items():
        assert is_code(spelled(code))
        assert invitations.redeem(spelled(code), now=1.0) == Membership(role, 1.0 + LESSON)


@pytest.mark.parametrize("typed", ["", "AAAAAA", "A" * 100_000, "ß" * 6, "\N{KELVIN SIGN}" * 6, "é" * 5, "\0" * 6])
def test_anything_else_gives_nothing(typed):
    assert Invitations(0.0, random.Random(1).choice).redeem(typed, now=0.0) is None


def test_codes_are_renewed_and_the_old_ones_count_a_little_longer():
    invitations = Invitations(0.0)
    old = codes(invitations, now=RENEWED - 0.1)[Role.OPERATOR]
    new = codes(invitations, now=RENEWED)[Role.OPERATOR]
    assert old != new
    for code, until in ((old, RENEWED + GRACE), (new, 2 * RENEWED)):
        assert invitations.redeem(code, now=until - 0.1).role is Role.OPERATOR
    assert invitations.redeem(old, now=RENEWED + GRACE) is None
    assert invitations.redeem(new, now=10 * RENEWED) is None, "nobody had looked since"


def test_t17_tries_are_limited_by_address_and_in_total():
    invitations = Invitations(0.0)
    one = sum(invitations.may_try("one", now=0.0) for _ in range(1000))
    assert one == inv.OF_ADDRESS_AT_ONCE
    others = sum(invitations.may_try(f"{k}", now=0.0) for k in range(1000))
    assert one + others == inv.TRIES_AT_ONCE, "who tries too often takes none from the others"
    later = sum(invitations.may_try(f"{k % 50}", now=0.1 * k) for k in range(1, 10_001))
    assert later == pytest.approx(inv.TRIES * 1000, rel=0.01)
    # Whoever tries all through a lesson of 90 minutes, from everywhere, with four codes that count at a time.
    assert (inv.TRIES_AT_ONCE + 5400 * inv.TRIES) * 4 / len(ALPHABET) ** inv.LENGTH < 2e-4


def test_the_sessions_that_codes_opened_are_bounded_and_end():
    invitations = Invitations(0.0)
    for k in range(MEMBERS + 10):
        invitations.remember(f"session {k}", Membership(Role.VIEWER, LESSON))
    assert [invitations.member(f"session {k}") is None for k in (9, 10)] == [True, False]
    invitations.shown(now=LESSON + RENEWED)
    assert invitations.member("session 10") is None
    assert invitations.member(None) is None


def test_a_session_that_a_code_opened_is_a_token_of_its_role_and_a_code_is_none():
    invitations = Invitations(0.0)
    access = Access({Role.ADMIN: TOKEN}, free=(), invitations=invitations)
    invitations.remember("watches", Membership(Role.VIEWER, LESSON))
    invitations.remember("operates", Membership(Role.OPERATOR, LESSON))

    def opens(token):
        return [role for role in (Role.VIEWER, Role.OPERATOR, Role.ADMIN) if not access.refusal(role, token)]

    assert opens("watches") == [Role.VIEWER]
    assert opens("operates") == [Role.VIEWER, Role.OPERATOR]
    assert opens(TOKEN) == [Role.VIEWER, Role.OPERATOR, Role.ADMIN]
    for token in (None, "", "neither", *codes(invitations).values()):
        assert opens(token) == []
