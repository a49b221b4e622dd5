"""Smooth and averaging tuning: the deviation that was allowed, seen in simulation."""

import math

import numpy as np
import pytest

from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.process import FOPDT, IPDT, SOPDT, DoubleIntegrator, Process, TransferFunction
from loop.simulation import simulate
from tuning.smooth import averaging_level, smooth_simc


def largest_deviation(process: Process, pid: PID, load: float, t_end: float) -> float:
    """Peak of |PV| after a load step at the process input."""
    response = simulate(process, pid, t_end=t_end, dt=t_end / 20_000, load=load)
    return float(np.abs(response.true_pv).max())


@pytest.mark.parametrize(
    ("process", "t_end"),
    [
        (FOPDT(K=2.0, tau=120.0, theta=10.0), 2000.0),
        (FOPDT(K=-2.0, tau=1200.0, theta=10.0), 4000.0),
        (IPDT(K=0.05, theta=4.0), 2000.0),
        (SOPDT(K=2.0, tau1=120.0, tau2=20.0, theta=5.0), 3000.0),
        (TransferFunction((0.05,), (5.0, 1.0, 0.0), 2.0), 2000.0),
    ],
    ids=["lag", "slow lag", "integrator", "two lags", "integrator with lag"],
)
@pytest.mark.parametrize("share", [1.0, 0.4])
def test_smooth_settings_hold_what_is_allowed_and_not_much_more(
    process: Process, t_end: float, share: float
) -> None:
    """Second route: the simulated peak, under the bound |u0|/Kc and within reach of it."""
    slope = abs(process.numerator[0] / process.denominator[-2])
    if isinstance(process, FOPDT):
        slope = abs(process.K) / process.tau
    elif isinstance(process, SOPDT):
        slope = abs(process.K) / process.tau1
    elif isinstance(process, IPDT):
        slope = abs(process.K)
    load = 3.0
    allowed = load * slope * 2 * process.theta / share
    found = smooth_simc(process, load=load, allowed=allowed)
    assert found.pid.action.sign == math.copysign(1.0, process.numerator[0])
    peak = largest_deviation(process, found.pid, load, t_end)
    assert 0.4 * allowed < peak < allowed
    assert found.tau_c == pytest.approx(process.theta * (2 / share - 1))


def test_the_gain_of_a_pi_is_the_ratio_itself() -> None:
    found = smooth_simc(FOPDT(K=2.0, tau=120.0, theta=30.0), load=5.0, allowed=20.0)
    assert found.pid.Kc == pytest.approx(5.0 / 20.0)
    assert "Kc = |u0|/|ymax| = 5/20" in found.sentence


def test_too_tight_a_limit_is_refused_with_what_can_be_had() -> None:
    heater = FOPDT(K=2.0, tau=120.0, theta=30.0)
    with pytest.raises(
        RuleNotApplicable, match=r"tau_c = 18 s; at tau_c = theta.*deviation of 10 "
    ):
        smooth_simc(heater, load=10.0, allowed=8.0)
    assert smooth_simc(heater, load=10.0, allowed=10.001).tau_c == pytest.approx(30.0, rel=1e-3)
    with pytest.raises(RuleNotApplicable, match="is not K"):
        smooth_simc(DoubleIntegrator(K=1.0, theta=1.0), load=1.0, allowed=1.0)


@pytest.mark.parametrize("theta", [0.0, 5.0, 40.0, 94.0])
def test_an_averaging_level_uses_the_tank_it_has(theta: float) -> None:
    """Second route: the simulated peak; exact without dead time, on the safe side with it."""
    tank = IPDT(K=0.01, theta=theta)
    found = averaging_level(tank, load=10.0, allowed=20.0)
    peak = largest_deviation(tank, found.pid, 10.0, 8000.0)
    if theta == 0:
        assert peak == pytest.approx(20.0, rel=2e-3)
    assert 0.7 * 20.0 < peak < 20.0 * 1.002


def test_a_dead_time_that_takes_the_whole_tank_is_refused() -> None:
    with pytest.raises(RuleNotApplicable, match=r"moves PV by 9.6 already, of 20 allowed"):
        averaging_level(IPDT(K=0.01, theta=96.0), load=10.0, allowed=20.0)
    with pytest.raises(RuleNotApplicable, match="it takes IPDT, not FOPDT"):
        averaging_level(FOPDT(K=1.0, tau=1.0, theta=1.0), load=1.0, allowed=1.0)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, 1e12])
@pytest.mark.parametrize("name", ["load", "allowed"])
def test_an_impossible_load_or_deviation_is_refused(name: str, value: float) -> None:
    numbers = {"load": 1.0, "allowed": 1.0} | {name: value}
    with pytest.raises(ValueError, match=f"{name} must lie within"):
        smooth_simc(IPDT(K=1.0, theta=1.0), **numbers)
    with pytest.raises(ValueError, match=f"{name} must lie within"):
        averaging_level(IPDT(K=1.0, theta=1.0), **numbers)
