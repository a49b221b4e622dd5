import math

import numpy as np
import pytest

from loop.controller import PID, Action
from loop.frequency_curves import bandwidths, frequency_curves, sensitivity_circle
from loop.margins import margins
from loop.nyquist import nyquist_count
from loop.process import FOPDT, IPDT, DoubleIntegrator, Process, TransferFunction
from loop.stability import unstable_poles

HEATER = FOPDT(K=2, tau=120, theta=30)
RUNNING = PID(Kc=0.45, Ti=135, Td=13.3)


def random_process(rng: np.random.Generator, kind: int) -> Process:
    K, theta = 10 ** rng.uniform(-1, 1), float(rng.choice([0, 10 ** rng.uniform(-1, 1)]))
    zeta = rng.uniform(0.001, 0.3)
    kinds: list[Process] = [
        FOPDT(K=K, tau=1.0, theta=theta),
        IPDT(K=K, theta=theta),
        DoubleIntegrator(K=K, theta=theta),
        TransferFunction((K,), (1.0, -1.0), theta),
        TransferFunction((K,), (1.0, 2 * zeta, 1.0), theta),
        TransferFunction((K,), (1.0, 0.0, 1.0, 0.0), theta),
        TransferFunction((-K, 2 * K), (1.0, 0.7, 1.0, 0.0), theta),
        TransferFunction((K, 0.0), (1.0, -0.4, 1.0), theta),
    ]
    return kinds[kind]


def test_encirclements_count_the_same_unstable_poles_as_the_direct_method() -> None:
    rng = np.random.default_rng(11)
    seen = set()
    for i in range(240):
        process = random_process(rng, i % 8)
        pid = PID(
            Kc=10 ** rng.uniform(-1.5, 1),
            Ti=float(rng.choice([math.inf, 10 ** rng.uniform(-1, 1)])),
            Td=float(rng.choice([0.0, 0.1])),
            action=Action.REVERSE if rng.random() < 0.9 else Action.DIRECT,
        )
        if i % 8 == 7 and pid.Ti < math.inf:
            continue  # the origin's hidden pole is no encirclement: see internal stability
        if i % 8 == 2 and process.theta == 0 and pid.Td == 0:
            continue  # always on the limit, or beyond
        found = nyquist_count(process, pid)
        assert found.closed_loop == unstable_poles(process, pid), (process, pid)
        assert found.encirclements == found.closed_loop - found.open_loop
        seen.add((found.open_loop, found.closed_loop > 0))
    assert {(0, False), (0, True), (1, False), (1, True), (2, True)} <= seen


def test_an_unstable_process_needs_its_turns() -> None:
    process = TransferFunction((1.0,), (10.0, -1.0), 1.0)
    found = nyquist_count(process, PID(Kc=3))

    assert (found.encirclements, found.open_loop, found.closed_loop) == (-1, 1, 0)
    kept = margins(process, PID(Kc=3))
    # K Kc = 1 is the least gain that holds it: the gain may fall threefold, no further.
    assert kept.gain_reduction == pytest.approx(1 / 3)
    assert kept.gain > 1
    assert nyquist_count(process, PID(Kc=0.9)).closed_loop == 1


def test_curves_that_cannot_be_counted_are_refused() -> None:
    with pytest.raises(ValueError, match="the function is zero, or all but zero, on the path"):
        nyquist_count(TransferFunction((1.0,), (1.0, 0.0, 1.0)), PID(Kc=1))
    with pytest.raises(ValueError, match="stays above 1 at high frequency"):
        nyquist_count(FOPDT(K=2, tau=1, theta=1), PID(Kc=1, Td=5, N=math.inf))
    with pytest.raises(ValueError, match="too often to follow"):
        nyquist_count(FOPDT(K=1e8, tau=1, theta=100), PID(Kc=100))


def test_the_circle_of_Ms_touches_the_curve() -> None:  # noqa: N802
    Ms = margins(HEATER, RUNNING).Ms
    circle = sensitivity_circle(Ms)
    curves = frequency_curves(HEATER, RUNNING, points=4000)

    np.testing.assert_allclose(np.abs(1 / (1 + circle)), Ms, rtol=1e-12)
    assert np.min(np.abs(1 + curves.L)) * Ms == pytest.approx(1.0, abs=1e-5)
    with pytest.raises(ValueError, match="Ms must be positive"):
        sensitivity_circle(0.0)


def test_bandwidths_stand_where_the_curves_cross_three_decibels() -> None:
    found = bandwidths(HEATER, RUNNING)
    assert found.S is not None
    assert found.T is not None
    assert found.wc is not None
    curves = frequency_curves(HEATER, RUNNING, w=np.array([found.S, found.T, found.wc]))

    assert abs(curves.S[0]) == pytest.approx(math.sqrt(0.5), rel=1e-9)
    assert abs(curves.T[1]) == pytest.approx(math.sqrt(0.5), rel=1e-9)
    assert abs(curves.L[2]) == pytest.approx(1.0, rel=1e-9)
    low = bandwidths(FOPDT(K=0.1, tau=1, theta=0), PID(Kc=1))
    assert (low.S, low.T, low.wc) == (None, None, None)
