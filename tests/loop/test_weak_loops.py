"""Loops whose gain is below 1 from the start: no gain crossover, yet a gain margin and peaks."""

import math

import numpy as np
import pytest

from loop.batch import PIDBatch, ProcessBatch
from loop.controller import PID
from loop.falling_batch import falling_margins
from loop.lag_loops import LagLoops
from loop.margin_batch import batch_margins
from loop.margins import margins
from loop.process import FOPDT, SOPDT, Process

NAMES = ("gain", "gain_reduction", "phase", "delay", "Ms", "Mt")


@pytest.mark.parametrize("K", [0.02, 0.5, 0.99, 0.9999])
def test_weak_loops_are_the_scalar_ones(K: float) -> None:
    """Second route: the scalar margins, which make no such distinction."""
    rng = np.random.default_rng(7)
    longer, Td = 10 ** rng.uniform(-2, 3, 20), 10 ** rng.uniform(-3, 1, 20)
    shorter = np.where(np.arange(20) % 2, 0.0, longer / 5)
    Td[::3] = 0.0
    processes = ProcessBatch(np.full(20, K), longer, shorter, np.zeros(20, int), np.ones(20))
    controllers = PIDBatch(np.ones(20), Td=Td)
    loops = LagLoops.of(processes, controllers, np.asarray(0.0), (20,))
    found, proven = falling_margins(loops)
    assert proven.sum() >= 14
    for i in np.flatnonzero(proven):
        process: Process = FOPDT(K=K, tau=longer[i], theta=1.0)
        if shorter[i]:
            process = SOPDT(K=K, tau1=longer[i], tau2=shorter[i], theta=1.0)
        one = margins(process, PID(Kc=1.0, Td=Td[i]))
        assert found.stable[i]
        assert (one.phase, one.delay) == (math.inf, math.inf)
        values = [float(getattr(found, name)[i]) for name in NAMES]
        assert values == pytest.approx([getattr(one, name) for name in NAMES], rel=1e-9)


def test_weak_and_strong_loops_in_one_batch_do_not_disturb_each_other() -> None:
    K = np.array([0.5, 5.0, 0.9, 2.0])
    controllers = PIDBatch(np.ones(4))
    mixed = LagLoops.of(
        ProcessBatch(K, np.full(4, 3.0), np.zeros(4), np.zeros(4, int), np.ones(4)),
        controllers, np.asarray(0.0), (4,),
    )  # fmt: skip
    together, proven = falling_margins(mixed)
    assert proven.all()
    for i in range(4):
        alone, _ = falling_margins(mixed.take(np.array([i])))
        for name in NAMES:
            assert getattr(together, name)[i] == pytest.approx(getattr(alone, name)[0], rel=1e-12)


def test_a_large_batch_is_worked_off_in_parts_that_do_not_show() -> None:
    """More loops than go through at once, and more that need the scan than it takes at a time."""
    n = 2400
    theta = np.geomspace(0.05, 20.0, n)
    plants = ProcessBatch(np.ones(n), np.ones(n), np.zeros(n), np.zeros(n, int), theta)
    controllers = PIDBatch(0.4 / theta, Ti=1.5 + 0 * theta, Td=0.4 * theta)
    whole = batch_margins(plants, controllers)
    for rows in (np.arange(0, n, 97), np.arange(n - 20, n)):
        part = PIDBatch(controllers.Kc[rows], Ti=controllers.Ti[rows], Td=controllers.Td[rows])
        alone = batch_margins(plants.take(rows), part)
        for name in NAMES:
            np.testing.assert_allclose(
                getattr(whole, name)[rows], getattr(alone, name), rtol=1e-9, atol=1e-12
            )
