"""Bounds are generous: the machine that runs them is shared. `benchmarks/kinematics.py` has the figures."""

import statistics
import time
import timeit

import numpy as np

from robots import puma560

MODEL = puma560.model()
Q = np.random.default_rng(20).uniform(MODEL.limits.q_min, MODEL.limits.q_max, (2000, 6))


def microseconds(function, number=50, repeat=21):
    return statistics.median(timeit.repeat(function, number=number, repeat=repeat)) / number * 1e6


def test_one_branch_and_all_branches_are_quick():
    X, q = MODEL.forward(Q[0]), Q[0]
    words = MODEL.configuration(q)
    assert microseconds(lambda: MODEL.inverse_near(X, q, words)) < 60
    assert microseconds(lambda: MODEL.inverse_near(X, q)) < 60
    assert microseconds(lambda: MODEL.inverse(X)) < 500


def test_batches_are_100_times_faster_than_the_toolbox():
    import roboticstoolbox

    toolbox = roboticstoolbox.models.DH.Puma560()
    X = MODEL.forward(Q)
    ratios = []
    for _ in range(7):
        start = time.perf_counter()
        toolbox.ikine_a(X[:25])
        middle = time.perf_counter()
        puma560.inverse_batch(X)
        end = time.perf_counter()
        ratios.append((middle - start) / 25 / ((end - middle) / len(X)))
    assert statistics.median(ratios) >= 100
