"""Closed form of a relay's limit cycle against exact simulation, and its inversion."""

import itertools
import math

import numpy as np
import pytest

from identification.relay_cycle import invert_biased, invert_symmetric, limit_cycle
from loop.controller import Action
from loop.errors import NoLimitCycle
from loop.process import FOPDT
from loop.relay_feedback import Relay, simulate_relay

RATIOS = [0.05, 0.3, 1.0, 3.0, 10.0]


@pytest.mark.parametrize(
    ("K", "bias", "eps"), [(2.0, 0.3, 0.0), (2.0, 0.3, 0.1), (-1.5, -0.2, 0.05), (1.0, 0.0, 0.1)]
)
def test_the_closed_form_is_what_a_simulated_relay_does(K: float, bias: float, eps: float) -> None:
    process = FOPDT(K=K, tau=1.5, theta=0.6)
    cycle = limit_cycle(process, amplitude=1.0, bias=bias, hysteresis=eps)
    relay = Relay(amplitude=1.0, bias=bias, hysteresis=eps, action=Action.for_gain(K))
    dt = 0.0005
    run = simulate_relay(process, relay, t_end=12 * cycle.period, dt=dt)
    last = slice(-int(3 * cycle.period / dt), None)
    pv, op = run.pv[last], run.op[last]
    assert pv.max() == pytest.approx(cycle.highest, rel=2e-3)
    assert pv.min() == pytest.approx(cycle.lowest, rel=2e-3)
    switches = np.flatnonzero(np.diff(op))
    lengths = {bool(op[b] > bias): (b - a) * dt for a, b in itertools.pairwise(switches)}
    assert lengths[True] == pytest.approx(cycle.high_time, abs=2.5 * dt)
    assert lengths[False] == pytest.approx(cycle.low_time, abs=2.5 * dt)


@pytest.mark.parametrize("theta", RATIOS)
@pytest.mark.parametrize(("bias", "eps"), [(0.3, 0.0), (0.5, 0.02), (-0.2, 0.01), (0.8, 0.001)])
def test_the_half_periods_of_a_biased_relay_give_the_process_back(
    theta: float, bias: float, eps: float
) -> None:
    process = FOPDT(K=-1.7, tau=1.0, theta=theta)
    cycle = limit_cycle(process, amplitude=1.0, bias=bias, hysteresis=eps)
    found = invert_biased(
        K=process.K, amplitude=1.0, bias=bias, hysteresis=eps,
        high_time=cycle.high_time, low_time=cycle.low_time,
    )  # fmt: skip
    assert found.tau == pytest.approx(1.0, rel=1e-7)
    assert found.theta == pytest.approx(theta, rel=1e-7)


@pytest.mark.parametrize("theta", RATIOS)
@pytest.mark.parametrize("eps", [0.0, 0.02])
def test_swing_and_period_of_a_symmetric_relay_give_the_process_back(
    theta: float, eps: float
) -> None:
    process = FOPDT(K=2.0, tau=3.0, theta=3 * theta)
    cycle = limit_cycle(process, amplitude=0.5, hysteresis=eps)
    found = invert_symmetric(
        K=2.0, amplitude=0.5, hysteresis=eps, swing=cycle.amplitude, period=cycle.period
    )
    assert found.tau == pytest.approx(3.0, rel=1e-7)
    assert found.theta == pytest.approx(3 * theta, rel=1e-7)


def test_without_hysteresis_the_period_is_the_textbook_one() -> None:
    cycle = limit_cycle(FOPDT(K=1.0, tau=2.0, theta=1.0), amplitude=3.0)
    assert cycle.period == pytest.approx(4 * math.log(2 * math.exp(0.5) - 1), rel=1e-12)


def test_a_swing_that_is_off_moves_the_time_constant_but_half_periods_do_not_need_it() -> None:
    cycle = limit_cycle(FOPDT(K=1.0, tau=1.0, theta=10.0), amplitude=1.0)
    low = cycle.amplitude * 0.98
    found = invert_symmetric(K=1.0, amplitude=1.0, hysteresis=0.0, swing=low, period=cycle.period)
    assert found.theta / found.tau < 5  # truly 10


@pytest.mark.parametrize(("bias", "eps"), [(0.9, 0.2), (0.0, 2.0)])
def test_a_relay_that_cannot_pass_its_hysteresis_is_named(bias: float, eps: float) -> None:
    with pytest.raises(NoLimitCycle, match="stops switching"):
        limit_cycle(FOPDT(K=1.0, tau=1.0, theta=1.0), amplitude=1.0, bias=bias, hysteresis=eps)


@pytest.mark.parametrize(
    ("bias", "high", "low", "words"),
    [
        (0.0, 1.0, 1.0, "not biased"),
        (1.5, 1.0, 2.0, "without stopping"),
        (0.3, 2.0, 1.0, "half periods"),
        (0.1, 1.0, 9.0, "half periods"),
    ],
)
def test_half_periods_that_no_process_has_are_refused(
    bias: float, high: float, low: float, words: str
) -> None:
    with pytest.raises(NoLimitCycle, match=words):
        invert_biased(K=1.0, amplitude=1.0, bias=bias, hysteresis=0.0, high_time=high, low_time=low)


@pytest.mark.parametrize("swing", [0.05, 1.0, 2.0])
def test_a_swing_that_no_process_of_the_gain_has_is_refused(swing: float) -> None:
    with pytest.raises(NoLimitCycle, match="would swing"):
        invert_symmetric(K=1.0, amplitude=1.0, hysteresis=0.1, swing=swing, period=3.0)
