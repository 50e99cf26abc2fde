from __future__ import annotations

import math
import pickle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robots.onboard.lease import (
    Ended,
    Grant,
    Lease,
    LeaseConfig,
    LeaseEnd,
    LeaseRefusal,
    LeaseState,
    Pending,
)
from robots.onboard.watchdog import LARGEST
from vrs.errors import InvalidValueError


def held(epoch: int = 0) -> Lease:
    lease = Lease(epoch=epoch)
    assert lease.acquire("ann", now=0.0) == Grant(epoch + 1, "ann", 0.0)
    return lease


def test_one_holder_at_a_time_and_the_epoch_rises() -> None:
    lease = held()
    assert lease.acquire("bob", now=0.1) is LeaseRefusal.HELD
    assert lease.acquire("ann", now=0.1) is LeaseRefusal.HELD
    assert lease.release(1, now=0.2) is None
    assert lease.epoch is None
    assert lease.acquire("bob", now=0.3) is LeaseRefusal.ENDING
    assert lease.advance(now=0.3) == Ended(1, "ann", LeaseEnd.RELEASED, 0.2)
    assert lease.stopped(now=0.4) is None
    assert lease.acquire("bob", now=0.5) == Grant(2, "bob", 0.5)


def test_a_stale_release_doesnt_clear_a_newer_take_over() -> None:
    """It did in rakazo #77."""
    lease = held()
    assert lease.take_over("eve", admin=True, now=0.1) == Pending("eve")
    assert lease.release(1, now=0.2) is LeaseRefusal.STALE_EPOCH
    assert lease.advance(now=0.2) == Ended(1, "ann", LeaseEnd.TAKEN_OVER, 0.1)
    assert lease.stopped(now=0.3) == Grant(2, "eve", 0.3)
    for epoch in (1, 0, 3, True, None, 2.0):
        assert lease.release(epoch, now=0.4) is LeaseRefusal.STALE_EPOCH  # type: ignore[arg-type]
        assert lease.heard(epoch, now=0.4) is LeaseRefusal.STALE_EPOCH  # type: ignore[arg-type]
    assert (lease.holder, lease.epoch) == ("eve", 2)
    assert lease.release(2, now=0.5) is None
    lease.advance(now=0.5)
    assert lease.stopped(now=0.6) is None
    assert lease.state is LeaseState.FREE


def test_no_epoch_releases_what_nobody_has() -> None:
    lease = Lease()
    assert lease.release(None, now=0.0) is LeaseRefusal.STALE_EPOCH  # type: ignore[arg-type]
    assert lease.state is LeaseState.FREE


def test_it_expires_without_heartbeats_and_is_free_once_the_robot_stands() -> None:
    lease = held()
    assert lease.heard(1, now=1.5) is None
    assert lease.next_deadline() == 3.5
    assert lease.advance(now=math.nextafter(3.5, 0)) is None
    assert lease.stopped(now=math.nextafter(3.5, 0)) is None
    assert lease.heard(1, now=3.5) is LeaseRefusal.STALE_EPOCH
    assert lease.stopped(now=3.5) is None
    assert lease.acquire("bob", now=3.5) is LeaseRefusal.ENDING
    assert lease.next_deadline() == 3.5
    assert lease.advance(now=3.6) == Ended(1, "ann", LeaseEnd.EXPIRED, 3.5)
    assert lease.advance(now=3.6) is None
    assert lease.acquire("bob", now=99.0) is LeaseRefusal.ENDING
    assert lease.stopped(now=99.0) is None
    assert lease.state is LeaseState.FREE


def test_nobody_is_promoted_silently() -> None:
    lease = held()
    lease.acquire("bob", now=0.1)
    lease.release(1, now=0.2)
    lease.acquire("bob", now=0.2)
    lease.advance(now=0.2)
    assert lease.stopped(now=0.3) is None
    assert (lease.state, lease.holder) == (LeaseState.FREE, None)


def test_only_an_admin_takes_over_and_the_last_of_them_gets_it() -> None:
    lease = held()
    before = pickle.dumps(lease)
    for admin in (False, None, 1, "yes"):
        assert lease.take_over("bob", admin=admin, now=0.1) is LeaseRefusal.NOT_ADMIN  # type: ignore[arg-type]
    assert pickle.dumps(lease) == before
    lease.take_over("eve", admin=True, now=0.1)
    lease.take_over("zoe", admin=True, now=0.2)
    lease.advance(now=0.2)
    assert lease.stopped(now=0.3) == Grant(2, "zoe", 0.3)


