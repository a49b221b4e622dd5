"""Simulated relay tests against the exact limit cycle of a first-order process with dead time."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from loop.controller import Action
from loop.errors import LoopDiverged
from loop.process import FOPDT, SOPDT, TransferFunction
from loop.relay_feedback import Relay, simulate_relay
from loop.signals import Real


def half_periods(t: Real, op: Real) -> tuple[float, float]:
    """Times at high and at low output in the last whole cycle. [s]"""
    switches = np.flatnonzero(np.diff(op) != 0) + 1
    a, b, c = t[switches[-3:]]
    went_high = op[switches[-3]] > op[switches[-3] - 1]
    return (b - a, c - b) if went_high else (c - b, b - a)


@settings(max_examples=12, deadline=None)
@given(
    tau=st.floats(5, 100),
    ratio=st.floats(0.2, 2),
    bias=st.floats(-0.4, 0.4),
    part=st.floats(0, 0.3),
)
def test_the_limit_cycle_is_the_exact_one(
    tau: float, ratio: float, bias: float, part: float
) -> None:
    """Printed: Au = (m0+m)K(1-1/E) + eps/E, T_high = T ln((2mKE+m0K-mK+eps)/(mK+m0K-eps)) ..."""
    K, m, theta = 2.0, 1.0, ratio * tau
    m0, eps, E = bias * m, part * K * m, math.exp(ratio)
    if eps > 0.9 * K * (m - abs(m0)):
        eps = 0.0
    dt = theta / 201.3
    run = simulate_relay(
        FOPDT(K=K, tau=tau, theta=theta),
        Relay(amplitude=m, hysteresis=eps, bias=m0),
        t_end=8 * (tau + 3 * theta) + 4 * tau,
        dt=dt,
        pv0=50,
        op0=30,
    )
    late = run.pv[run.t > 0.5 * run.t[-1]] - 50
    rise = dt * K * m * (1 + abs(bias)) / tau * 2  # what a scan may add before the relay looks
    assert late.max() == pytest.approx((m0 + m) * K * (1 - 1 / E) + eps / E, abs=rise)
    assert late.min() == pytest.approx((m0 - m) * K * (1 - 1 / E) - eps / E, abs=rise)
    high, low = half_periods(run.t, run.op)
    printed_high = tau * math.log((2 * m * K * E + m0 * K - m * K + eps) / (m * K + m0 * K - eps))
    printed_low = tau * math.log((2 * m * K * E - m * K - m0 * K + eps) / (m * K - m0 * K - eps))
    assert high == pytest.approx(printed_high, abs=4 * dt + 0.002 * printed_high)
    assert low == pytest.approx(printed_low, abs=4 * dt + 0.002 * printed_low)


def test_a_process_of_negative_gain_cycles_with_the_direct_action() -> None:
    a = simulate_relay(FOPDT(K=2, tau=30, theta=9), Relay(amplitude=5), t_end=300, dt=0.5)
    b = simulate_relay(
        FOPDT(K=-2, tau=30, theta=9),
        Relay(amplitude=5, action=Action.DIRECT),
        t_end=300,
        dt=0.5,
        pv0=10,
    )
    np.testing.assert_allclose(b.pv, 10 - a.pv, atol=1e-12)
    np.testing.assert_array_equal(a.op, b.op)


def test_noise_within_the_hysteresis_does_not_make_the_relay_chatter() -> None:
    process = SOPDT(K=2, tau1=30, tau2=10, theta=9)
    quiet = simulate_relay(process, Relay(amplitude=5, hysteresis=0.5), t_end=900, dt=0.5)
    noisy = simulate_relay(
        process,
        Relay(amplitude=5, hysteresis=0.5),
        t_end=900,
        dt=0.5,
        noise=0.1,
        rng=np.random.default_rng(2),
        resolution=0.05,
        pv0=0.02,
    )
    switches = np.count_nonzero(np.diff(noisy.op))
    assert abs(switches - np.count_nonzero(np.diff(quiet.op))) <= 1
    np.testing.assert_allclose(noisy.pv / 0.05, np.round(noisy.pv / 0.05), atol=1e-9)


def test_the_process_may_answer_at_once() -> None:
    run = simulate_relay(
        TransferFunction((1.0, 2.0), (1.0, 1.0), 0.5), Relay(amplitude=1), t_end=2, dt=0.5
    )
    # Before the answer arrives PV rests; at 0.5 s it jumps by D = 1 and is read just before.
    np.testing.assert_allclose(run.pv[:3], [0, 0, 2 - math.exp(-0.5)], atol=1e-12)


def test_a_process_that_no_relay_holds_is_refused() -> None:
    runaway = TransferFunction((1.0,), (1.0, -1.0), 5.0)
    with pytest.raises(LoopDiverged, match="grows without bound"):
        simulate_relay(runaway, Relay(amplitude=1), t_end=500, dt=0.5)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"amplitude": 0}, "amplitude must be positive"),
        ({"amplitude": 1, "hysteresis": -1}, "hysteresis must be"),
        ({"amplitude": 1, "bias": 1}, "bias must be smaller"),
    ],
)
def test_impossible_relays_are_refused_in_words(wrong: dict[str, float], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Relay(**wrong)
