"""Errors cross from one process to another as they are: a worker's is told like any other."""

from __future__ import annotations

import pickle

import pytest

from interfaces.stream.client_socket import UnreachableError
from vrs.errors import (
    FormatError,
    InvalidValueError,
    NonFiniteTimeError,
    OutOfLimitsError,
    PlanningError,
    UnknownCommandError,
    UnreachablePoseError,
    UnresolvedError,
    VrsError,
)


@pytest.mark.parametrize(
    "error",
    [
        VrsError("all"),
        InvalidValueError("speed", -1.0, "a number in (0, 1]"),
        NonFiniteTimeError(float("inf")),
        OutOfLimitsError(2, 9.0, -1.0, 1.0),
        UnreachablePoseError("too far"),
        UnknownCommandError(7, 3),
        PlanningError("no motion"),
        UnresolvedError(4, "0.3 m"),
        FormatError("plan.jsonl", "can't be read"),
        UnreachableError("ws://127.0.0.1:1/ws", "refused"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_an_error_is_the_same_in_another_process(error):
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), again.args) == (type(error), str(error), error.args)
    assert vars(again) == vars(error)
