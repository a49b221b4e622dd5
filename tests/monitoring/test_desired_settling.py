import numpy as np
import pytest
from scipy.signal import lfilter

from loop.controller import PID
from loop.process import FOPDT
from loop.signals import Real
from loop.simulation import simulate
from monitoring.desired_settling import desired_settling


def closed_loop(K: float, n: int, seed: int = 0) -> Real:
    """y = (1 - .2/q) a/(1 - 1/q + K/q^2): f = 1, .8 ... whatever K is."""
    a = np.random.default_rng(seed).normal(size=n + 500)
    return np.asarray(lfilter([1, -0.2], [1, -1, K], a)[500:])


@pytest.mark.parametrize("K", [0.1, 0.3, 0.5, 0.8])
@pytest.mark.parametrize("n", [4000, 60_000])
def test_the_example_with_a_closed_form_is_met(K: float, n: int) -> None:
    found = desired_settling(closed_loop(K, n, seed=1), 1.0, delay=2, tau_c=5.0)
    mu = np.exp(-1 / 5)
    desired = 1 + 0.8**2 + 0.8**2 * mu**2 / (1 - mu**2)
    f = lfilter([1, -0.2], [1, -1, K], np.r_[1, np.zeros(2000)])
    assert found.variance == pytest.approx(desired, rel=0.03)
    assert found.index == pytest.approx(desired / (f @ f), rel=0.05)
    assert found.comparable


def test_it_is_what_a_loop_with_that_response_to_the_same_disturbance_has() -> None:
    # A walking disturbance under a PI; the desired loop leaves (1 - T) d of it, with
    # T = q^-6 (1 - mu)/(1 - mu/q).
    n, tau_c = 30_000, 12.0
    d = np.cumsum(0.05 * np.random.default_rng(3).normal(size=n))
    run = simulate(
        FOPDT(K=1.0, tau=10.0, theta=5.0), PID(Kc=0.8, Ti=12.0), t_end=n - 1.0, dt=1.0,
        output_load=d - d[0],
    )  # fmt: skip
    mu = np.exp(-1 / tau_c)
    left = d - lfilter(np.r_[np.zeros(6), 1 - mu], [1.0, -mu], d)
    found = desired_settling(run.sp - run.pv, 1.0, delay=6, tau_c=tau_c)
    assert found.variance == pytest.approx(np.var(left), rel=0.06)
    assert found.index == pytest.approx(np.var(left) / np.var(run.pv), rel=0.06)


def test_a_longer_wish_asks_for_less_and_none_at_all_is_minimum_variance() -> None:
    y = closed_loop(0.3, 4000)
    quick, slow = (desired_settling(y, 1.0, delay=2, tau_c=tau_c).index for tau_c in (1e-3, 9.0))
    assert quick == pytest.approx(0.8321, abs=0.02)
    assert slow is not None
    assert slow > 1.5


def test_what_cannot_be_judged_says_why() -> None:
    assert desired_settling(np.arange(50.0), 1.0, delay=2, tau_c=9.0).index is None
    still = desired_settling(np.ones(900), 1.0, delay=2, tau_c=9.0, marks=("averaging",))
    assert still.basis.reasons == ("the error does not move",)
    assert not still.comparable
    grown = 1e-250 * 3.0 ** np.arange(600)
    boundless = desired_settling(grown, 1.0, delay=500, tau_c=1.0, order=1)
    assert boundless.basis.reasons == ("the autoregression of the error grows without bound",)
    with pytest.raises(ValueError, match="delay must be at least one"):
        desired_settling(np.ones(9), 1.0, delay=0, tau_c=1.0)
    with pytest.raises(ValueError, match="tau_c must lie within"):
        desired_settling(np.ones(9), 1.0, delay=1, tau_c=0.0)
