"""Margins of loops around processes that swing: the batch against the scalar, loop by loop."""

import math

import numpy as np
import pytest

from loop.batch import PIDBatch
from loop.controller import PID, Action
from loop.errors import UnstableLoop
from loop.margins import margins
from loop.process import FOPDT
from loop.swing import Swing, swing_margins, swings_of

NAMES = ("gain", "gain_reduction", "phase", "delay", "Ms", "Mt")


def test_every_loop_is_the_scalar_one() -> None:
    """Second route: the scalar margins, by another walk over the axis; damping down to 0.001."""
    rng = np.random.default_rng(3)
    swings = []
    for i in range(12):
        T, K = float(10 ** rng.uniform(-1, 2)), float(10 ** rng.uniform(-1, 1) * (-1) ** i)
        theta = float(T * 10 ** rng.uniform(-1.7, 0.8)) if i % 5 else 0.0
        swings.append(Swing(K=K, T=T, zeta=float(10 ** rng.uniform(-3, -0.01)), theta=theta))
    controllers = [
        PID(
            Kc=float(10 ** rng.uniform(-3, 0)),
            Ti=float(10 ** rng.uniform(-1, 2)) if i else math.inf,
            Td=float(10 ** rng.uniform(-1, 1)) if i % 2 else 0.0,
            tauF=0.1 if i == 3 else 0.0,
            action=Action.DIRECT if i % 3 == 0 else Action.REVERSE,
        )
        for i in range(8)
    ]
    found = swing_margins(swings, PIDBatch.stacked(controllers), sample_time=0.1)
    assert found.Ms.shape == (8, 12)
    stable = 0
    for row, pid in enumerate(controllers):
        for column, swing in enumerate(swings):
            values = [float(getattr(found, name)[row, column]) for name in NAMES]
            try:
                one = margins(swing.process, pid, sample_time=0.1)
            except UnstableLoop:
                assert not found.stable[row, column]
                assert values == [0.0, 0.0, 0.0, 0.0, math.inf, math.inf]
                continue
            stable += 1
            assert found.stable[row, column]
            assert values == pytest.approx([getattr(one, name) for name in NAMES], rel=1e-9)
    assert 15 < stable < 81


def test_processes_are_swings_together_or_not_at_all() -> None:
    swing = Swing(K=2.0, T=10.0, zeta=0.3, theta=5.0)
    (read,) = swings_of([swing.process]) or ()
    assert (read.K, read.T, read.zeta, read.theta) == pytest.approx((2.0, 10.0, 0.3, 5.0))
    assert swings_of([swing.process, FOPDT(K=1.0, tau=1.0, theta=1.0)]) is None