def test_where_it_is_free_a_take_over_just_acquires() -> None:
    assert Lease(epoch=5).take_over("eve", admin=True, now=1.0) == Grant(6, "eve", 1.0)


def test_epochs_end_at_64_bits_and_never_begin_again() -> None:
    lease = held(LARGEST - 1)
    assert lease.epoch == LARGEST
    assert lease.take_over("eve", admin=True, now=0.0) is LeaseRefusal.EXHAUSTED
    assert lease.holder == "ann"
    lease.release(LARGEST, now=0.0)
    lease.advance(now=0.0)
    lease.stopped(now=0.0)
    assert lease.acquire("bob", now=0.0) is LeaseRefusal.EXHAUSTED


@pytest.mark.parametrize("name", ["", "x" * 101, None, 3, b"ann"])
def test_a_holder_has_a_name(name: object) -> None:
    lease = Lease()
    assert lease.acquire(name, now=0.0) is LeaseRefusal.INVALID  # type: ignore[arg-type]
    assert lease.take_over(name, admin=True, now=0.0) is LeaseRefusal.INVALID  # type: ignore[arg-type]


@pytest.mark.parametrize("now", [math.nan, math.inf, 0.4])
def test_time_that_isnt_or_runs_back_is_refused(now: float) -> None:
    lease = held()
    lease.heard(1, now=0.5)
    before = pickle.dumps(lease)
    calls = (
        lambda: lease.acquire("bob", now=now),
        lambda: lease.take_over("bob", admin=True, now=now),
        lambda: lease.release(1, now=now),
        lambda: lease.heard(1, now=now),
        lambda: lease.stopped(now=now),
        lambda: lease.advance(now=now),
    )
    for call in calls:
        with pytest.raises(InvalidValueError):
            call()
    assert pickle.dumps(lease) == before


@pytest.mark.parametrize("timeout", [0.0, 61.0, math.nan, "2"])
def test_the_configuration_refuses(timeout: float) -> None:
    with pytest.raises(InvalidValueError, match="timeout"):
        LeaseConfig(timeout)


@pytest.mark.parametrize("epoch", [-1, LARGEST + 1, 1.0, True])
def test_the_first_epoch_is_one(epoch: int) -> None:
    with pytest.raises(InvalidValueError, match="epoch"):
        Lease(epoch=epoch)


CALLS = st.tuples(
    st.sampled_from(("acquire", "take_over", "release", "heard", "advance", "stopped")),
    st.floats(0, 1.5),
    st.integers(0, 3),
    st.sampled_from("abc"),
    st.booleans(),
)


@given(st.lists(CALLS, max_size=60))
@settings(max_examples=300, deadline=None)
def test_any_order_of_calls_keeps_the_laws(calls: list[tuple[str, float, int, str, bool]]) -> None:
    lease, now = Lease(), 0.0
    epochs = [0]
    told, asked = True, set[str]()
    alive = -math.inf
    for name, dt, back, holder, admin in calls:
        now += dt
        epoch = epochs[-1] - back
        was = lease.epoch if now < alive + 2.0 else None
        if name in ("acquire", "take_over"):
            free = lease.state is LeaseState.FREE
            answer = (
                lease.acquire(holder, now=now)
                if name == "acquire"
                else lease.take_over(holder, admin=admin, now=now)
            )
            if isinstance(answer, Grant):
                assert free
                assert told
                epochs.append(answer.epoch)
                alive = now
            if isinstance(answer, Pending):
                assert admin
                asked.add(holder)
                told = told and was is None
        elif name == "release":
            assert (lease.release(epoch, now=now) is None) == (was == epoch and was is not None)
            told = told and was != epoch
        elif name == "heard":
            counted = lease.heard(epoch, now=now) is None
            assert counted == (was == epoch and was is not None)
            alive = now if counted else alive
        elif name == "advance":
            ended = lease.advance(now=now)
            if ended is not None:
                assert ended.epoch == epochs[-1]
                told = True
        else:
            grant = lease.stopped(now=now)
            if isinstance(grant, Grant):
                assert grant.holder in asked
                asked.clear()
                epochs.append(grant.epoch)
                alive = now
        if lease.state is LeaseState.HELD:
            assert lease.epoch == epochs[-1]
        elif lease.state is LeaseState.ENDING:
            assert lease.epoch is None
    assert epochs == sorted(set(epochs))
